"""The inner loops of SeqSLAM: local contrast, trajectories, and sums along them, one query at a time.

Only the last few enhanced rows are kept, so memory is linear in the references. Loops run over whole
slices of a row, which compiles to vector code.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

TRAJECTORY, HYBRID, CONE = range(3)
"""Ways to search."""

FLAT = np.float32(1e-35)
"""Sums of squares up to this are rounding: dividing by them leaves single precision."""

Offsets = NDArray[np.int64]
"""(trajectories, d_s) reference offsets of each trajectory at each of its queries."""


def trajectories(ds: int, v_min: float, v_max: float, v_step: float, every: bool) -> Offsets:
    """Trajectories through the middle of `ds` queries, slowest first, as OpenSeqSLAM 2.0 makes them.

    The velocities are those that start on a whole row; of these the nearest to each of v_min, v_min +
    v_step, ... v_max are taken, or `every` one (hybrid and cone).
    """
    half = ds // 2
    steps = np.arange(ds) - half
    first, last = _half_away(-half * v_min), _half_away(-half * v_max)
    possible = -np.arange(first, last - 1, -1) / half
    if not every:
        wanted = v_min + v_step * np.arange(int(np.floor((v_max - v_min) / v_step + 1e-9)) + 1)
        possible = possible[np.unique(np.abs(possible[None] - wanted[:, None]).argmin(1))]
    offsets: Offsets = _half_away(possible[:, None] * steps)
    return offsets


def trajectories_2013(ds: int, v_min: float, v_max: float) -> Offsets:
    """Trajectories of ds + 1 queries from their first row on, as OpenSeqSLAM (2013) makes them."""
    moves = v_min * ds + np.arange(int(np.floor((v_max - v_min) * ds + 1e-9)) + 1)
    return np.floor(moves[:, None] / ds * np.arange(ds + 1)).astype(np.int64)


def _half_away(values: NDArray[np.float64] | float) -> Any:
    """Rounded as MATLAB does, halves away from zero."""
    return (np.sign(values) * np.floor(np.abs(values) + 0.5)).astype(np.int64)


@njit(cache=True)
def advance(
    rows: NDArray[Any],
    band: NDArray[np.float32],
    nearest: NDArray[np.int64],
    work: NDArray[np.float32],
    state: NDArray[np.float64],
    offsets: Offsets,
    search: int,
    half: int,
    window: int,
    scores: NDArray[np.float32],
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Take (queries, items) rows -> best item or -1, its score, the best outside `window`, least contrast.

    One entry for each query whose whole sequence is now there. `band` (d_s, items) and `nearest` (d_s,) are
    rings of the last enhanced rows and their nearest items; `work` (2, items); `state` (2,) is queries taken
    and the least contrast so far; `scores` (queries or 0, items) takes the sequence scores, if it has rows.
    """
    span = band.shape[0]
    answers = max(0, rows.shape[0] - max(0, span - 1 - np.int64(state[0])))
    item, best = np.empty(answers, np.int64), np.empty(answers)
    second, least = np.empty(answers), np.empty(answers)
    line = np.empty(rows.shape[1], np.float32)
    a = 0
    for i in range(rows.shape[0]):
        query = np.int64(state[0])
        slot = query % span
        enhance(rows[i], half, band[slot], work)
        nearest[slot] = np.argmax(rows[i])
        state[0] += 1
        state[1] = min(state[1], band[slot].min())
        if query + 1 < span:
            continue
        _sequence_scores(band, nearest, slot + 1, offsets, search, line, work[0])
        item[a], best[a], second[a] = two_best(line, window)
        least[a] = state[1]
        if scores.shape[0] > 0:
            scores[a] = line
        a += 1
    return item, best, second, least


@njit(cache=True)
def enhance(row: NDArray[Any], half: int, out: NDArray[np.float32], work: NDArray[np.float32]) -> None:
    """Each distance as its deviation from the mean of its neighbourhood, in standard deviations.

    `row` holds scores, that is distances negated; `out` (items,). The neighbourhood reaches `half` to either
    side, less at the ends. Where it is flat the contrast is 0. All is counted from the distance itself,
    which keeps single precision exact enough: it lies within three deviations of the mean.
    """
    items = row.shape[0]
    total, squares = work[0], work[1]
    total[:] = 0
    squares[:] = 0
    for reach in range(1, min(half, items - 1) + 1):
        _add_differences(row[reach:], row[:-reach], total[:-reach], squares[:-reach])
        _add_differences(row[:-reach], row[reach:], total[reach:], squares[reach:])
    for i in range(items):
        count = np.float32(min(items - 1, i + half) - max(0, i - half) + 1)
        mean = total[i] / count
        spread = squares[i] - total[i] * mean
        out[i] = -mean * np.sqrt((count - np.float32(1)) / spread) if spread > FLAT else np.float32(0)


@njit(cache=True)
def _add_differences(
    other: NDArray[Any], here: NDArray[Any], total: NDArray[np.float32], squares: NDArray[np.float32]
) -> None:
    for i in range(here.shape[0]):
        difference = np.float32(here[i] - other[i])
        total[i] += difference
        squares[i] += difference * difference


@njit(cache=True)
def _sequence_scores(
    band: NDArray[np.float32],
    nearest: NDArray[np.int64],
    first: int,
    offsets: Offsets,
    search: int,
    scores: NDArray[np.float32],
    work: NDArray[np.float32],
) -> None:
    """Fill `scores` (items,) for the sequence whose first row is `band[first]`; infinity where none fits."""
    items, span = band.shape[1], band.shape[0]
    scores[:] = np.inf
    for t in range(offsets.shape[0]):
        low, high = max(0, -offsets[t].min()), min(items, items - offsets[t].max())
        if low >= high:
            continue
        if search == TRAJECTORY:
            _sum_along(band, first, offsets[t], low, high, scores, work)
        elif search == HYBRID:
            _sum_near(band, nearest, first, offsets[t], low, high, scores)
        else:
            scores[low:high] = 1
    if search == CONE:
        _count_in_cone(nearest, first, offsets, scores, span)


@njit(cache=True)
def _sum_along(
    band: NDArray[np.float32],
    first: int,
    offsets: NDArray[np.int64],
    low: int,
    high: int,
    scores: NDArray[np.float32],
    work: NDArray[np.float32],
) -> None:
    """Lower `scores[low:high]` to the sums along one trajectory."""
    span = band.shape[0]
    total = work[: high - low]
    total[:] = 0
    for k in range(span):
        row = band[(first + k) % span, low + offsets[k] : high + offsets[k]]
        for i in range(total.shape[0]):
            total[i] += row[i]
    target = scores[low:high]
    for i in range(total.shape[0]):
        target[i] = min(target[i], total[i])


@njit(cache=True)
def _sum_near(
    band: NDArray[np.float32],
    nearest: NDArray[np.int64],
    first: int,
    offsets: NDArray[np.int64],
    low: int,
    high: int,
    scores: NDArray[np.float32],
) -> None:
    """The same, only where the trajectory touches a nearest item, be it that of another query."""
    span = band.shape[0]
    for item in nearest:
        for k in range(span):
            centre = item - offsets[k]
            if centre < low or centre >= high:
                continue
            total = np.float32(0)
            for j in range(span):
                total += band[(first + j) % span, centre + offsets[j]]
            scores[centre] = min(scores[centre], total)


@njit(cache=True)
def _count_in_cone(
    nearest: NDArray[np.int64], first: int, offsets: Offsets, scores: NDArray[np.float32], span: int
) -> None:
    """Lower the scores, 1 where a trajectory fits, by 1/d_s for each nearest item in the cone."""
    items = scores.shape[0]
    hits = np.zeros(items, np.int64)
    counted = np.full(items, -1, np.int64)
    for k in range(span):
        for t in range(offsets.shape[0]):
            centre = nearest[(first + k) % span] - offsets[t, k]
            low, high = max(0, -offsets[t].min()), min(items, items - offsets[t].max())
            if low <= centre < high and counted[centre] != k:
                counted[centre] = k
                hits[centre] += 1
    for i in range(items):
        scores[i] -= np.float32(hits[i] / span)


@njit(cache=True)
def two_best(scores: NDArray[np.float32], window: int) -> tuple[int, float, float]:
    """The first least score, and the least over `window` items away; item -1 where all are infinite."""
    best = int(np.argmin(scores))
    if scores[best] == np.inf:
        return -1, np.nan, np.nan
    second = np.float32(np.inf)
    for i in range(max(0, best - window)):
        second = min(second, scores[i])
    for i in range(best + window + 1, scores.shape[0]):
        second = min(second, scores[i])
    return best, float(scores[best]), float(second)
