"""Packets of a DAVIS camera in HDF5, as DDD20 holds them: dvs/data has three strings of bytes a packet.

The strings are the computer's time, the packet's header and its events, in the layout of cAER
(github.com/SensorsINI/ddd20-utils, interfaces/caer.py). Polarity events are two 32-bit words: x in the upper
15 bits, y in the next 15, then polarity and a bit that says whether the event is valid; and the camera's time
in microseconds. That clock is reset now and then: events are put on the computer's clock (microseconds since
1970, dvs/timestamp), at the first packet and wherever the camera's time falls back by over a second.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError
from evplace.sources.readers._hdf5_links import arrays_in
from evplace.sources.readers._source import Block, gathered

PLACE = "dvs/data"
TIMES = "timestamp"
SIZE = (346, 260)
_HEADER = struct.Struct("<hhiiiiii")
"""Type, source, bytes an event, offset of the time, overflow of the time, capacity, number, valid ones."""
_POLARITY = 1
_ROWS = 128
_FALL_US = 1_000_000


def is_packets(file: h5py.File) -> bool:
    """Whether the file holds such packets."""
    group, name = PLACE.split("/")
    if not isinstance(file.get(group, getlink=True), h5py.HardLink) or not isinstance(
        file[group], h5py.Group
    ):
        return False
    held = arrays_in(file[group])
    if not {name, TIMES} <= set(held):
        return False
    rows = held[name]
    return bool(rows.ndim == 2 and rows.shape[1] == 3 and rows.dtype.kind == "O")


def blocks(path: Path) -> Iterator[Block]:
    """The events of all packets; DamagedRecordingError where they break off."""
    return gathered(_blocks(path))


def _blocks(path: Path) -> Iterator[Block]:
    ahead_us: int | None = None
    last_us = 0
    try:
        for received_us, header, data in _packets(path):
            events = _polarity_events(header, data)
            if not len(events):
                continue
            t_us = events[:, 1].astype(np.int64) + (_HEADER.unpack(header)[4] << 31)
            first, last = int(t_us[0]), int(t_us[-1])
            if ahead_us is None or first < last_us - _FALL_US:
                ahead_us = received_us - last
            last_us = last
            yield _block(events[:, 0], t_us + ahead_us)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, IndexError, struct.error) as error:
        raise DamagedRecordingError(f"{path} breaks off: {' '.join(str(error).split())}") from error


def _packets(path: Path) -> Iterator[tuple[int, bytes, NDArray[np.uint8]]]:
    """The computer's time, header and data of each packet; rows that were never written are left out."""
    with h5py.File(path, "r") as file:
        rows, times = file[PLACE], file[PLACE].parent[TIMES]
        for start in range(0, len(rows), _ROWS):
            part = slice(start, start + _ROWS)
            for received_us, (_, header, data) in zip(times[part], rows[part], strict=True):
                if len(header):
                    yield int(received_us), np.asarray(header, np.uint8).tobytes(), np.asarray(data, np.uint8)


def _polarity_events(header: bytes, data: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """(n, 2) words of the events, none for a packet of another kind."""
    kind, _, width, *_ = _HEADER.unpack(header)
    if kind != _POLARITY:
        return np.empty((0, 2), np.uint32)
    if width != 8:
        raise ValueError(f"a polarity event of {width} bytes: 8 are known")
    words: NDArray[np.uint32] = np.frombuffer(data.tobytes(), "<u4").reshape(-1, 2)
    return words[(words[:, 0] & 1).astype(np.bool_)]


def _block(words: NDArray[Any], t_us: NDArray[np.int64]) -> Block:
    x, y = (words >> 17).astype(np.uint16), (words >> 2 & 0x7FFF).astype(np.uint16)
    return Block(t_us, x, y, (words >> 1 & 1).astype(np.bool_))
