"""The loops of a Bayes filter over the references of a route, each with a class of speed.

A belief (references, speeds) sums to 1. Between two images each class moves on by its way; a class may change
to the next slower or faster one; a share passes to references that lie beside (a crossing, a loop, another
drive); and a small share may be anywhere.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.matchers._surroundings import GRID, STEP

Belief = NDArray[np.float64]
"""(references, speeds)."""
Floats = NDArray[np.float64]


ONE = np.uint64(1)
"""Unsigned, so that an index needs no look whether it counts from the end: half the time of `move`."""
FIRST, PER_STEP, HALF, NONE, LAST = (
    np.float32(number) for number in (GRID[0], 1 / STEP, 0.5, 0, len(GRID) - 1)
)
"""Where a z-score stands in GRID."""


@njit(cache=True, nogil=True)
def mix_speeds(belief: Belief, change: float, out: Belief) -> None:
    """Part of each class goes to its neighbours; its own transpose."""
    last = belief.shape[1] - 1
    keep, half = 1 - change, 0.5 * change
    for r in range(belief.shape[0]):
        b, to = belief[r], out[r]
        to[0] = keep * b[0] + half * (b[0] + b[1])
        for v in range(1, last):
            to[v] = keep * b[v] + half * (b[v - 1] + b[v + 1])
        to[last] = keep * b[last] + half * (b[last - 1] + b[last])


@njit(cache=True, nogil=True, error_model="numpy")
def move(belief: Belief, way: Floats, steps: Floats, out: Belief, at: NDArray[np.uint64]) -> None:
    """Each class v moves on by steps[v] along the way (references,); what passes the end is lost.

    Between two references it is shared by nearness. All classes go along the way together: one pass, `at`
    (speeds,) being where each has come to.
    """
    last = np.uint64(len(way) - 1)
    at[:] = 0
    out[:] = 0.0
    for r in range(len(way)):
        for v in range(len(steps)):
            goal, here = way[r] + steps[v], at[v]
            while here < last and way[here + ONE] <= goal:
                here += ONE
            at[v] = here
            if here == last:
                if goal <= way[here]:
                    out[here, v] += belief[r, v]
                continue
            share = (goal - way[here]) / (way[here + ONE] - way[here])
            out[here, v] += (1 - share) * belief[r, v]
            out[here + ONE, v] += share * belief[r, v]


@njit(cache=True, nogil=True)
def move_back(later: Belief, way: Floats, steps: Floats, lost: float, out: Belief) -> None:
    """The transpose of `move`; `lost` is what comes of that which passes the end."""
    n = len(way)
    for v in range(len(steps)):
        at = 0
        for r in range(n):
            goal = way[r] + steps[v]
            while at < n - 1 and way[at + 1] <= goal:
                at += 1
            if at == n - 1:
                out[r, v] = later[at, v] if goal <= way[at] else lost
                continue
            share = (goal - way[at]) / (way[at + 1] - way[at])
            out[r, v] = (1 - share) * later[at, v] + share * later[at + 1, v]


@njit(cache=True, nogil=True)
def pass_links(
    belief: Belief, first: NDArray[np.int64], to: NDArray[np.int64], share: float, out: Belief
) -> None:
    """A share of each linked reference's belief goes to its links, equally."""
    for r in range(belief.shape[0]):
        for v in range(belief.shape[1]):
            out[r, v] = belief[r, v]
    for r in range(belief.shape[0]):
        many = first[r + 1] - first[r]
        for k in range(first[r], first[r + 1]):
            there = out[to[k]]
            for v in range(belief.shape[1]):
                part = share * belief[r, v] / many
                out[r, v] -= part
                there[v] += part


@njit(cache=True, nogil=True)
def pass_links_back(
    later: Belief, first: NDArray[np.int64], to: NDArray[np.int64], share: float, out: Belief
) -> None:
    """The transpose of `pass_links`."""
    for r in range(later.shape[0]):
        many = first[r + 1] - first[r]
        for v in range(later.shape[1]):
            there = 0.0
            for k in range(first[r], first[r + 1]):
                there += later[to[k], v] / many
            out[r, v] = later[r, v] if many == 0 else (1 - share) * later[r, v] + share * there


@njit(cache=True, nogil=True)
def level(belief: Belief, share: float, more: float) -> None:
    """A share of the belief stays, and every class of every reference gets some more."""
    for r in range(belief.shape[0]):
        for v in range(belief.shape[1]):
            belief[r, v] = belief[r, v] * share + more


@njit(cache=True, nogil=True)
def weigh(belief: Belief, evidence: Floats, z: NDArray[np.float32], says: Floats, factors: Floats) -> None:
    """What a table (GRID,) says of each reference's z-score is added to its evidence and counts."""
    for r in range(belief.shape[0]):
        at = (z[r] - FIRST) * PER_STEP + HALF  # all in 32 bits: to the nearest one of GRID
        cell = np.uint64(np.int32(min(max(at, NONE), LAST)))
        evidence[r] += says[cell]
        b, factor = belief[r], factors[cell]
        for v in range(len(b)):
            b[v] *= factor


@njit(cache=True, nogil=True, error_model="numpy")
def share_out(belief: Floats, total: float, out: Floats) -> None:
    """Divide the belief by its total; `out` gets that of each reference, its eight classes in pairs.

    The belief is handed over as one line (references * 8,): divided reference by reference it would take
    three times as long.
    """
    for i in range(len(belief)):
        belief[i] /= total
    for r in range(len(out)):
        b = belief[8 * r : 8 * r + 8]
        out[r] = ((b[0] + b[1]) + (b[2] + b[3])) + ((b[4] + b[5]) + (b[6] + b[7]))


@njit(cache=True, nogil=True)
def read(
    belief: Floats,
    z: NDArray[np.float32],
    verifying: NDArray[np.float32],
    way: Floats,
    xy: Floats,
    reach: Floats,
    out: Floats,
) -> int:
    """What a belief (references,) says; returns the answer's item.

    `reach` holds metres: of the stretch of way whose belief counts together, beside the answer, where another
    place begins, and beyond which it is all the same how far away belief lies. `out` gets the belief of the
    stretch; the largest score beside the answer; that at other places; the largest one that verifies, beside
    the answer; and how far from it the belief lies, in metres.
    """
    n = len(way)
    begin, end, mass, most, best_begin, best_end = 0, 0, 0.0, -1.0, 0, 0
    for r in range(n):
        while end < n and way[end] <= way[r] + reach[0]:
            mass += belief[end]
            end += 1
        while way[begin] < way[r] - reach[0]:
            mass -= belief[begin]
            begin += 1
        if mass > most:
            most, best_begin, best_end = mass, begin, end
    total, centre = 1e-300, 0.0
    for r in range(best_begin, best_end):
        total += belief[r]
        centre += belief[r] * (way[r] - way[best_begin])
    centre = way[best_begin] + centre / total
    item = best_begin
    for r in range(best_begin, best_end):
        if abs(way[r] - centre) < abs(way[item] - centre):
            item = r
    out[0] = most
    beside, verified, elsewhere, away = -1e9, -1e9, -1e9, 0.0
    for r in range(n):
        if abs(way[r] - way[item]) < reach[1]:
            beside, verified = max(beside, z[r]), max(verified, verifying[r])
        if z[r] > elsewhere and _apart(way, xy, r, item) > reach[2]:
            elsewhere = z[r]
        east, north = xy[r, 0] - xy[item, 0], xy[r, 1] - xy[item, 1]
        away += belief[r] * min(east * east + north * north, reach[3] * reach[3])
    out[1] = beside
    out[2] = elsewhere if elsewhere >= -1e8 else -4.0  # the whole map is one place
    out[3] = verified
    out[4] = np.sqrt(max(away, 0.0))
    return item


@njit(cache=True, nogil=True)
def _apart(way: Floats, xy: Floats, one: int, other: int) -> float:
    """Metres between two references, along the way or as the crow flies: whichever is shorter."""
    east, north = xy[one, 0] - xy[other, 0], xy[one, 1] - xy[other, 1]
    return float(min(abs(way[one] - way[other]), np.sqrt(east * east + north * north)))
