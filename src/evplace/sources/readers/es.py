"""Event Stream (.es), versions 2, DVS and ATIS events: a few bytes an event, times as differences.

Layout: the Event Stream specification of A. Marcireau. Rows are counted from the bottom there, from the top
here.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.sources.readers._prophesee import head_of
from evplace.sources.readers._source import Block, Hints, Source

ABOUT = "Event Stream (.es) file"
MAGIC = b"Event Stream"
DVS, ATIS = 1, 2
BYTES = 1 << 21
"""Bytes decoded at a time."""


def matches(path: Path, head: bytes) -> bool:
    """Whether the file starts with the format's name."""
    return head.startswith(MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The header; UnsupportedError for a version or a kind of events that is not read."""
    head = head_of(path, 20)
    if len(head) < 20:
        raise RecordingError(f"{path} is cut off inside its header: no event can be read")
    if head[12] != 2:
        raise UnsupportedError(f"{path} is an Event Stream of version {head[12]}: version 2 can be read")
    if head[15] not in (DVS, ATIS):
        raise UnsupportedError(
            f"{path} is an Event Stream of kind {head[15]}: DVS (1) and ATIS (2) can be read"
        )
    width, height = int.from_bytes(head[16:18], "little"), int.from_bytes(head[18:20], "little")
    if width == 0 or height == 0:
        raise RecordingError(f"{path} states a sensor of {width}x{height} pixels: the header is damaged")
    return Source((width, height), partial(_blocks, path, head[15] == ATIS, height))


def _blocks(path: Path, atis: bool, height: int) -> Iterator[Block]:
    time_us, rest = 0, b""
    with path.open("rb") as file:
        file.seek(20)
        while data := file.read(BYTES):
            run = np.frombuffer(rest + data, np.uint8)
            room = len(run) // 5 + 1
            t_us, x, y = np.empty(room, np.int64), np.empty(room, np.uint16), np.empty(room, np.uint16)
            p = np.empty(room, np.bool_)
            count, used, time_us = _decode(run, atis, height, time_us, t_us, x, y, p)
            rest = run[used:].tobytes()
            yield Block(t_us[:count], x[:count], y[:count], p[:count])
    if rest:
        raise DamagedRecordingError(f"{path} is cut off inside its last event")


@njit(cache=True)
def _decode(
    run: NDArray[np.uint8],
    atis: bool,
    height: int,
    start_us: int,
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
) -> tuple[int, int, int]:
    """Fill the arrays; return the events, the bytes used up and the time.

    The first byte of an event holds the time since the last one above its flags; the greatest values of it
    only add to the time, except for the reset of a DVS stream (0xFE), which adds nothing.
    """
    time, count, i = start_us, 0, 0
    while i < len(run):
        byte = int(run[i])
        if atis and byte & 0xFC == 0xFC:
            time += 63 * (byte & 3)
            i += 1
            continue
        if not atis and byte >= 0xFE:
            time += 127 if byte == 0xFF else 0
            i += 1
            continue
        if i + 5 > len(run):
            break
        time += byte >> 2 if atis else byte >> 1
        if not (atis and byte & 1):  # ATIS also sends exposure measurements
            t_us[count] = time
            x[count] = run[i + 1] | np.uint16(run[i + 2]) << 8
            y[count] = height - 1 - (run[i + 3] | np.uint16(run[i + 4]) << 8)
            p[count] = byte >> 1 & 1 if atis else byte & 1
            count += 1
        i += 5
    return count, i, time
