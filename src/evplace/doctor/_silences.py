"""Stretches in which the whole sensor is silent although it was busy just before and after."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SHORTEST_US = 20_000
"""A shorter silence is none: a lamp alone, without any other event, leaves 10 ms between its flashes."""
MISSED = 50
"""Events that should have come, by the rate before and after, for a silence to be a gap."""

Times = NDArray[np.int64]


class Silences:
    """Remembers silences; which of them are gaps is told at the end, by the rates around them."""

    def __init__(self) -> None:
        self._last_us: int | None = None
        self._starts: list[Times] = []
        self._ends: list[Times] = []

    def push(self, t_us: Times) -> None:
        """Note the silences before and between the next events (n,), at least one."""
        if self._last_us is not None and t_us[0] - self._last_us >= SHORTEST_US:
            self._starts.append(np.array([self._last_us]))
            self._ends.append(t_us[:1].copy())
        after = np.flatnonzero(np.diff(t_us) >= SHORTEST_US)
        if len(after):
            self._starts.append(t_us[after])
            self._ends.append(t_us[after + 1])
        self._last_us = int(t_us[-1])

    def gaps(self, start_us: int, bin_us: int, counts: Times) -> tuple[Times, Times]:
        """(g,) starts and ends of the gaps; `counts` (n,) are the events of each bin from `start_us` on.

        At the lower rate of before and after, MISSED events should have come in a gap.
        """
        starts, ends = (np.concatenate([np.zeros(0, np.int64), *part]) for part in (self._starts, self._ends))
        if not len(starts):
            return starts, ends
        first = np.minimum((starts - start_us) // bin_us, len(counts) - 1)
        last = np.minimum((ends - start_us) // bin_us, len(counts) - 1)
        before = np.maximum(counts[np.maximum(first - 1, 0)], counts[first])
        after = np.maximum(counts[last], counts[np.minimum(last + 1, len(counts) - 1)])
        sudden = np.minimum(before, after) * ((ends - starts) / bin_us) >= MISSED
        return starts[sudden], ends[sudden]
