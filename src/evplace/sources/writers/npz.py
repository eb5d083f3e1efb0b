"""numpy archives: arrays t_us, x, y and p, and the sensor's width and height."""

from __future__ import annotations

import io
import shutil
import tempfile
import zipfile
from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.events import Events, Size

ABOUT = "numpy archive with arrays t_us, x, y, p, width, height"
SUFFIX = ".npz"
FIELDS: tuple[tuple[str, np.dtype[Any]], ...] = (
    ("t_us", np.dtype(np.int64)),
    ("x", np.dtype(np.uint16)),
    ("y", np.dtype(np.uint16)),
    ("p", np.dtype(np.bool_)),
)


def write(path: Path, packets: Iterable[Events], size: Size) -> None:
    """Each array grows in a temporary file beside `path`, as its length must stand before it."""
    with ExitStack() as stack:
        files = [stack.enter_context(tempfile.TemporaryFile(dir=path.parent)) for _ in FIELDS]
        count = 0
        for packet in packets:
            count += len(packet)
            for file, field in zip(files, (packet.t_us, packet.x, packet.y, packet.p), strict=True):
                file.write(np.ascontiguousarray(field).data)
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for file, (name, dtype) in zip(files, FIELDS, strict=True):
                file.seek(0)
                with archive.open(_member(name), "w", force_zip64=True) as member:
                    member.write(_header(dtype, (count,)))
                    shutil.copyfileobj(file, member, 1 << 20)
            for name, value in zip(("width", "height"), size, strict=True):
                archive.writestr(_member(name), _header(np.dtype(np.int64), ()) + np.int64(value).tobytes())


def _member(name: str) -> zipfile.ZipInfo:
    """An array's place in the archive, always of one date: the same events give the same bytes."""
    member = zipfile.ZipInfo(f"{name}.npy")  # of 1980, where zip archives begin
    member.compress_type = zipfile.ZIP_DEFLATED
    member.external_attr = 0o600 << 16
    return member


def _header(dtype: np.dtype[Any], shape: tuple[int, ...]) -> bytes:
    head = io.BytesIO()
    description = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(head, description)
    return head.getvalue()
