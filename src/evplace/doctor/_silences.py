"""Stretches in which the whole sensor is silent although it was busy just before and after."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHORTEST_US = 20_000
"""A shorter silence is none: a lamp alone, without any other event, leaves 10 ms between its flashes."""
MISSED = 50
"""Events that should have come, by the rate before and after, for a silence to be a gap."""
EDGE_US = 40_000
"""The rate at a silence's edges is that of so long before and after it."""
SUDDEN = 0.5
"""Share of the usual rate that both edges of a gap have: where a car comes to stand, the events die away."""
LEAP_US = 3_600_000_000
"""A longer silence is no gap, but a leap of the clock."""
TOLD = 64
"""Where every so many-th event follows the one before it sooner, so do all."""

Times = NDArray[np.int64]


class Silences:
    """Remembers silences; which of them are gaps is decided at the end, by the rates around them."""

    def __init__(self) -> None:
        self._starts: list[int] = []
        self._ends: list[int] = []
        self._before: list[int] = []
        self._after: list[int] = []
        self._recent = np.zeros(0, np.int64)
        self._open: list[int] = []

    def push(self, t_us: Times) -> None:
        """Note the silences before and between the next events (n,), at least one."""
        for at in self._open:
            self._after[at] += int(np.searchsorted(t_us, self._ends[at] + EDGE_US, "right"))
        known = len(self._starts)
        times = np.concatenate([self._recent, t_us])
        first = max(len(self._recent) - 1, 0)
        last = first + _silent(times[first:])
        starts, ends = times[last], times[last + 1]
        self._starts += starts.tolist()
        self._ends += ends.tolist()
        self._before += (last + 1 - np.searchsorted(times, starts - EDGE_US)).tolist()
        self._after += (np.searchsorted(times, ends + EDGE_US, "right") - last - 1).tolist()
        asked = [*self._open, *range(known, len(self._starts))]
        self._open = [at for at in asked if self._ends[at] + EDGE_US >= t_us[-1]]
        self._recent = times[np.searchsorted(times, times[-1] - EDGE_US) :]

    def gaps(self, start_us: int, bin_us: int, counts: Times) -> tuple[Times, Times]:
        """(g,) starts and ends of the gaps; `counts` (n,) are the events of each bin from `start_us` on.

        At the lower rate of before and after, MISSED events should have come in a gap; and right before and
        after it, events come at SUDDEN of the median rate or more. A leap of the clock is always one.
        """
        starts, ends = np.array(self._starts, np.int64), np.array(self._ends, np.int64)
        if not len(starts):
            return starts, ends
        first = np.minimum((starts - start_us) // bin_us, len(counts) - 1)
        last = np.minimum((ends - start_us) // bin_us, len(counts) - 1)
        before = np.maximum(counts[np.maximum(first - 1, 0)], counts[first])
        after = np.maximum(counts[last], counts[np.minimum(last + 1, len(counts) - 1)])
        missed = np.minimum(before, after) * ((ends - starts) / bin_us) >= MISSED
        usual = float(np.median(counts[counts > 0])) * EDGE_US / bin_us
        sudden = np.minimum(self._before, self._after) >= SUDDEN * usual
        gaps = (missed & sudden) | (ends - starts > LEAP_US)
        return starts[gaps], ends[gaps]


def _silent(times: Times) -> Times:
    """The numbers of times (n,) after which nothing comes for SHORTEST_US; mostly none, which a few tell."""
    if len(times) and np.diff(times[::TOLD], append=times[-1:]).max() < SHORTEST_US:
        return np.zeros(0, np.int64)
    return np.flatnonzero(np.diff(times) >= SHORTEST_US)
