"""HDF5 in the layout of DSEC: events/{t,x,y,p}, t_offset and ms_to_idx; sizes as attributes of the group.

Times are 64 bits wide, where DSEC has 32, so that recordings of more than 71 minutes fit.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Events, Size

ABOUT = "HDF5 in the layout of DSEC"
SUFFIX = ".h5"
CHUNK = 1 << 16
"""Events that are compressed together."""
FIELDS = {"t": np.int64, "x": np.uint16, "y": np.uint16, "p": np.uint8}


def write(path: Path, packets: Iterable[Events], size: Size) -> None:
    """Packets one after the other; the time of the first event becomes t_offset."""
    with h5py.File(path, "w") as file:
        group = file.create_group("events")
        group.attrs["width"], group.attrs["height"] = size
        for name, kind in FIELDS.items():
            group.create_dataset(
                name,
                (0,),
                kind,
                maxshape=(None,),
                chunks=(CHUNK,),
                compression="gzip",
                compression_opts=1,
                shuffle=True,
            )
        starts, offset_us = [np.zeros(0, np.int64)], None
        for packet in _gathered(packets):
            offset_us = int(packet.t_us[0]) if offset_us is None else offset_us
            starts.append(
                _millisecond_starts(packet.t_us - offset_us, sum(map(len, starts)), len(group["t"]))
            )
            _append(group, packet, offset_us)
        file["t_offset"] = np.int64(offset_us or 0)
        file["ms_to_idx"] = np.concatenate(starts)


def _gathered(packets: Iterable[Events]) -> Iterator[Events]:
    """Packets joined to at least CHUNK events, so that no chunk is compressed again and again."""
    held: list[Events] = []
    for packet in packets:
        held.append(packet)
        if sum(map(len, held)) >= CHUNK:
            yield Events.concatenate(held)
            held = []
    if held:
        yield Events.concatenate(held)


def _append(group: h5py.Group, packet: Events, offset_us: int) -> None:
    for name, rows in (("t", packet.t_us - offset_us), ("x", packet.x), ("y", packet.y), ("p", packet.p)):
        field = group[name]
        field.resize((len(field) + len(rows),))
        field[-len(rows) :] = rows


def _millisecond_starts(t_us: NDArray[np.int64], first_ms: int, first: int) -> NDArray[np.int64]:
    """For each millisecond from `first_ms` that begins in this packet, the first event at or after it."""
    milliseconds = np.arange(first_ms, int(t_us[-1]) // 1000 + 1)
    return first + np.searchsorted(t_us, milliseconds * 1000)
