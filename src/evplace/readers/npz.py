"""numpy archives (.npz): t, x, y and p as four arrays under usual names, or one array with such fields.

Arrays are unpacked slice by slice: what an archive claims to hold never has to fit into memory. Optional
arrays `width` and `height` state the sensor. Pickled arrays are refused.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from evplace.errors import DamagedRecordingError, RecordingError
from evplace.events import Size
from evplace.readers import _columns
from evplace.readers._source import Block, Hints, Source

ABOUT = "numpy archive (.npz) with arrays t, x, y, p"
EVENTS = 1 << 19
"""Events read at a time."""
FAULTS = (zipfile.BadZipFile, zlib.error, OSError, EOFError, NotImplementedError, RuntimeError, ValueError)
"""What reading a damaged archive raises."""

_Layout = dict[str, tuple[str, str | None]]
"""Field -> the member that holds it and, where that has fields, the name of the field."""


def matches(path: Path, head: bytes) -> bool:
    """Whether it is a zip archive that starts with an array."""
    return head.startswith(b"PK\x03\x04") and head[30:30 + head[26]].endswith(b".npy")  # fmt: skip


def read(path: Path, hints: Hints) -> Source:
    """The layout, sensor and unit of time; RecordingError where the four arrays are missing or do not fit."""
    try:
        with zipfile.ZipFile(path) as archive:
            dtypes = {name: _opened(archive, name)[1:] for name in _members(archive)}
            layout = _layout(path, dtypes)
            size = _size(archive, dtypes)
        sample = next(_columns_of(path, layout))["t"]
    except StopIteration:
        sample = np.empty(0, np.int64)
    except FAULTS as error:
        raise RecordingError(f"{path} is a damaged numpy archive: {error}") from error
    name = layout["t"][1] or layout["t"][0]
    unit, notes = _columns.time_unit(name, sample, hints) if len(sample) else ("us", [])
    return Source(size, partial(_blocks, path, layout, unit), notes)


def _members(archive: zipfile.ZipFile) -> list[str]:
    return [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]


def _opened(archive: zipfile.ZipFile, name: str) -> tuple[IO[bytes], np.dtype[Any], tuple[int, ...]]:
    """A member behind its header, its type and its shape; ValueError where it is none of plain numbers."""
    file = archive.open(f"{name}.npy")
    version = np.lib.format.read_magic(file)
    read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
    if version not in read_header:
        raise ValueError(f"the array '{name}' has the unknown format version {version}")
    shape, _, dtype = read_header[version](file)
    claimed = dtype.itemsize * int(np.prod(shape, dtype=object))
    if dtype.hasobject or claimed > archive.getinfo(f"{name}.npy").file_size:
        raise ValueError(f"the array '{name}' holds Python objects or claims more than is there")
    return file, dtype, shape


def _layout(path: Path, dtypes: dict[str, tuple[np.dtype[Any], tuple[int, ...]]]) -> _Layout:
    """Where each field is; RecordingError where one is missing or the lengths differ."""
    for member, (dtype, _) in dtypes.items():
        fields = _columns.named(list(dtype.names or ()))
        if fields is not None:
            return {field: (member, name) for field, name in fields.items()}
    members = _columns.named(list(dtypes))
    if members is None:
        raise RecordingError(
            f"{path} holds the arrays {', '.join(dtypes) or '(none)'}: t, x, y and p are needed"
        )
    shapes = {dtypes[member][1] for member in members.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise RecordingError(
            f"{path}: its arrays have the shapes {sorted(shapes)}: they must be rows of one length"
        )
    return {field: (member, None) for field, member in members.items()}


def _size(archive: zipfile.ZipFile, dtypes: dict[str, tuple[np.dtype[Any], tuple[int, ...]]]) -> Size | None:
    if not {"width", "height"} <= dtypes.keys():
        return None
    width, height = (int(np.load(archive.open(f"{n}.npy"), allow_pickle=False)) for n in ("width", "height"))
    return (width, height) if 0 < width <= 1 << 16 and 0 < height <= 1 << 16 else None


def _columns_of(path: Path, layout: _Layout) -> Iterator[dict[str, NDArray[Any]]]:
    """Slices of the four fields, read from the members side by side."""
    with ExitStack() as stack:
        archive = stack.enter_context(zipfile.ZipFile(path))
        members = {name: _opened(archive, name) for name in {member for member, _ in layout.values()}}
        left = min(shape[0] if shape else 0 for _, _, shape in members.values())
        while left > 0:
            count = min(left, EVENTS)
            parts = {name: _slice(file, dtype, count) for name, (file, dtype, _) in members.items()}
            yield {f: parts[m] if name is None else parts[m][name] for f, (m, name) in layout.items()}
            left -= count


def _slice(file: IO[bytes], dtype: np.dtype[Any], count: int) -> NDArray[Any]:
    data = file.read(count * dtype.itemsize)
    if len(data) < count * dtype.itemsize:
        raise EOFError("an array ends too early")
    return np.frombuffer(data, dtype, count)


def _blocks(path: Path, layout: _Layout, unit: str) -> Iterator[Block]:
    try:
        for part in _columns_of(path, layout):
            yield _columns.block(part["t"], part["x"], part["y"], part["p"], unit)
    except FAULTS as error:
        raise DamagedRecordingError(f"{path} breaks off: {error}") from error
