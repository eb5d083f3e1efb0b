"""numpy archives (.npz): t, x, y and p as four arrays under usual names, or one array with such fields.

Arrays are unpacked slice by slice: what an archive claims to hold never has to fit into memory. Optional
arrays `width` and `height` state the sensor. Pickled arrays are refused.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Generator, Iterator
from contextlib import ExitStack, closing, contextmanager
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Size
from evplace.sources.readers import _columns
from evplace.sources.readers._source import Block, Hints, Source

ABOUT = "numpy archive (.npz) with arrays t, x, y, p"
EVENTS = 1 << 19
"""Events read at a time."""
SAMPLE = 1 << 14
"""Events from whose times the unit is told."""
FAULTS = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    OSError,
    EOFError,
    LookupError,
    RuntimeError,
    ValueError,
)
"""What reading a damaged archive raises."""

_READ_HEADER = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_Member = tuple[IO[bytes], np.dtype[Any], tuple[int, ...]]
_Dtypes = dict[str, tuple[np.dtype[Any], tuple[int, ...]]]
"""Member -> its type and shape."""
_Layout = dict[str, tuple[str, str | None]]
"""Field -> the member that holds it and, where that has fields, the name of the field."""


def matches(path: Path, head: bytes) -> bool:
    """Whether it is a zip archive that starts with an array."""
    return head.startswith(b"PK\x03\x04") and head[30 : 30 + int.from_bytes(head[26:28], "little")].endswith(
        b".npy"
    )


def read(path: Path, hints: Hints) -> Source:
    """The layout, sensor and unit of time; RecordingError where the four arrays are missing or do not fit."""
    try:
        with zipfile.ZipFile(path) as archive:
            dtypes = {name: _dtype(archive, name) for name in _members(archive)}
            layout = _layout(path, dtypes)
            size = _size(archive, dtypes)
        with closing(_columns_of(path, layout, SAMPLE)) as slices:
            sample = next(slices)["t"]
    except StopIteration:
        sample = np.empty(0, np.int64)
    except FAULTS as error:
        raise RecordingError(f"{path} is a damaged numpy archive: {error}") from error
    name = layout["t"][1] or layout["t"][0]
    unit, notes = _columns.time_unit(name, sample, hints) if len(sample) else ("us", [])
    return Source(size, partial(_blocks, path, layout, unit), notes)


def _members(archive: zipfile.ZipFile) -> list[str]:
    return [name.removesuffix(".npy") for name in archive.namelist() if name.endswith(".npy")]


@contextmanager
def _opened(archive: zipfile.ZipFile, name: str) -> Iterator[_Member]:
    """A member behind its header, its type and its shape; ValueError where it is none of plain numbers."""
    with archive.open(f"{name}.npy") as file:
        try:
            version = np.lib.format.read_magic(file)
            shape, _, dtype = _READ_HEADER[version](file)
        except Exception as error:  # the header is Python text: numpy lets through what its parser raises
            raise ValueError(f"the array '{name}' has a damaged header") from error
        claimed = dtype.itemsize * int(np.prod(shape, dtype=object))
        if dtype.hasobject or claimed > archive.getinfo(f"{name}.npy").file_size:
            raise ValueError(f"the array '{name}' holds Python objects or claims more than is there")
        yield file, dtype, shape


def _dtype(archive: zipfile.ZipFile, name: str) -> tuple[np.dtype[Any], tuple[int, ...]]:
    with _opened(archive, name) as (_, dtype, shape):
        return dtype, shape


def _layout(path: Path, dtypes: _Dtypes) -> _Layout:
    """Where each field is; RecordingError where one is missing, holds no numbers, or the lengths differ."""
    layout = _named(dtypes)
    if layout is None:
        held = ", ".join(dtypes) or "none"
        raise RecordingError(f"{path}: t, x, y and p are needed; the arrays in it are: {held}")
    kinds = {
        (dtypes[member][0] if name is None else dtypes[member][0][name]).kind
        for member, name in layout.values()
    }
    shapes = {dtypes[member][1] for member, _ in layout.values()}
    if not kinds <= set("biuf") or len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise RecordingError(
            f"{path}: t, x, y and p must be rows of numbers of one length, not {sorted(shapes)}"
        )
    return layout


def _named(dtypes: _Dtypes) -> _Layout | None:
    for member, (dtype, _) in dtypes.items():
        fields = _columns.named(list(dtype.names or ()))
        if fields is not None:
            return {field: (member, name) for field, name in fields.items()}
    members = _columns.named(list(dtypes))
    return None if members is None else {field: (member, None) for field, member in members.items()}


def _size(archive: zipfile.ZipFile, dtypes: _Dtypes) -> Size | None:
    size = []
    for name in ("width", "height"):
        dtype, shape = dtypes.get(name, (np.dtype(np.float64), ()))
        if dtype.kind not in "iu" or shape != ():
            return None
        with _opened(archive, name) as (file, _, _):
            size.append(int(_slice(file, dtype, 1)[0]))
    return (size[0], size[1]) if min(size) > 0 and max(size) <= 1 << 16 else None


def _columns_of(
    path: Path, layout: _Layout, events: int = EVENTS
) -> Generator[dict[str, NDArray[Any]], None, None]:
    """Slices of the four fields, `events` long, read from the members side by side."""
    with ExitStack() as stack:
        archive = stack.enter_context(zipfile.ZipFile(path))
        members = {
            name: stack.enter_context(_opened(archive, name))
            for name in {name for name, _ in layout.values()}
        }
        left = min(shape[0] if shape else 0 for _, _, shape in members.values())
        while left > 0:
            count = min(left, events)
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
