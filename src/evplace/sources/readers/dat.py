"""Prophesee DAT, versions 1 and 2: 8 bytes an event, of which 4 are the time in microseconds.

Layout: Prophesee, "DAT file format". The time wraps every 71.6 min.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import UnsupportedError
from evplace.sources.readers._canvas import Canvas, Sink, compiled, put, sink_of
from evplace.sources.readers._clock import clock, unwrap
from evplace.sources.readers._prophesee import evt_version, head_of, header, start_us, stated_size, words
from evplace.sources.readers._source import Block, Hints, Source

ABOUT = "Prophesee DAT file"
CHANGE_EVENTS = (0x00, 0x0C)
"""Event types that hold a column, a row and a polarity."""
KINDS = (*CHANGE_EVENTS, 0x0E, 0x28)
"""All event types: the last two are triggers."""
RECORD = np.dtype([("t", "<u4"), ("data", "<u4")])
EVENTS = 1 << 16
"""Events decoded at a time; with many more the processor's cache would not hold the steps in between."""


def matches(path: Path, head: bytes) -> bool:
    """Whether a header that names no raw encoding is followed by a DAT event type and a size of 8 bytes."""
    fields, start = header(head)
    after = head[start : start + 2]
    return start > 0 and not evt_version(fields) and len(after) == 2 and after[0] in KINDS and after[1] == 8


def read(path: Path, hints: Hints) -> Source:
    """The header; UnsupportedError where the file holds no change events or is of an unknown version."""
    head = head_of(path)
    fields, start = header(head)
    if not head[start : start + 1] or head[start] not in CHANGE_EVENTS:
        raise UnsupportedError(f"{path} is a DAT file without change events: it may hold triggers only")
    version = fields.get("version", "")
    if version not in ("", "1", "2"):
        raise UnsupportedError(f"{path} is a DAT file of version '{version}': known are 1 and 2")
    notes = [] if version else ["the DAT header states no version: 2 is taken"]
    zero_us = start_us(fields)
    blocks = partial(_blocks, path, start + 2, version == "1", zero_us)
    return Source(stated_size(fields), blocks, notes, 1 << 32, zero_us, onto=blocks)


def _blocks(
    path: Path, start: int, first_version: bool, shift_us: int, canvas: Canvas | None = None
) -> Iterator[Block]:
    state, widths = None, (9, 8, 1) if first_version else (14, 14, 4)
    for run in words(path, start, RECORD, EVENTS):
        if state is None:
            state = clock(int(run["t"][0]))
        sink = sink_of(canvas, len(run))
        _decode(run.view("<u4"), state, shift_us, *widths, sink)
        yield sink.block()


@compiled
def _decode(
    run: NDArray[np.uint32],
    clock_state: NDArray[np.int64],
    shift_us: int,
    column_bits: int,
    row_bits: int,
    sign_bits: int,
    sink: Sink,
) -> None:
    """Hand on the events: a word of time, and one of column, row and polarity from the lowest bit on."""
    for i in range(0, len(run), 2):
        t_us, data = unwrap(clock_state, np.int64(run[i]), 0xFFFFFFFF), np.int64(run[i + 1])
        column, above = data & ((1 << column_bits) - 1), data >> column_bits
        sign = above >> row_bits & ((1 << sign_bits) - 1)
        put(sink, shift_us + t_us, column, above & ((1 << row_bits) - 1), sign != 0)
