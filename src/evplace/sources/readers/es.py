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

from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.sources.readers._canvas import Canvas, Sink, compiled, put, sink_of
from evplace.sources.readers._prophesee import head_of
from evplace.sources.readers._source import Block, Hints, Source

ABOUT = "Event Stream (.es) file"
MAGIC = b"Event Stream"
DVS, ATIS = 1, 2
BYTES = 1 << 18
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
    blocks = partial(_blocks, path, head[15] == ATIS, height)
    return Source((width, height), blocks, onto=blocks)


def _blocks(path: Path, atis: bool, height: int, canvas: Canvas | None = None) -> Iterator[Block]:
    time_us, rest = 0, b""
    with path.open("rb") as file:
        file.seek(20)
        while data := file.read(BYTES):
            run = np.frombuffer(rest + data, np.uint8)
            sink = sink_of(canvas, len(run) // 5 + 1)
            used, time_us = _decode(run, atis, height, time_us, sink)
            rest = run[used:].tobytes()
            yield sink.block()
    if rest:
        raise DamagedRecordingError(f"{path} is cut off inside its last event")


@compiled
def _decode(
    run: NDArray[np.uint8],
    atis: bool,
    height: int,
    start_us: int,
    sink: Sink,
) -> tuple[int, int]:
    """Hand the events on; return the bytes used up and the time.

    The first byte of an event holds the time since the last one above its flags; the greatest values of it
    only add to the time, except for the reset of a DVS stream (0xFE), which adds nothing.
    """
    time, i = start_us, 0
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
            column, below = run[i + 1] | np.int64(run[i + 2]) << 8, run[i + 3] | np.int64(run[i + 4]) << 8
            put(sink, time, column, height - 1 - below, (byte >> 1 if atis else byte) & 1 != 0)
        i += 5
    return i, time
