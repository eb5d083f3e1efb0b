"""Prophesee raw, EVT 2.0: 32-bit words, one an event, with 6 bits of time below 28 bits sent now and then.

Layout: Prophesee, "EVT 2.0 format". The time is 34 bits of microseconds and wraps every 4.77 h.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.sources.readers._canvas import Canvas, Sink, compiled, put, sink_of
from evplace.sources.readers._clock import clock, unwrap
from evplace.sources.readers._prophesee import evt_version, head_of, header, start_us, stated_size, words
from evplace.sources.readers._source import Block, Hints, Source

ABOUT = "Prophesee raw file, EVT 2.0"
WORDS = 1 << 16
"""Words decoded at a time."""


def matches(path: Path, head: bytes) -> bool:
    """Whether the raw header names EVT 2.0 (2.1 is another format)."""
    return evt_version(header(head).fields) in ("2", "2.0")


def read(path: Path, hints: Hints) -> Source:
    """The header; RecordingError where it states an impossible size."""
    fields, start = header(head_of(path))
    zero_us = start_us(fields)
    blocks = partial(_blocks, path, start, zero_us)
    return Source(stated_size(fields), blocks, turn_us=1 << 34, zero_us=zero_us, onto=blocks)


def _blocks(path: Path, start: int, shift_us: int, canvas: Canvas | None = None) -> Iterator[Block]:
    decode = decoder(shift_us, canvas)
    for run in words(path, start, "<u4", WORDS):
        yield decode(run)


def decoder(shift_us: int = 0, canvas: Canvas | None = None) -> Callable[[NDArray[np.uint32]], Block]:
    """A run of words -> its events, as far as they are not marked on the canvas; it remembers the time."""
    state, clock_state = np.zeros(3, np.int64), clock()

    def decode(run: NDArray[np.uint32]) -> Block:
        sink = sink_of(canvas, len(run))
        state[2] = 0
        _decode(run, state, clock_state, shift_us, sink)
        return sink.block(int(state[2]))

    return decode


@compiled
def _decode(
    run: NDArray[np.uint32],
    state: NDArray[np.int64],
    clock_state: NDArray[np.int64],
    shift_us: int,
    sink: Sink,
) -> None:
    """Hand events on; `state` is the time above the 6 low bits, whether it is known, and events without."""
    high, timed, untimed = state[0], state[1] != 0, 0
    for word in run:
        kind = word >> 28
        if kind <= 1:
            if timed:
                time = shift_us + (high << 6 | np.int64(word >> 22 & 0x3F))
                put(sink, time, word >> 11 & 0x7FF, word & 0x7FF, kind == 1)
            else:
                untimed += 1
        elif kind == 0x8:
            value = np.int64(word & 0xFFFFFFF)
            if not timed:
                clock_state[0], timed = value, True
            high = unwrap(clock_state, value, 0xFFFFFFF)
    state[0], state[1], state[2] = high, timed, untimed
