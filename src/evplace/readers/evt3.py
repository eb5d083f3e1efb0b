"""Prophesee raw, EVT 3.0: 16-bit words that change a state (row, time, base column) and give events.

Layout: Prophesee, "EVT 3.0 format". The time is 24 bits of microseconds and wraps every 16.78 s.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from evplace.readers._clock import clock, unwrap
from evplace.readers._prophesee import evt_version, head_of, header, start_us, stated_size, words
from evplace.readers._source import Block, Hints, Source, joined

ABOUT = "Prophesee raw file, EVT 3.0"
WORDS = 1 << 18
"""Words decoded at a time."""
MOST = 12
"""Events that a word gives at most."""


def matches(path: Path, head: bytes) -> bool:
    """Whether the raw header names EVT 3."""
    return evt_version(header(head).fields).startswith("3")


def read(path: Path, hints: Hints) -> Source:
    """The header; RecordingError where it states an impossible size."""
    fields, start = header(head_of(path))
    return Source(stated_size(fields), partial(_blocks, path, start, start_us(fields)))


def _blocks(path: Path, start: int, shift_us: int) -> Iterator[Block]:
    decoder = Decoder(shift_us)
    for part in words(path, start, "<u2", WORDS):
        yield from decoder.parts(part)


class Decoder:
    """Remembers row, column and time from one run of words to the next."""

    def __init__(self, shift_us: int = 0) -> None:
        self._shift_us = shift_us
        # time (us), row, base column, polarity, time high seen, unwrapped time high, untimed events
        self._state = np.zeros(6, np.int64)
        self._clock = clock()

    def decode(self, run: NDArray[np.uint16]) -> Block:
        """The events of `run`, in the order of the words."""
        return joined(list(self.parts(run)))

    def parts(self, run: NDArray[np.uint16]) -> Iterator[Block]:
        """The events of `run` in one block, or in several where a word gives more than one event."""
        used = 0
        while True:
            room = len(run) - used + MOST
            t_us, x, y = np.empty(room, np.int64), np.empty(room, np.uint16), np.empty(room, np.uint16)
            p = np.empty(room, np.bool_)
            self._state[5] = 0
            count, more = _decode(run[used:], self._state, self._clock, self._shift_us, t_us, x, y, p)
            yield Block(t_us[:count], x[:count], y[:count], p[:count], int(self._state[5]))
            used += more
            if used == len(run):
                return


@njit(cache=True)
def _decode(
    run: NDArray[np.uint16],
    state: NDArray[np.int64],
    clock_state: NDArray[np.int64],
    shift_us: int,
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
) -> tuple[int, int]:
    """Fill the arrays; return the events and the words used, all unless the arrays are full before."""
    time, row, base, polarity, timed = state[0], state[1], state[2], state[3] != 0, state[4] != 0
    count, untimed, i, last = 0, 0, 0, len(t_us) - MOST
    while i < len(run) and count <= last:
        word = run[i]
        i += 1
        kind, value = word >> 12, np.int64(word & 0xFFF)
        if kind == 0x2:  # one event
            if timed:
                t_us[count], x[count], y[count] = shift_us + time, value & 0x7FF, row
                p[count] = value & 0x800 != 0
                count += 1
            else:
                untimed += 1
        elif kind == 0x6:
            time = (time & ~np.int64(0xFFF)) | value
        elif kind == 0x0:
            row = value & 0x7FF
        elif kind == 0x4 or kind == 0x5:  # up to 12, or 8, neighbouring columns
            width = 12 if kind == 0x4 else 8
            for bit in range(width):
                if value >> bit & 1:
                    if timed:
                        t_us[count], x[count], y[count], p[count] = shift_us + time, base + bit, row, polarity
                        count += 1
                    else:
                        untimed += 1
            base += width
        elif kind == 0x3:
            base, polarity = value & 0x7FF, value & 0x800 != 0
        elif kind == 0x8:
            high = unwrap(clock_state, value, 0xFFF) if timed else value
            if not timed:
                clock_state[0] = value
                timed = True
            if high != time >> 12:  # a repeated one leaves the low bits alone
                time = high << 12
    state[0], state[1], state[2], state[3], state[4], state[5] = time, row, base, polarity, timed, untimed
    return count, i
