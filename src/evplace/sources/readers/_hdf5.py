"""The layouts of events in HDF5, told by their keys.

| layout | where | time |
|---|---|---|
| DSEC | events/{t,x,y,p}, t_offset, ms_to_idx | us, plus t_offset |
| M3ED | prophesee/left/{t,x,y,p}, ms_map_idx, calib/resolution | us |
| NSAVP | events/{timestamps,x_coordinates,y_coordinates,polarities}; attributes width, height, units | ns |
| Prophesee | CD/events, one table of x, y, p, t | us |
| DDD20 | dvs/data, packets of bytes (see `_hdf5_packets`) | us |

Any other group or table with the four fields is read as well; its unit of time is guessed, or must be given.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, MissingExtraError, RecordingError
from evplace.core.events import Size
from evplace.sources.readers import _columns, _hdf5_packets
from evplace.sources.readers._source import Block, Hints, Source

EVENTS = 1 << 19
"""Events read at a time."""
KNOWN_UNITS = ("s", "ms", "us", "ns")
LONG_UNITS = {"seconds": "s", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"}
"""As NSAVP writes them, in the attribute `units`."""


class _Layout(NamedTuple):
    place: str
    """The group or table."""
    fields: dict[str, str]
    """Field -> its name there."""
    table: bool


def open_here(path: Path, hints: Hints) -> Source:
    """The first layout found; RecordingError where there is none, MissingExtraError for a missing filter."""
    try:
        _load_filters()
        with h5py.File(path, "r") as file:
            if _hdf5_packets.is_packets(file):
                return Source(_hdf5_packets.SIZE, partial(_hdf5_packets.blocks, path))
            layouts = _layouts(file)
            if not layouts:
                keys = ", ".join(list(file)[:10])
                raise RecordingError(
                    f"{path} is an HDF5 file without events (t, x, y, p): it holds {keys or 'nothing'}"
                )
            layout = layouts[0]
            _need_filters(path, file, layout)
            unit, notes = _unit(file, layout, hints)
            offset, size = _offset(file, layout), _size(file, layout)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise RecordingError(f"{path} is a damaged HDF5 file: {_one_line(error)}") from error
    if len(layouts) > 1:
        others = ", ".join(other.place for other in layouts[1:])
        notes.append(f"events are read from {layout.place}; there are more in {others}")
    return Source(size, partial(_blocks, path, layout, unit, offset), notes)


def _load_filters() -> None:
    with contextlib.suppress(ImportError):
        importlib.import_module("hdf5plugin")  # importing it is what makes its filters known


def _need_filters(path: Path, file: h5py.File, layout: _Layout) -> None:
    """Whether all that the events are packed with can be unpacked here; the error says what is missing."""
    group = file[layout.place]
    for table in [group] if layout.table else [group[name] for name in layout.fields.values()]:
        steps = table.id.get_create_plist()
        for code, *_, name in (steps.get_filter(number) for number in range(steps.get_nfilters())):
            if h5py.h5z.filter_avail(code):
                continue
            if "hdf5plugin" not in sys.modules:
                raise MissingExtraError("hdf5plugin", "hdf5", f"reading {path}")
            named = name.decode("ascii", "replace")
            raise RecordingError(
                f"{path} is packed with the HDF5 filter {code} ({named}), which is not known here"
            )


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _layouts(file: h5py.File) -> list[_Layout]:
    """Every group with four such rows and every table with four such fields, in the order of their names."""
    found: list[_Layout] = []

    def look(name: str, item: h5py.Group | h5py.Dataset) -> None:
        if isinstance(item, h5py.Dataset):
            names = list(item.dtype.names or ())
        else:
            names = [key for key in item if item.get(key, getclass=True) is h5py.Dataset]
        fields = _columns.named(names)
        if fields is not None:
            found.append(_Layout(name, fields, isinstance(item, h5py.Dataset)))

    look("/", file)
    file.visititems(look)
    return found


def _unit(file: h5py.File, layout: _Layout, hints: Hints) -> tuple[str, list[str]]:
    """The unit that the layout implies or an attribute states, else what `_columns` makes of the numbers."""
    if hints.time_unit is not None:
        return hints.time_unit, []
    group = file[layout.place]
    about = {} if layout.table else group[layout.fields["t"]].attrs
    for stated in (about.get("unit"), about.get("units")):
        unit = LONG_UNITS.get(stated, stated) if isinstance(stated, str) else None
        if unit in KNOWN_UNITS:
            return str(unit), []
    if layout.place == "CD/events" or {"ms_to_idx", "ms_map_idx"} & _keys_around(file, layout):
        return "us", []
    if layout.fields["x"] == "x_coordinates":
        return "ns", []
    sample = _rows(file, layout, 0, EVENTS)["t"]
    return _columns.time_unit(layout.fields["t"], sample, hints) if len(sample) else ("us", [])


def _keys_around(file: h5py.File, layout: _Layout) -> set[str]:
    """The names beside the events and one level above."""
    group = file[layout.place]
    return set(group.parent) | (set() if layout.table else set(group))


def _offset(file: h5py.File, layout: _Layout) -> int:
    """DSEC's t_offset in microseconds, which stands beside the events or above them."""
    group = file[layout.place]
    for holder in (group.parent,) if layout.table else (group, group.parent):
        if "t_offset" in holder and holder["t_offset"].shape == ():
            return int(holder["t_offset"][()])
    return 0


def _size(file: h5py.File, layout: _Layout) -> Size | None:
    """(width, height) from the attributes or entries in which the layouts keep it."""
    group = file[layout.place]
    for attributes in (group.attrs, group.parent.attrs, file.attrs):
        if "width" in attributes and "height" in attributes:
            return _possible(int(attributes["width"]), int(attributes["height"]))
        if isinstance(attributes.get("geometry"), str):
            width, _, height = attributes["geometry"].partition("x")
            return _possible(int(width), int(height))
    for holder in (group.parent, group):
        calibration = holder.get("calib/resolution") if isinstance(holder, h5py.Group) else None
        if calibration is not None and calibration.shape == (2,):
            return _possible(int(calibration[0]), int(calibration[1]))
    return None


def _possible(width: int, height: int) -> Size | None:
    return (width, height) if 0 < width <= 1 << 16 and 0 < height <= 1 << 16 else None


def _blocks(path: Path, layout: _Layout, unit: str, offset_us: int) -> Iterator[Block]:
    try:
        with h5py.File(path, "r") as file:
            for start in range(0, _length(file, layout), EVENTS):
                part = _rows(file, layout, start, EVENTS)
                block = _columns.block(part["t"], part["x"], part["y"], part["p"], unit)
                yield block if offset_us == 0 else block._replace(t_us=block.t_us + offset_us)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise DamagedRecordingError(f"{path} breaks off: {_one_line(error)}") from error


def _length(file: h5py.File, layout: _Layout) -> int:
    """Events in all; ValueError where the four rows differ in length."""
    group = file[layout.place]
    shapes = {group.shape} if layout.table else {group[name].shape for name in layout.fields.values()}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise ValueError(f"t, x, y and p must be rows of one length, not {sorted(shapes)}")
    return int(next(iter(shapes))[0])


def _rows(file: h5py.File, layout: _Layout, start: int, count: int) -> dict[str, NDArray[Any]]:
    """The four fields of a slice; TypeError where they are no numbers."""
    group, part = file[layout.place], slice(start, min(start + count, _length(file, layout)))
    table = group[part] if layout.table else None
    rows = {f: np.asarray(group[n][part] if table is None else table[n]) for f, n in layout.fields.items()}
    if not {field.dtype.kind for field in rows.values()} <= set("biuf"):
        raise TypeError("t, x, y and p must be numbers")
    return rows
