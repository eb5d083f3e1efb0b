"""A whole drive through the filter: live, or in hindsight, forward and then backward."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.zscores import robust_z
from evplace.matchers import Learned, Rows, Seen
from evplace.matchers._answering import Reader
from evplace.matchers._belief import WRONG, Clock, Filter, Moment, clock_of, smoothed
from evplace.matchers._kept import Kept
from evplace.matchers._known import LATE_SIGNS, SIGNS
from evplace.matchers._ways import Ways

Floats = NDArray[np.float64]
BLOCK = 64
"""Moments whose beliefs are in memory at once; of the others one in so many is, the rest are made again."""


class _Drive:
    """The weights of a drive's images and the moments that they fall into."""

    def __init__(self, seen: Sequence[Seen], clock: Clock) -> None:
        self.weight, self.slow = np.zeros(len(seen)), np.zeros(len(seen), np.bool_)
        self.begins = [0]
        """The first image of each moment."""
        self.driven_s = [0.0]
        """Seconds of driving before each moment."""
        for query, one in enumerate(seen):
            self.weight[query], driven_s = clock.see(one)
            self.slow[query] = clock.slow
            if driven_s is not None and query:
                self.begins.append(query)
                self.driven_s.append(driven_s)
        self.ends = [*self.begins[1:], len(seen)]


class Trace(NamedTuple):
    """What the filter says of each image of a drive."""

    item: NDArray[np.int64]
    """(queries,) the answers."""
    signs: Floats
    """(queries, SIGNS) see `_known`, of live answers; (queries, LATE_SIGNS) of late ones."""
    live: Floats
    """(queries, SIGNS) those of what is said live."""
    weight: Floats
    """(queries,) how much each image counts."""
    slow: NDArray[np.bool_]
    """(queries,) whether each came long after the one before it."""


def live(ways: Ways, rows: Rows, seen: Sequence[Seen], learned: Learned) -> Trace:
    """Each answer from the images up to it; `learned` is what the map has told."""
    filter_, reader, clock = Filter(ways, learned.get(WRONG)), Reader(ways), clock_of(learned)
    signs = np.zeros((len(rows), SIGNS))
    slow = np.zeros(len(rows), np.bool_)
    out = Trace(np.zeros(len(rows), np.int64), signs, signs, np.zeros(len(rows)), slow)
    for query, (row, one) in enumerate(zip(rows, seen, strict=True)):
        z = robust_z(row)
        out.weight[query], driven_s = clock.see(one)
        slow[query] = clock.slow
        if driven_s is not None:
            filter_.move(driven_s)
        belief = filter_.see(z, out.weight[query])
        found = reader.find(belief, z, one.verifying, filter_.speeds)
        out.item[query], out.signs[query] = found.item, found.signs
    return out


def late(ways: Ways, rows: Rows, seen: Sequence[Seen], learned: Learned) -> Trace:
    """Each answer from all images of the drive."""
    drive, wrong = _Drive(seen, clock_of(learned)), learned.get(WRONG)
    signs, said = np.zeros((len(rows), LATE_SIGNS)), np.zeros((len(rows), SIGNS))
    out = Trace(np.zeros(len(rows), np.int64), signs, said, drive.weight, drive.slow)
    starts = _beliefs_at_blocks(ways, rows, drive, wrong)
    reader, message = Reader(ways), None
    for block, start in zip(range(len(starts), -1, -1), chain(starts.backwards(), [None]), strict=True):
        numbers = range(block * BLOCK, min((block + 1) * BLOCK, len(drive.begins)))
        moments = _moments(ways, rows, drive, wrong, numbers, start, (seen, said))
        beliefs, message = smoothed(moments, ways, message)
        for number, belief in zip(numbers, beliefs, strict=True):
            for query in range(drive.begins[number], drive.ends[number]):
                found = reader.find(belief, robust_z(rows[query]), seen[query].verifying)
                out.item[query], out.signs[query] = found.item, found.signs
    return out


def _beliefs_at_blocks(ways: Ways, rows: Rows, drive: _Drive, wrong: Floats | None) -> Kept:
    """The belief before each block of moments but the first, before which there is none."""
    starts, last = Kept(), None
    for first in range(BLOCK, len(drive.begins), BLOCK):
        numbers = range(first - BLOCK, first)
        last = _moments(ways, rows, drive, wrong, numbers, last)[-1].belief
        starts.append(last[None])
    return starts


def _moments(
    ways: Ways,
    rows: Rows,
    drive: _Drive,
    wrong: Floats | None,
    numbers: range,
    start: NDArray[np.floating[Any]] | None,
    said: tuple[Sequence[Seen], Floats] | None = None,
) -> list[Moment]:
    """The moments of some numbers, from the belief before them.

    With what was `said` of live answers, their signs are put there.
    """
    filter_, reader, out = Filter(ways, wrong), Reader(ways), []
    if start is not None:
        filter_.belief = start.astype(np.float64)
    for number in numbers:
        if number:
            filter_.move(drive.driven_s[number])
        for query in range(drive.begins[number], drive.ends[number]):
            z = robust_z(rows[query])
            belief = filter_.see(z, drive.weight[query])
            if said is not None:
                seen, signs = said
                signs[query] = reader.find(belief, z, seen[query].verifying, filter_.speeds).signs
        out.append(filter_.moment)
    return out
