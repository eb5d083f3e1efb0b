"""A map of several drives: an item is a view of a place, and has references of several drives.

The first drive's references are items. A reference of a later drive belongs to the item nearest by that looks
the same way; where there is none, it becomes an item of its own, on a stretch of way that begins and ends
OVERLAP_M inside what is known, so that one can be followed into the other. An item scores as the best of its
references: by night that of the night, by day that of the day. What stands behind it sees items alone, and
needs to know nothing of drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.scorers import ComparesSome, OpenScorer, Rows, Scored, Verifies

if TYPE_CHECKING:
    from evplace.placemap import Items, PlaceMap

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

JOIN_M = 6.0
"""A reference this near to an item, or nearer than the items lie to one another, shows the same."""
SAME_WAY_DEG = 34.0
"""Where it looks the same way up to here."""
OVERLAP_M = 25.0
"""How far new items begin before what is known ends."""
BLOCK = 64
"""References that are looked up at once."""


class Part(NamedTuple):
    """What one drive adds to a map."""

    name: str
    map: PlaceMap
    """The map of that drive alone."""
    item: Ints
    """(references,) the item that each of its references belongs to."""


class JoinedRows:
    """Rows of a map of several drives, from those of the maps of each; see OpenScorer and ComparesSome."""

    def __init__(self, opened: Sequence[OpenScorer], items: Sequence[Ints]) -> None:
        """`items` are those that the references of each drive belong to."""
        self.distances = opened[0].distances
        self._opened, self._belong = opened, items
        self._all = _Grouped.of(np.concatenate(items))
        self.items = self._all.items
        """Those that have references, in ascending order: what the columns of a row are."""

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """See OpenScorer."""
        return self.best(self.of_references(images)[0])

    def of_references(self, images: NDArray[np.uint8]) -> list[Rows]:
        """(n, references) of all drives: `rows`, and where the scorer verifies, those that do."""
        each: list[Sequence[Rows]] = [
            one.scored(images) if isinstance(one, Verifies) else [one.rows(images)] for one in self._opened
        ]
        return [np.concatenate(rows, axis=1) for rows in zip(*each, strict=True)]

    def best(self, rows: Rows) -> Rows:
        """(n, references) -> (n, items)."""
        return self._all.best(rows)

    def some(self, images: NDArray[np.uint8], items: Ints) -> Rows:
        """(n, len(items)) what `rows` would give for these items."""
        return self._some(images, items)[0]

    def _some(self, images: NDArray[np.uint8], items: Ints) -> list[Rows]:
        """(n, len(items)): `rows`, and where the scorer verifies, those that do."""
        chosen = [np.flatnonzero(np.isin(belong, items)) for belong in self._belong]
        pairs = zip(self._opened, chosen, strict=True)
        each = [_some(one, images, some) for one, some in pairs if len(some)]
        found = _Grouped.of(
            np.concatenate([belong[some] for belong, some in zip(self._belong, chosen, strict=True)])
        )
        columns = np.searchsorted(found.items, items)
        return [found.best(np.concatenate(rows, axis=1))[:, columns] for rows in zip(*each, strict=True)]


class VerifyingRows(JoinedRows):
    """The same where the scorer verifies: see Verifies."""

    def scored(self, images: NDArray[np.uint8], items: Ints | None = None) -> Scored:
        """See Verifies."""
        if items is not None:
            return Scored(*self._some(images, items))
        return Scored(*(self.best(rows) for rows in self.of_references(images)))


def joined_rows(opened: Sequence[OpenScorer], items: Sequence[Ints]) -> JoinedRows:
    """What compares with all drives at once; `items` are those that the references of each belong to."""
    verifies = all(isinstance(one, Verifies) for one in opened)
    return (VerifyingRows if verifies else JoinedRows)(opened, items)


class _Grouped(NamedTuple):
    """References put together by the items that they belong to."""

    items: Ints
    order: Ints
    """(references,) those of the first item first."""
    first: Ints
    """(items,) where those of each begin."""

    @classmethod
    def of(cls, belong: Ints) -> _Grouped:
        """From the item (references,) of each."""
        order = np.argsort(belong, kind="stable")
        first = np.flatnonzero(np.diff(belong[order], prepend=-1))
        return cls(belong[order][first], order, first)

    def best(self, rows: Rows) -> Rows:
        """(n, references) -> (n, items)."""
        return np.asarray(np.maximum.reduceat(rows[:, self.order], self.first, axis=1), np.float32)


def _some(one: OpenScorer, images: NDArray[np.uint8], references: Ints) -> Sequence[Rows]:
    if isinstance(one, Verifies):
        return one.scored(images, references)
    return [
        one.some(images, references) if isinstance(one, ComparesSome) else one.rows(images)[:, references]
    ]


def places_in(known: Items, new: Items) -> tuple[Ints, Ints]:
    """(references,) the item that each reference of one more drive belongs to; and which are new items.

    Items without positions are in step: reference i of each drive shows the same.
    """
    if np.isnan(known.position).all():
        return np.arange(len(new)), np.zeros(0, np.int64)
    item = _nearest(known, new, max(JOIN_M, _spacing(known.position)))
    fresh = np.flatnonzero(_widened(item < 0, new.position))
    item[fresh] = len(known) + np.arange(len(fresh))
    return item, fresh


def _nearest(known: Items, new: Items, reach_m: float) -> Ints:
    """(references,) the nearest item in reach that looks the same way, or may; -1 where there is none."""
    found = np.full(len(new), -1, np.int64)
    for start in range(0, len(new), BLOCK):
        part = slice(start, start + BLOCK)
        around = _around(known.position, new.position[part], reach_m)
        if not len(around):
            continue
        apart = np.hypot(*(new.position[part, None] - known.position[around]).transpose(2, 0, 1))
        turn = new.heading_deg[part, None] - known.heading_deg[around]
        apart[np.abs((turn + 180) % 360 - 180) > SAME_WAY_DEG] = np.inf
        apart[np.isnan(apart)] = np.inf
        best = apart.argmin(axis=1)
        found[part] = np.where(apart.min(axis=1) <= reach_m, around[best], -1)
    return found


def _around(position: Floats, some: Floats, reach_m: float) -> Ints:
    """Which positions lie in reach of the smallest upright box around some others."""
    some = some[np.isfinite(some).all(axis=1)]
    if not len(some):
        return np.zeros(0, np.int64)
    inside = (position >= some.min(axis=0) - reach_m) & (position <= some.max(axis=0) + reach_m)
    return np.flatnonzero(inside.all(axis=1))


def _widened(off: Bools, position: Floats) -> Bools:
    """(references,) those that are off, and those OVERLAP_M before and after them along the drive."""
    steps = np.nan_to_num(np.hypot(*np.diff(position, axis=0).T), nan=0.0)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    wide = off.copy()
    for at in np.flatnonzero(np.diff(off, prepend=off[:1]) | off):
        first, last = np.searchsorted(way, [way[at] - OVERLAP_M, way[at] + OVERLAP_M])
        wide[first:last] = True
    return np.asarray(wide, np.bool_)


def _spacing(position: Floats) -> float:
    """Usual metres between two items."""
    steps = np.hypot(*np.diff(position, axis=0).T)
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 0.0


def images_of(parts: Sequence[Part], items: Ints) -> NDArray[np.uint8]:
    """(n, h, w) or (n, h, w, C): of each of some items (n,), the first drive's reference that it has."""
    item = np.concatenate([part.item for part in parts])
    ends = np.cumsum([len(part.item) for part in parts])
    order = np.argsort(item, kind="stable")
    chosen = order[np.searchsorted(item[order], items)]
    found = np.empty((len(items), *parts[0].map.image_shape), np.uint8)
    for number, part in enumerate(parts):
        own = np.searchsorted(ends, chosen, "right") == number
        images = part.map.images_of(chosen[own] - ends[number] + len(part.item))
        if images is not None:
            found[own] = images
    return found
