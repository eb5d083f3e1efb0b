"""The loops over a belief around its answer: how far it spreads, and what else is likely.

Distances are compared by their squares. `held` (references,) and what else a loop is given room in are worked
with, and hold nothing afterwards.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BINS = 256
"""Room for `farthest` to count in."""


@njit(cache=True, nogil=True, error_model="numpy")
def farthest(
    belief: Floats, xy: Floats, item: int, least: float, share: float, held: Ints, away: Floats, bins: Floats
) -> int:
    """The reference up to which, going by distance from an item, lies a share of all belief above `least`.

    -1 where none is above it. The belief is counted by distance, then that at the wanted distance again more
    finely, and so on: far less work than putting all references in order.
    """
    many, wanted, below = 0, 0.0, 0.0
    for r in range(len(belief)):
        if belief[r] > least:
            held[many], away[many] = r, _squared(xy, r, item)
            wanted += share * belief[r]
            many += 1
    while many > 1:
        low, high = _ends(away[:many])
        if low == high:
            break
        bins[:] = 0.0
        for k in range(many):
            bins[_bin(away[k], low, high, len(bins))] += belief[held[k]]
        at = 0
        while at < len(bins) - 1 and below + bins[at] < wanted:
            below += bins[at]
            at += 1
        kept = 0
        for k in range(many):
            if _bin(away[k], low, high, len(bins)) == at:
                held[kept], away[kept] = held[k], away[k]
                kept += 1
        many = kept
    return held[0] if many else -1


@njit(cache=True, nogil=True)
def runners_up(
    belief: Floats, xy: Floats, item: int, least: float, reach: Floats, held: Ints, found: Ints, mass: Floats
) -> int:
    """How many of `found` are set to the best references at other places than an item, best first.

    `reach` holds metres: of the belief that counts together, and where another place begins. `mass` gets the
    belief around the first one; below `least` there is none.
    """
    many, here, mass[0] = 0, item, 0.0
    for r in range(len(belief)):
        if belief[r] > least:
            held[many] = r
            many += 1
    for number in range(len(found) + 1):
        best, most, around, kept = -1, 0.0, 0.0, 0
        for k in range(many):
            r = held[k]
            away = _squared(xy, r, here)
            if away <= reach[0] * reach[0]:
                around += belief[r]
            if away > reach[1] * reach[1]:
                held[kept] = r
                kept += 1
                if belief[r] > most:
                    best, most = r, belief[r]
        many = kept
        if number == 1:
            mass[0] = around
        if best < 0 or number == len(found):
            return number
        found[number] = here = best
    return len(found)


@njit(cache=True, nogil=True)
def _squared(xy: Floats, one: int, other: int) -> float:
    """Square of the metres between two references."""
    east, north = xy[one, 0] - xy[other, 0], xy[one, 1] - xy[other, 1]
    return float(east * east + north * north)


@njit(cache=True, nogil=True)
def _ends(values: Floats) -> tuple[float, float]:
    """The least and the most."""
    low = high = values[0]
    for value in values:
        low, high = min(low, value), max(high, value)
    return low, high


@njit(cache=True, nogil=True, error_model="numpy")
def _bin(value: float, low: float, high: float, many: int) -> int:
    """The last bin is that of `high` alone, so that neither it nor the first is ever empty."""
    return int((value - low) / (high - low) * (many - 1))
