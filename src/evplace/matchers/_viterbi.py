"""The best path through a whole matrix, one item a query: dynamic programming with bounded steps."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.matchers._kept import Kept

JUMP = np.iinfo(np.int16).min
"""A step that stands for a jump from the best item of the query before."""

LONGEST_STEP = int(np.iinfo(np.int16).max)
"""Steps are kept as int16."""


class Viterbi:
    """Maximises the sum of gains along a path; remembers one step, 2 bytes, for each query and item.

    From one query to the next the item grows by `low`, low + 1, ..., which adds `gains` (one each), or jumps
    anywhere, which adds `jump` (-inf: never). Among equal parents the lowest item wins, and a step over the
    jump.
    """

    def __init__(self, low: int, gains: NDArray[np.float64], jump: float = -np.inf) -> None:
        self._rule = (low, gains, jump)
        self._sums: NDArray[np.float64] = np.empty(0)
        self._steps, self._tops = Kept(), Kept()

    def extend(self, gains: NDArray[np.float64]) -> NDArray[np.int64]:
        """Take the next queries' gains (queries, items); for each the end of the best path so far."""
        if not len(self._sums):
            self._sums = np.full(gains.shape[1], np.nan)
        steps, tops = np.empty(gains.shape, np.int16), np.empty(len(gains), np.int64)
        ends: NDArray[np.int64] = _forward(gains, self._sums, steps, tops, *self._rule)
        self._steps.append(steps)
        self._tops.append(tops)
        return ends

    def trace(self) -> NDArray[np.int64]:
        """The best path's item for each query that is kept, the lowest end among equals."""
        items: list[int] = []
        at = int(self._sums.argmax()) if len(self._steps) else 0
        for steps, top in zip(self._steps.backwards(), self._tops.backwards(), strict=True):
            items.append(at)
            at = int(top if steps[at] == JUMP else at - steps[at])
        return np.array(items[::-1], np.int64)

    def forget_but(self, many: int) -> None:
        """Forget all but the last `many` queries: `trace` goes back no further."""
        self._steps.forget_but(many)
        self._tops.forget_but(many)


def pieces(table: NDArray[Any], rows: int = 256) -> Iterator[NDArray[Any]]:
    """The rows of `table` in pieces small enough to make something larger of them."""
    return (table[start : start + rows] for start in range(0, len(table), rows))


@njit(cache=True)
def _forward(
    gains: NDArray[np.float64],
    sums: NDArray[np.float64],
    steps: NDArray[np.int16],
    tops: NDArray[np.int64],
    low: int,
    moves: NDArray[np.float64],
    jump: float,
) -> NDArray[np.int64]:
    """Fill `steps`, and `tops` with the best item before each query; `sums` (items,) is NaN at first."""
    queries, items = gains.shape
    ends = np.empty(queries, np.int64)
    before = np.empty(items)
    chosen = np.empty(items, np.int16)
    for i in range(queries):
        if np.isnan(sums[0]):
            sums[:] = gains[i]
            steps[i] = 0
            tops[i] = 0
        else:
            before[:] = sums
            tops[i] = np.argmax(before)
            _best_parents(before, sums, chosen, low, moves)
            leap = before[tops[i]] + jump
            for r in range(items):
                steps[i, r] = JUMP if leap > sums[r] else chosen[r]
                sums[r] = max(leap, sums[r]) + gains[i, r]
        ends[i] = np.argmax(sums)
    return ends


@njit(cache=True)
def _best_parents(
    before: NDArray[np.float64],
    best: NDArray[np.float64],
    chosen: NDArray[np.int16],
    low: int,
    moves: NDArray[np.float64],
) -> None:
    """For each item the largest sum of the items `low`, low + 1, ... steps before it, and that step."""
    items = before.shape[0]
    high = low + moves.shape[0] - 1
    best[:] = -np.inf
    for r in range(items):
        chosen[r] = min(high, r)
    for step in range(high, low - 1, -1):
        reach = abs(step)
        if reach >= items:
            continue
        child, parent = (reach, 0) if step > 0 else (0, reach)
        _raise(
            best[child : items - parent],
            before[parent : items - child],
            chosen[child : items - parent],
            np.int16(step),
            moves[step - low],
        )


@njit(cache=True)
def _raise(
    best: NDArray[np.float64],
    other: NDArray[np.float64],
    chosen: NDArray[np.int16],
    step: np.int16,
    move: float,
) -> None:
    for r in range(best.shape[0]):
        value = other[r] + move
        chosen[r] = step if value > best[r] else chosen[r]
        best[r] = max(best[r], value)
