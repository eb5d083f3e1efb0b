"""Prophesee raw, EVT 2.1: 64-bit words, each up to 32 neighbouring events of one row, time and polarity.

Layout: Prophesee, "EVT 2.1 format". The time is 34 bits of microseconds and wraps every 4.77 h. Words come in
two orders: `endianness=little` in the header's format line means 64 bits low byte first, `legacy` that the
upper half of each stands before the lower one.
"""

from __future__ import annotations

import re
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

ABOUT = "Prophesee raw file, EVT 2.1"
WORDS = 1 << 15
"""Words decoded at a time."""
MOST = 32
"""Events that a word gives at most."""
SAMPLE = 1 << 14
"""Words from which their order is told."""
TIME_HIGH = 0x8
"""The kind of word that sends the upper bits of the time."""
STEP = 1 << 27
"""Half of its range: how far it goes from one such word to the next at most, where the clock runs."""
POSITION = np.zeros(37, np.int64)
"""2 ** n modulo 37 -> n: the powers of two up to 2 ** 31 all leave another rest."""
POSITION[[(1 << n) % 37 for n in range(32)]] = range(32)


def matches(path: Path, head: bytes) -> bool:
    """Whether the raw header names EVT 2.1."""
    return evt_version(header(head).fields) in ("2.1", "21")


def read(path: Path, hints: Hints) -> Source:
    """The header; RecordingError for an impossible size, UnsupportedError for an unknown order of words."""
    fields, start = header(head_of(path))
    zero_us = start_us(fields)
    order, notes = _order(path, fields, start)
    blocks = partial(_blocks, path, start, order == "legacy", zero_us)
    return Source(stated_size(fields), blocks, notes, turn_us=1 << 34, zero_us=zero_us, onto=blocks)


def _order(path: Path, fields: dict[str, str], start: int) -> tuple[str, list[str]]:
    """The order of the words that the header states, else the one in which the clock runs, with a note."""
    stated = re.search(r"endianness=(\w+)", fields.get("format", ""))
    if stated is not None:
        if stated.group(1) not in ("little", "legacy"):
            raise UnsupportedError(
                f"{path} has its words in the order '{stated.group(1)}': little and legacy are read"
            )
        return stated.group(1), []
    run = np.frombuffer(head_of(path, start + 8 * SAMPLE)[start:], "<u1")
    run = run[: len(run) // 8 * 8].view("<u8")
    order = "legacy" if _steps(_swapped(run)) > _steps(run) else "little"
    return order, [f"the header states no order of the words of EVT 2.1: in '{order}' order the clock runs"]


def _steps(run: NDArray[np.uint64]) -> int:
    """How many more of the words of time go on from the one before than go back, the first counted."""
    times = (run[run >> np.uint64(60) == TIME_HIGH] >> np.uint64(32)).astype(np.int64) & 0xFFFFFFF
    steps = np.diff(times) & 0xFFFFFFF
    return int(np.count_nonzero(steps <= STEP) - np.count_nonzero(steps > STEP)) + (len(times) > 0)


def _swapped(run: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The words with their halves exchanged."""
    return run >> np.uint64(32) | run << np.uint64(32)


def _blocks(
    path: Path, start: int, legacy: bool, shift_us: int, canvas: Canvas | None = None
) -> Iterator[Block]:
    state, clock_state = np.zeros(3, np.int64), clock()
    for stored in words(path, start, "<u8", WORDS):
        run = _swapped(stored) if legacy else stored
        sink = sink_of(canvas, MOST * len(run))
        state[2] = 0
        _decode(run, state, clock_state, shift_us, sink)
        yield sink.block(int(state[2]))


@compiled
def _decode(
    run: NDArray[np.uint64],
    state: NDArray[np.int64],
    clock_state: NDArray[np.int64],
    shift_us: int,
    sink: Sink,
) -> None:
    """Hand events on; `state` is the time above the 6 low bits, whether it is known, and events without."""
    high, timed, untimed = state[0], state[1] != 0, 0
    for unsigned in run:
        kind = unsigned >> np.uint64(60)
        word = np.int64(unsigned & np.uint64(0x0FFFFFFFFFFFFFFF))
        if kind <= 1:
            time = shift_us + (high << 6 | word >> 54 & 0x3F)
            bits = word & 0xFFFFFFFF
            while bits:
                lowest = bits & -bits
                bits ^= lowest
                if timed:
                    column = (word >> 43 & 0x7FF) + POSITION[lowest % 37]
                    put(sink, time, column, word >> 32 & 0x7FF, kind == 1)
                else:
                    untimed += 1
        elif kind == TIME_HIGH:
            value = word >> 32 & 0xFFFFFFF
            if not timed:
                clock_state[0], timed = value, True
            high = unwrap(clock_state, value, 0xFFFFFFF)
    state[0], state[1], state[2] = high, timed, untimed
