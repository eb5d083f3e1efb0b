"""From a belief to an answer: which item, how far off it may be, and what else it may be."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.matchers import _nearby as nearby
from evplace.matchers import _route_filter as loops
from evplace.matchers._belief import reaches
from evplace.matchers._known import signs_of
from evplace.matchers._ways import Ways

Floats = NDArray[np.float64]
Scores = NDArray[np.float32]

READ = 5
"""What is read of a belief: see `loops.read`."""
OTHERS = 5
"""Runners-up that are named, at most."""
HELD = 1e-6
"""Belief below this is none."""
NOTABLE = 0.01
"""A runner-up has at least this share of the belief of the likeliest item."""
RISE = 0.2
"""How much higher the best of e times as many other places scores: so that, near a rough position, as few
images of places never seen are accepted as when all of the map is compared (on towns for tuning, ours)."""
LIKELY = 0.68
"""Share of the belief that the uncertainty holds."""


class Found(NamedTuple):
    """The best item by a belief."""

    item: int
    mass: float
    """Belief in the stretch around it."""
    signs: Floats
    """(LATE_SIGNS,) see `_known`; (SIGNS,) where the speeds are known."""


class Others(NamedTuple):
    """Runners-up to an answer."""

    items: tuple[int, ...]
    """Best first."""
    mass: float
    """Belief around the first; 0 where there is none."""


class Reader:
    """Reads beliefs over the items of a map."""

    def __init__(self, ways: Ways, left_out: int = 0) -> None:
        """`left_out` is how many items of the map these are not all of."""
        self.ways = ways
        self._more = 1 + left_out / len(ways.way)
        self._reach = reaches(ways)
        self._read = np.empty(READ)
        self._held, self._away = np.empty(len(ways.way), np.int64), np.empty(len(ways.way))
        self._bins = np.empty(nearby.BINS)

    def find(
        self, belief: Floats, z: Scores, verifying: Scores | None = None, speeds: Floats | None = None
    ) -> Found:
        """The item in the middle of the likeliest stretch, by (references,) z-scores and those that verify.

        Without these the z-scores themselves do. `speeds` (SPEEDS,) is the belief in each, where it is known.
        """
        second = z if verifying is None else verifying
        item = loops.read(belief, z, second, self.ways.way, self.ways.xy, self._reach, self._read)
        mass = float(self._read[0])
        if self._more > 1:
            _among(self._more, self._read)
        return Found(int(item), mass, signs_of(self._read, speeds))

    def uncertainty_m(self, belief: Floats, item: int) -> float:
        """Radius around the item that holds LIKELY of the belief, but no less than half a step between items.

        NaN where items have no positions.
        """
        if not self.ways.in_metres:
            return math.nan
        xy = self.ways.xy
        last = nearby.farthest(belief, xy, item, HELD, LIKELY, self._held, self._away, self._bins)
        if last < 0:
            return math.nan
        return max(float(np.hypot(*(xy[last] - xy[item]))), self.ways.spacing / 2)

    def others(self, belief: Floats, item: int) -> Others:
        """The next best items at other places."""
        least = max(HELD, NOTABLE * float(belief.max()))
        found, mass = np.empty(OTHERS, np.int64), np.empty(1)
        many = nearby.runners_up(
            belief, self.ways.xy, item, least, self._reach[[0, 2]], self._held, found, mass
        )
        return Others(tuple(found[:many].tolist()), float(mass[0]))


def _among(more: float, read: Floats) -> None:
    """What was read as if so many times as many items had been compared, the others like those that were."""
    belief = min(max(read[0], 0.0), 1.0)
    read[0] = belief / max(belief + (1 - belief) * more, 1e-300)
    read[2] += RISE * math.log(more)
