"""Arrays in numpy's own format, read slice by slice: what one claims to hold never has to fit into memory.

Each is taken in the order in which its numbers lie: an array in Fortran's order as its transpose.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.core.events import Size
from evplace.sources.readers import _arrays, _columns
from evplace.sources.readers._arrays import Field, Kind, Layout
from evplace.sources.readers._source import Hints, Source, ordered, printable

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
"""What reading a damaged file raises."""
ROWS = "rows under names"
"""Stands for events in four arrays, where a file holds tables of events besides."""

Open = Callable[[str], AbstractContextManager[IO[bytes]]]
"""Opens an array by its name."""
_READ_HEADER = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
_Rows = dict[str, NDArray[Any]]


def source(path: Path, names: Sequence[str], opened: Open, size: Size | None, hints: Hints) -> Source:
    """The events in arrays of these names; RecordingError where there are none or they do not fit."""
    kinds = {name: _kind(opened, name) for name in names}
    found = _arrays.layouts(kinds, partial(_sample, opened, kinds), hints, hints.size or size)
    if not found:
        held = printable(", ".join(name for name in names if name)) or "one array of another kind"
        raise RecordingError(f"{path}: t, x, y and p are needed; it holds {held}")
    places = {(name or ROWS): layout for name, layout in found.items()} if names != ("",) else {"": found[""]}
    streams = ordered(path, list(places), hints.stream)
    layout = places[streams[0]]
    if isinstance(layout, str):
        raise RecordingError(f"{path}: {streams[0] or 'its table'}: {layout}")
    _arrays.checked(str(path), layout, kinds)
    with closing(_slices(opened, kinds, layout, SAMPLE)) as slices:
        times = next(slices, {"t": np.empty(0, np.int64)})["t"]
    unit, notes = _columns.time_unit(layout.time_name, times, hints) if len(times) else ("us", [])
    blocks = partial(_blocks, path, opened, kinds, layout, unit)
    named = [name for name in streams if name not in ("", ROWS) or len(streams) > 1]
    return Source(size, blocks, [*layout.notes, *notes], streams=named)


def number(opened: Open, name: str) -> int | None:
    """The whole number that an array holds; None where it holds something else."""
    kind = _kind(opened, name)
    if kind.dtype.kind not in "iu" or kind.shape != ():
        return None
    with opened(name) as file:
        _header(file, name)
        return int(np.frombuffer(file.read(kind.dtype.itemsize), kind.dtype)[0])


def _kind(opened: Open, name: str) -> Kind:
    with opened(name) as file:
        return _header(file, name)


def _header(file: IO[bytes], name: str) -> Kind:
    """The type and shape of an array whose file is at its start, and is then behind its header."""
    try:
        version = np.lib.format.read_magic(file)
        shape, fortran, dtype = _READ_HEADER[version](file)
    except Exception as error:  # the header is Python text: numpy lets through what its parser raises
        raise ValueError(f"the array '{printable(name)}' has a damaged header") from error
    if dtype.hasobject:
        raise UnsupportedError(f"the array '{printable(name)}' holds Python objects, which are not read")
    return Kind(dtype, tuple(reversed(shape)) if fortran else shape)


def _sample(opened: Open, kinds: dict[str, Kind], name: str, rows: int) -> NDArray[Any]:
    """The first rows of a table, (n, k)."""
    kind = kinds[name]
    count = kind.shape[1] if _arrays.is_upright(kind) else kind.shape[0]
    layout = Layout({str(column): Field(name, column=column) for column in range(count)}, "t")
    with closing(_slices(opened, kinds, layout, rows)) as slices:
        found = next(slices, {})
    return (
        np.stack([found[str(column)] for column in range(count)], axis=1) if found else np.empty((0, count))
    )


def _slices(
    opened: Open, kinds: dict[str, Kind], layout: Layout, events: int = EVENTS
) -> Generator[_Rows, None, None]:
    """Slices of the fields, `events` long, read side by side; EOFError where one ends before its time."""
    with ExitStack() as stack:
        files: dict[tuple[str, int | None], tuple[IO[bytes], np.dtype[Any]]] = {}
        for field in layout.fields.values():
            kind = kinds[field.array]
            key = field.array, _plane(kind, field)
            if key not in files:
                file = stack.enter_context(opened(field.array))
                files[key] = file, _row(_header(file, field.array))
                file.seek((key[1] or 0) * kind.shape[-1] * kind.dtype.itemsize if kind.shape else 0, 1)
        left, events = _arrays.checked("", layout, kinds), _arrays.per_slice(layout, kinds, events)
        while left > 0:
            parts = {key: _take(*files[key], min(left, events)) for key in files}
            count = min(map(len, parts.values()))
            if count:
                yield {f: _picked(parts, kinds[at.array], at)[:count] for f, at in layout.fields.items()}
            if count < min(left, events):
                raise EOFError("it ends too early")
            left -= count


def _plane(kind: Kind, field: Field) -> int | None:
    """The row of a table (k, N) that holds a field."""
    return field.column if field.column is not None and not _arrays.is_upright(kind) else None


def _row(kind: Kind) -> np.dtype[Any]:
    """What is read at once: a number, a struct, or a row of (N, k)."""
    upright = len(kind.shape) == 2 and _arrays.is_upright(kind)
    return np.dtype((kind.dtype, kind.shape[1:])) if upright else kind.dtype


def _take(file: IO[bytes], row: np.dtype[Any], count: int) -> NDArray[Any]:
    data = file.read(count * row.itemsize)
    return np.frombuffer(data, row, len(data) // row.itemsize)


def _picked(parts: dict[tuple[str, int | None], NDArray[Any]], kind: Kind, field: Field) -> NDArray[Any]:
    part = parts[field.array, _plane(kind, field)]
    if field.name is not None:
        return part[field.name]
    return part if part.ndim == 1 else part[:, field.column]


def _blocks(path: Path, opened: Open, kinds: dict[str, Kind], layout: Layout, unit: str) -> Iterator[Any]:
    try:
        for rows in _slices(opened, kinds, layout):
            yield _columns.of_rows(rows, unit, layout.part_ns)
    except FAULTS as error:
        raise DamagedRecordingError(f"{path} breaks off: {printable(str(error))}") from error
