"""Prophesee raw, EVT 3.0: 16-bit words that change a state (row, time, base column) and give events.

Layout: Prophesee, "EVT 3.0 format". The time is 24 bits of microseconds and wraps every 16.78 s.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.sources.readers._canvas import Canvas, Sink, compiled, put, sink_of
from evplace.sources.readers._clock import clock, unwrap
from evplace.sources.readers._prophesee import evt_version, head_of, header, start_us, stated_size, words
from evplace.sources.readers._source import Block, Hints, Source

ABOUT = "Prophesee raw file, EVT 3.0"
WORDS = 1 << 16
"""Words decoded at a time."""
TIME_HIGH = 0x8
"""The kind of word that sends the upper half of the time; before the first, no event has one."""
MOST = 12
"""Events that a word gives at most."""


def matches(path: Path, head: bytes) -> bool:
    """Whether the raw header names EVT 3."""
    return evt_version(header(head).fields) in ("3", "3.0")


def read(path: Path, hints: Hints) -> Source:
    """The header; RecordingError where it states an impossible size."""
    fields, start = header(head_of(path))
    zero_us = start_us(fields)
    blocks = partial(_blocks, path, start, zero_us)
    return Source(stated_size(fields), blocks, turn_us=1 << 24, zero_us=zero_us, onto=blocks)


def _blocks(path: Path, start: int, shift_us: int, canvas: Canvas | None = None) -> Iterator[Block]:
    decoder = Decoder(shift_us)
    for part in words(path, start, "<u2", WORDS):
        yield decoder.decode(part, canvas)


class Decoder:
    """Remembers row, column and time from one run of words to the next."""

    def __init__(self, shift_us: int = 0) -> None:
        self.shift_us = shift_us
        """Added to all times."""
        self._state = np.zeros(4, np.int64)  # time (us), row, base column, polarity
        self._clock = clock()
        self._timed = False

    def decode(self, run: NDArray[np.uint16], canvas: Canvas | None = None) -> Block:
        """The events of `run` in the order of the words, as far as they are not marked on the canvas."""
        untimed = 0
        if not self._timed:
            high = np.flatnonzero(run >> 12 == TIME_HIGH)
            first = int(high[0]) if len(high) else len(run)
            untimed = len(self._decoded(run[:first], None).t_us)
            run = run[first:]
            if len(high):
                self._timed, self._clock[0] = True, int(run[0]) & 0xFFF
        return self._decoded(run, canvas)._replace(untimed=untimed)

    def _decoded(self, run: NDArray[np.uint16], canvas: Canvas | None) -> Block:
        sink = sink_of(canvas, MOST * len(run))
        _decode(run, self._state, self._clock, self.shift_us, sink)
        return sink.block()


@compiled
def _decode(
    run: NDArray[np.uint16],
    state: NDArray[np.int64],
    clock_state: NDArray[np.int64],
    shift_us: int,
    sink: Sink,
) -> None:
    """Hand on the events of all words."""
    time, row, base, polarity = state[0], state[1], state[2], state[3] != 0
    for word in run:
        kind, value = word >> 12, np.int64(word & 0xFFF)
        if kind == 0x2:  # one event
            put(sink, shift_us + time, value & 0x7FF, row, value & 0x800 != 0)
        elif kind == 0x6:
            time = (time & ~np.int64(0xFFF)) | value
        elif kind == 0x0:
            row = value & 0x7FF
        elif kind == 0x4 or kind == 0x5:  # up to 12, or 8, neighbouring columns
            width = 12 if kind == 0x4 else 8
            for bit in range(width):
                if value >> bit & 1:
                    put(sink, shift_us + time, base + bit, row, polarity)
            base += width
        elif kind == 0x3:
            base, polarity = value & 0x7FF, value & 0x800 != 0
        elif kind == TIME_HIGH:
            high = unwrap(clock_state, value, 0xFFF)
            if high != time >> 12:  # a repeated one leaves the low bits alone
                time = high << 12
    state[0], state[1], state[2], state[3] = time, row, base, polarity
