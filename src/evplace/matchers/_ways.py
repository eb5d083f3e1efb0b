"""Where a map's items lie along its drive, in metres, and which lie beside one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.matchers import Route

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

USUAL_SPEED = 10.0
"""Metres a second that a drive without positions is taken to go."""
LARGEST_STEP_M = 3.0
"""Metres between two items without positions, at most: one image in ten seconds makes a sequence, too."""
BREAK_M = 30.0
"""Consecutive items further apart than this, and than ten usual steps, are not one stretch of road."""
GAP_M = 1000.0
"""What lies between two such stretches."""
BESIDE_M = 8.0
"""Items so near by, which look the same way, see the same."""
SAME_WAY_DEG = 34.0
"""Two views are the same way up to here."""
APART_M = 30.0
"""Places so far apart are told apart by any truth rule in use."""
LARGEST_REST_S = 2.0
"""Between items further apart in time, the map's drive may have stood."""


class Links(NamedTuple):
    """Items that may be passed to without driving there, as lists one behind the other."""

    first: Ints
    """(items + 1,) where each item's list begins."""
    to: Ints
    """The items linked to."""


@dataclass(frozen=True, eq=False)
class Ways:
    """The items of a map along its drive."""

    way: Floats
    """(items,) metres, never decreasing."""
    pace: float
    """Usual metres a second of the map's drive while it moved."""
    spacing: float
    """Usual metres between two items."""
    xy: Floats
    """(items, 2) metres; along the way where there are no positions."""
    heading_deg: Floats
    """(items,) NaN where unknown."""
    links: Links
    """From each item to those beside it."""
    in_metres: bool
    """Whether the items have positions."""

    @classmethod
    def of(cls, route: Route) -> Ways:
        """Items without a position lie between those around them."""
        known = np.asarray(np.isfinite(route.position).all(axis=1), np.bool_)
        if known.sum() < 2:
            return cls._in_time(route)
        at = np.arange(len(known))
        xy = np.stack([np.interp(at, at[known], column[known]) for column in route.position.T], axis=1)
        steps = _lengths(np.diff(xy, axis=0))
        spacing = _usual(steps[steps > 0])
        way: Floats = np.concatenate([[0.0], np.cumsum(np.where(_breaks(steps, spacing), GAP_M, steps))])
        links = _links(xy, route.heading_deg, way)
        return cls(way, _pace(route, steps), spacing, xy, route.heading_deg, links, in_metres=True)

    @classmethod
    def _in_time(cls, route: Route) -> Ways:
        """Without positions, items lie as far apart as they were taken."""
        items = len(route.position)
        apart_s = 1.0 if route.t_us is None else _usual(np.diff(route.t_us) * 1e-6)
        step = min(USUAL_SPEED * apart_s, LARGEST_STEP_M)
        way = np.arange(items, dtype=np.float64) * step
        xy = np.stack([way, np.zeros(items)], axis=1)
        links = Links(np.zeros(items + 1, np.int64), np.zeros(0, np.int64))
        unknown = np.full(items, np.nan)
        return cls(way, step / apart_s, step, xy, unknown, links, in_metres=False)

    def away(self, item: int) -> Floats:
        """(items,) metres from an item as the crow flies."""
        east, north = self.xy[:, 0] - self.xy[item, 0], self.xy[:, 1] - self.xy[item, 1]
        return np.asarray(np.hypot(east, north), np.float64)

    def looks_like(self, item: int) -> NDArray[np.bool_]:
        """(items,) which look the way of an item, or may."""
        turn = np.abs((self.heading_deg - self.heading_deg[item] + 180) % 360 - 180)
        return np.asarray(~(turn > SAME_WAY_DEG), np.bool_)


def _usual(values: Floats) -> float:
    """Their median; 1 where there are none, or it is not above 0."""
    usual = float(np.median(values)) if len(values) else 1.0
    return usual if usual > 0 else 1.0


def _breaks(steps: Floats, spacing: float) -> NDArray[np.bool_]:
    return np.asarray(steps > max(BREAK_M, 10 * spacing), np.bool_)


def _lengths(steps: Floats) -> Floats:
    return np.asarray(np.hypot(steps[:, 0], steps[:, 1]), np.float64)


def _pace(route: Route, steps: Floats) -> float:
    """Metres a second while the drive moved, by consecutive items that are `steps` apart."""
    if route.t_us is None:
        return USUAL_SPEED
    seconds = np.diff(route.t_us) * 1e-6
    short = (seconds > 0) & (seconds <= max(LARGEST_REST_S, 2 * _usual(seconds)))
    return max(_usual(steps[short] / seconds[short]), 0.1)


def _links(xy: Floats, heading_deg: Floats, way: Floats) -> Links:
    """Pairs that lie within BESIDE_M, look the same way, and are more than APART_M apart along the way."""
    items = np.arange(len(xy))
    cells = np.floor(xy / BESIDE_M).astype(np.int64)
    keys = _key(cells)
    order = np.argsort(keys, kind="stable")
    found: list[tuple[Ints, Ints]] = []
    for step in [(column, row) for column in (-1, 0, 1) for row in (-1, 0, 1)]:
        wanted = _key(cells + step)
        first, last = (np.searchsorted(keys[order], wanted, side) for side in ("left", "right"))
        many = last - first
        one = np.repeat(items, many)
        other = order[np.repeat(first - np.cumsum(many) + many, many) + np.arange(len(one))]
        turn = np.abs((heading_deg[other] - heading_deg[one] + 180) % 360 - 180)
        beside = (_lengths(xy[other] - xy[one]) < BESIDE_M) & (turn <= SAME_WAY_DEG)
        beside &= np.abs(way[other] - way[one]) > APART_M
        found.append((one[beside], other[beside]))
    one, other = (np.concatenate(column) for column in zip(*found, strict=True))
    first = np.searchsorted(np.sort(one), np.arange(len(xy) + 1))
    return Links(first, other[np.argsort(one, kind="stable")])


def _key(cells: Ints) -> Ints:
    """(items,) one number for each column and row (items, 2)."""
    return np.asarray(cells[:, 0] * (1 << 32) + cells[:, 1], np.int64)
