"""The layouts of events in HDF5, told by their keys.

| layout | where | time |
|---|---|---|
| DSEC | events/{t,x,y,p}, t_offset, ms_to_idx | us, plus t_offset |
| M3ED | prophesee/left/{t,x,y,p}, ms_map_idx, calib/resolution | us |
| NSAVP | events/{timestamps,x_coordinates,y_coordinates,polarities}; attributes width, height, units | ns |
| Prophesee | CD/events, one table of x, y, p, t | us |
| MVSEC | davis/{left,right}/events, (N, 4): x, y, t, p | s |
| v2e | events, (N, 4): t, x, y, p | us |
| e2vid | events/{ts,xs,ys,ps}; attribute sensor_resolution (height, width) | s |
| DDD20 | dvs/data, packets of bytes (see `_hdf5_packets`) | us |

Any other group or table with the four fields is read as well (see `_arrays`); its unit of time is guessed, or
must be given. What lies outside the file (external links and storage, virtual data sets) is not looked at.
"""

from __future__ import annotations

import contextlib
import importlib
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, MissingExtraError, RecordingError, UnsupportedError
from evplace.core.events import Size
from evplace.sources.readers import _arrays, _columns, _hdf5_packets
from evplace.sources.readers._arrays import Kind, Layout
from evplace.sources.readers._hdf5_links import arrays_in, outside
from evplace.sources.readers._hdf5_storage import written
from evplace.sources.readers._source import Block, Hints, Source, ordered, printable

EVENTS = 1 << 19
"""Events read at a time."""
FAULTS = (OSError, RuntimeError, ValueError, KeyError, TypeError)
"""What reading a damaged file raises."""


class _Found:
    """Events in a file: their group, and where they lie in it."""

    def __init__(self, group: str, layout: Layout, kinds: dict[str, Kind]) -> None:
        self.group = group
        self.layout = layout
        self.kinds = kinds


def open_here(path: Path, hints: Hints) -> Source:
    """The wanted events, else the first; the error says what the file holds instead, or what is missing."""
    try:
        _load_filters()
        with h5py.File(path, "r") as file:
            if _hdf5_packets.is_packets(file):
                return Source(_hdf5_packets.SIZE, partial(_hdf5_packets.blocks, path))
            places = _places(file, hints)
            if not places:
                raise _without_events(path, file)
            streams = ordered(path, list(places), hints.stream)
            found = places[streams[0]]
            if isinstance(found, str):
                raise RecordingError(f"{path}: {streams[0]}: {found}")
            _need_filters(path, file, found)
            unit, notes = _unit(file, found, hints)
            offset, size = _offset(file, found), _size(file[found.group])
    except FAULTS as error:
        raise RecordingError(f"{path} is a damaged HDF5 file: {_one_line(error)}") from error
    blocks = partial(_blocks, path, found, unit, offset)
    return Source(size, blocks, [*found.layout.notes, *notes], streams=streams)


def _without_events(path: Path, file: h5py.File) -> RecordingError:
    held = outside(file)
    if held:
        return UnsupportedError(
            f"{path} keeps {', '.join(held[:5])} outside itself (an external link, external storage or a "
            f"virtual data set), where evplace does not look: copy it into the file"
        )
    keys = printable(", ".join(list(file)[:10]))
    return RecordingError(f"{path} is an HDF5 file without events (t, x, y, p): it holds {keys or 'nothing'}")


def _places(file: h5py.File, hints: Hints) -> dict[str, _Found | str]:
    """Name of a group or table with events -> where they lie, or why that is not clear."""
    found: dict[str, _Found | str] = {}

    def look(name: str, group: h5py.Group | h5py.Dataset) -> None:
        if not isinstance(group, h5py.Group):
            return
        held = arrays_in(group)
        kinds = {key: Kind(rows.dtype, rows.shape) for key, rows in held.items() if rows.shape is not None}
        size = hints.size or _size(group)
        for key, layout in _arrays.layouts(kinds, partial(_sample, held), hints, size).items():
            place = "/".join(part for part in (name, key) if part) or "/"
            if not isinstance(layout, str):
                found[place] = _Found(name or "/", layout, kinds)
            elif "event" in place:
                found[place] = layout

    look("", file)
    file.visititems(look)
    return {printable(place): events for place, events in found.items()}


def _sample(held: dict[str, h5py.Dataset], name: str, rows: int) -> NDArray[Any]:
    """The first rows of a table, (n, k)."""
    table = held[name]
    upright = _arrays.is_upright(Kind(table.dtype, table.shape))
    return np.asarray(table[:rows] if upright else table[:, :rows].T)


def _load_filters() -> None:
    with contextlib.suppress(ImportError):
        importlib.import_module("hdf5plugin")  # importing it is what makes its filters known


def _need_filters(path: Path, file: h5py.File, found: _Found) -> None:
    """Whether all that the events are packed with can be unpacked here; the error says what is missing."""
    group = file[found.group]
    for table in [group[field.array] for field in found.layout.fields.values()]:
        steps = table.id.get_create_plist()
        for code, *_, name in (steps.get_filter(number) for number in range(steps.get_nfilters())):
            if h5py.h5z.filter_avail(code):
                continue
            if "hdf5plugin" not in sys.modules:
                raise MissingExtraError("hdf5plugin", "hdf5", f"reading {path}")
            named = name.decode("ascii", "replace")
            raise UnsupportedError(
                f"{path} is packed with the HDF5 filter {code} ({named}), which is not known here"
            )


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())


def _unit(file: h5py.File, found: _Found, hints: Hints) -> tuple[str, list[str]]:
    """The unit that the layout implies or an attribute states, else what `_columns` makes of the numbers."""
    if hints.time_unit is not None:
        return hints.time_unit, []
    group, time = file[found.group], found.layout.fields["t"]
    about = group[time.array].attrs
    for name in ("unit", "units"):
        unit = _columns.UNIT_WORDS.get(str(_value(about.get(name))).lower())
        if unit is not None and (time.name, time.column) == (None, None):
            return unit, []
    if f"{found.group}/{time.array}" == "CD/events" or {"ms_to_idx", "ms_map_idx"} & _keys_around(group):
        return "us", []
    if found.layout.fields["x"].array == "x_coordinates":
        return "ns", []
    times = next(_slices(file, found), {"t": np.empty(0)})["t"]
    return _columns.time_unit(found.layout.time_name, times, hints) if len(times) else ("us", [])


def _keys_around(group: h5py.Group) -> set[str]:
    """The names beside the events and one level above."""
    return set(group.parent) | set(group)


def _offset(file: h5py.File, found: _Found) -> int:
    """DSEC's t_offset in microseconds, which stands beside the events or above them."""
    group = file[found.group]
    for holder in (arrays_in(group), arrays_in(group.parent)):
        if "t_offset" in holder and holder["t_offset"].shape == ():
            return int(holder["t_offset"][()])
    return 0


def _size(group: h5py.Group) -> Size | None:
    """(width, height) from the attributes or entries in which the layouts keep it."""
    for about in (group.attrs, group.parent.attrs, group.file.attrs):
        if "width" in about and "height" in about:
            return _possible(_value(about["width"]), _value(about["height"]))
        if "sensor_resolution" in about:
            return _possible(*np.ravel(about["sensor_resolution"])[::-1])
        if "geometry" in about:
            return _possible(*str(_value(about["geometry"])).lower().split("x"))
    for holder in (group.parent, group):
        rows = arrays_in(holder)
        if {"width", "height"} <= set(rows):
            return _possible(_value(rows["width"][()]), _value(rows["height"][()]))
        if "sensor_resolution" in rows:
            return _possible(*np.ravel(rows["sensor_resolution"][()])[::-1])
        calibration = holder.get("calib", getclass=True) is h5py.Group and arrays_in(holder["calib"])
        if calibration and "resolution" in calibration:
            return _possible(*np.ravel(calibration["resolution"][()]))
    return None


def _value(stored: Any) -> Any:
    """What an attribute holds, however it was stored: a text, a number, or a list of numbers."""
    if isinstance(stored, np.ndarray | np.generic):
        stored = stored.tolist()
    if isinstance(stored, list) and len(stored) == 1:
        stored = stored[0]
    return stored.decode("utf-8", "replace") if isinstance(stored, bytes) else stored


def _possible(*size: Any) -> Size | None:
    """A size that a sensor can have; None for anything else."""
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError):
        return None
    return (width, height) if 0 < width <= 1 << 16 and 0 < height <= 1 << 16 else None


def _blocks(path: Path, found: _Found, unit: str, offset_us: int) -> Iterator[Block]:
    try:
        with h5py.File(path, "r") as file:
            for rows in _slices(file, found):
                block = _columns.of_rows(rows, unit, found.layout.part_ns)
                yield block if offset_us == 0 else block._replace(t_us=block.t_us + offset_us)
    except FAULTS as error:
        raise DamagedRecordingError(f"{path} breaks off: {_one_line(error)}") from error


def _slices(file: h5py.File, found: _Found) -> Iterator[dict[str, NDArray[Any]]]:
    """Slices of the fields, up to EVENTS long; each array is read once for all of its fields."""
    group, layout = file[found.group], found.layout
    length = _arrays.checked(found.group, layout, found.kinds)
    upright = {
        name: _is_rows(found.kinds[name]) for name in {field.array for field in layout.fields.values()}
    }
    events = _arrays.per_slice(layout, found.kinds, EVENTS)
    stored = min(written(group[name], 0 if rows else 1) for name, rows in upright.items())
    for start in range(0, min(length, stored), events):
        part = slice(start, min(start + events, length, stored))
        read = {name: group[name][part if rows else (slice(None), part)] for name, rows in upright.items()}
        yield {field: _picked(read[at.array], at, upright[at.array]) for field, at in layout.fields.items()}
    if stored < length:
        raise ValueError(f"of {length:,} events, those from {stored + 1:,} on were never written")


def _is_rows(kind: Kind) -> bool:
    """Whether events lie one below the other: all but (k, N)."""
    return len(kind.shape) < 2 or _arrays.is_upright(kind)


def _picked(rows: NDArray[Any], at: _arrays.Field, upright: bool) -> NDArray[Any]:
    if at.name is not None:
        return np.asarray(rows[at.name])
    if at.column is None:
        return np.asarray(rows)
    return np.asarray(rows[:, at.column] if upright else rows[at.column])
