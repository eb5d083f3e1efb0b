"""Counters that wrap: exact over any number of wraps, and one wrong value shifts nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from made import MAKERS, evt3_words, good_part, some_events

from evplace.core.events import Events
from evplace.sources.readers import open_recording
from evplace.sources.readers._clock import clock, unwrap, unwrap_32
from evplace.sources.writers import write_recording

MASK = 0xFFF


def values(counters: np.ndarray, mask: int = MASK) -> np.ndarray:
    state = clock(int(counters[0]))
    return np.array([unwrap(state, int(counter), mask) for counter in counters])


@pytest.mark.parametrize("step", [1, 7, 100, 255, 256, 257, 1000, 1500, 4000])
def test_many_wraps_are_exact(step: int) -> None:
    true = np.arange(5, 200_000, step)
    steps_back = step > MASK - (MASK >> 4)  # such a leap forward cannot be told from a small step back
    assert np.array_equal(values(true & MASK), true) or steps_back


def test_small_steps_back_stay_steps_back() -> None:
    true = np.array([4090, 4095, 4093, 4100, 4096, 4095, 4110])
    assert np.array_equal(values(true & MASK), true)


@pytest.mark.parametrize("bit", range(12))
def test_a_flipped_bit_shifts_nothing_after_it(bit: int) -> None:
    true = np.arange(100, 20_000)
    counters = true & MASK
    counters[[500, 7000]] ^= 1 << bit
    found = values(counters)
    right = np.delete(np.arange(len(true)), [500, 7000])
    assert np.array_equal(found[right], true[right])


def test_32_bits_wrap_exactly() -> None:
    true = np.arange(0, 40 * (1 << 32), (1 << 32) // 7, dtype=np.int64)
    assert np.array_equal(unwrap_32(clock(0), (true & 0xFFFFFFFF).astype(np.uint32)), true)


@pytest.mark.parametrize("form", ["evt3", "dat", "aedat2", "evt2", "evt21"])
def test_files_longer_than_their_clock(form: str, tmp_path: Path) -> None:
    """Five ranges of the clock, with events all along."""
    bits = {"evt3": 24, "dat": 32, "aedat2": 32, "evt2": 34, "evt21": 34}[form]
    events = some_events(4000, 5 << bits)
    t_us = events.t_us & ((1 << bits) - 1)  # which falls back at each turn: no packet of its own
    wrapped = Events(t_us, events.x, events.y, events.p, events.size)
    if form == "evt3":
        path = tmp_path / "long.raw"
        path.write_bytes(b"% evt 3.0\n% geometry 240x180\n% end\n" + evt3_words(events).tobytes())
    elif form == "aedat2":
        path = MAKERS[form](tmp_path, wrapped)
    elif form == "dat":
        path = tmp_path / "long.dat"
        data = events.p.astype("<u4") << 28 | events.y.astype("<u4") << 14 | events.x
        words = np.stack([wrapped.t_us.astype("<u4"), data], 1).tobytes()
        path.write_bytes(b"% Version 2\n% Width 240\n% Height 180\n\x0c\x08" + words)
    elif form == "evt21":
        path = MAKERS[form](tmp_path, wrapped)
    else:
        path = tmp_path / "long.raw"
        high = 8 << 28 | wrapped.t_us >> 6
        word = events.p.astype(np.int64) << 28 | (events.t_us & 63) << 22 | events.x.astype(np.int64) << 11
        words = np.stack([high, word | events.y], 1).astype("<u4").tobytes()
        path.write_bytes(b"% evt 2.0\n% geometry 240x180\n% end\n" + words)
    back = good_part(open_recording(path))
    assert np.array_equal(back.t_us - back.t_us[0], events.t_us - events.t_us[0])


@pytest.mark.parametrize("turns", [0, 1, 3])
def test_turns_of_the_clock_are_counted(tmp_path: Path, turns: int) -> None:
    t_us = np.arange(0, turns * (1 << 24) + 9_000_000, 500_000) + 4_000_000
    zeros = np.zeros(len(t_us), int)
    write_recording(tmp_path / "a.raw", [Events.of(t_us, zeros, zeros, zeros, (64, 48))], (64, 48))
    recording = open_recording(tmp_path / "a.raw")
    assert recording.wraps == 0
    assert sum(len(packet) for packet in recording.packets()) == len(t_us)
    assert recording.wraps == turns
