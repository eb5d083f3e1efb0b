"""Places: what the network tells apart (paper, section 3.4, Fig. 3), and when an answer counts as right.

`PlaceGrid` has positions: a place is a square of the ground that the map's drive came through. `PlaceRuns`
has none: a place is a stretch of the map's images. A map can be made of either.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evplace.core.errors import PlaceMapError, SettingsError, TrackError
from evplace.sources.tracks import Track

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_REACH = 2**30
"""Cell numbers stay below this, so that a pair of them fits one int64."""


class Places(Protocol):
    """The places of a map, numbered 0 to n - 1 in the order of first visit."""

    @property
    def n(self) -> int:
        """The number of places."""

    def where(self, xy: Floats) -> NDArray[Any]:
        """What the others take, for a drive's images in order with positions `xy` (n, 2), NaN allowed."""

    def label(self, where: ArrayLike) -> Ints:
        """(n,) the place of each image, -1 where it is in none."""

    def seen(self, where: ArrayLike) -> Bools:
        """(n,) whether any answer would be right."""

    def accepts(self, places: ArrayLike, where: ArrayLike) -> Bools:
        """(n,) whether the answer `places` (n,) is right for the images at `where`; -1 never is."""

    def right(self, where: Any) -> Bools:
        """(n, places) which places are right answers for each image."""

    def centres(self) -> Floats:
        """(places, 2) metres, NaN where places have no position."""

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON; `from_dict` reads it."""


@dataclass(frozen=True, eq=False)
class PlaceGrid:
    """Square cells of the ground, numbered in the order in which the map's drive came to them."""

    cells: Ints
    """(places, 2) column and row of each place's cell: floor((x - origin) / cell_m)."""
    cell_m: float = 20.0
    """Side of a cell in metres (paper: rho = 20)."""
    origin: tuple[float, float] = (0.0, 0.0)
    """Corner of cell (0, 0) in metres. The paper names none; ours is the zone's own."""
    zone: int = 0
    """UTM zone of the metres, to be forced on queries; 0 for a local plane."""
    northern: bool = True
    """Hemisphere of the zone."""

    @classmethod
    def from_track(cls, track: Track, cell_m: float = 20.0, origin: tuple[float, float] = (0.0, 0.0)) -> Self:
        """The cells that the positions of `track` lie in; positions that are not known are passed over."""
        found = cls.from_positions(track.xy, cell_m, origin)
        return cls(found.cells, found.cell_m, found.origin, track.zone, track.northern)

    @classmethod
    def from_positions(
        cls, xy: ArrayLike, cell_m: float = 20.0, origin: tuple[float, float] = (0.0, 0.0)
    ) -> Self:
        """The cells that positions (n, 2) in metres lie in.

        Raises TrackError where no position is known, SettingsError for an impossible cell or origin.
        """
        if not (np.isfinite(cell_m) and cell_m > 0 and np.all(np.isfinite(origin))):
            raise SettingsError(f"cells of {cell_m} m from {origin} are impossible: give a side above 0 m")
        cells, known = _cells(xy, cell_m, origin)
        if not known.any():
            raise TrackError("no position is known, so there are no places: check the track and its times")
        first = np.unique(cells[known], axis=0, return_index=True)[1]
        return cls(cells[known][np.sort(first)], float(cell_m), (float(origin[0]), float(origin[1])))

    @property
    def n(self) -> int:
        """The number of places."""
        return len(self.cells)

    def where(self, xy: Floats) -> Floats:
        """The positions themselves."""
        return xy

    def label(self, where: ArrayLike) -> Ints:
        """(n,) the place whose cell each position (n, 2) lies in; -1 in none, or where NaN."""
        cells, known = _cells(where, self.cell_m, self.origin)
        return np.where(known, self._place_of(cells), -1)

    def seen(self, where: ArrayLike) -> Bools:
        """(n,) whether the map has any place in the 3x3 block of cells around each position (n, 2).

        The paper takes the eight neighbours of the true cell as right, so only outside this block can "not
        seen before" be the right answer.
        """
        cells, known = _cells(where, self.cell_m, self.origin)
        block = [(column, row) for column in (-1, 0, 1) for row in (-1, 0, 1)]
        near = np.any([self._place_of(cells + step) >= 0 for step in block], axis=0)
        return np.asarray(known & near, np.bool_)

    def accepts(self, places: ArrayLike, where: ArrayLike) -> Bools:
        """(n,) whether the cell of each place is that of the position (n, 2) or one of its 8 neighbours."""
        chosen = np.asarray(places, np.int64)
        cells, known = _cells(where, self.cell_m, self.origin)
        apart = np.abs(self.cells[chosen] - cells).max(axis=-1)
        return np.asarray(known & (chosen >= 0) & (apart <= 1), np.bool_)

    def right(self, where: ArrayLike) -> Bools:
        """(n, places) which places are right answers at each position (n, 2)."""
        cells, known = _cells(where, self.cell_m, self.origin)
        near = np.abs(self.cells[None, :, 0] - cells[:, None, 0]) <= 1
        near &= np.abs(self.cells[None, :, 1] - cells[:, None, 1]) <= 1
        return np.asarray(near & known[:, None], np.bool_)

    def centres(self) -> Floats:
        """(places, 2) middle of each cell in metres."""
        return np.asarray((self.cells + 0.5) * self.cell_m + np.asarray(self.origin), np.float64)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {
            "kind": "grid",
            "cell_m": self.cell_m,
            "origin": list(self.origin),
            "zone": self.zone,
            "northern": self.northern,
            "cells": self.cells.tolist(),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The grid that `to_dict` wrote; PlaceMapError where it is damaged."""
        cells, origin = np.array(_of(values, "cells", list), object), _of(values, "origin", list)
        if cells.ndim != 2 or cells.shape[1] != 2 or not all(_is_cell(cell) for cell in cells.reshape(-1)):
            raise _damaged("'cells' are no list of pairs of whole numbers")
        cell_m, zone = _number(_of(values, "cell_m", int, float)), _of(values, "zone", int)
        if len(origin) != 2 or not cell_m > 0 or not 0 <= zone <= 60:
            raise _damaged(f"cells of {cell_m} m from {origin!r} in zone {zone}")
        x, y = map(_number, origin)
        grid = cls(cells.astype(np.int64), cell_m, (x, y), zone, _of(values, "northern", bool))
        if len(np.unique(grid.cells, axis=0)) != grid.n:
            raise _damaged("double cells")
        return grid

    def _place_of(self, cells: Ints) -> Ints:
        """(n,) the place of each cell (n, 2), -1 where there is none."""
        keys, order = self._index
        wanted = _keys(cells)
        at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        return np.where(keys[at] == wanted, order[at], -1)

    @cached_property
    def _index(self) -> tuple[Ints, Ints]:
        """The cells' keys in ascending order, and the place of each."""
        keys = _keys(self.cells)
        order = np.argsort(keys)
        return keys[order], order


@dataclass(frozen=True)
class PlaceRuns:
    """Stretches of the map's images, for drives without positions.

    Place i holds the images [i * every, (i + 1) * every).
    """

    n_images: int
    """Images in the map's drive."""
    every: int = 1
    """Images in a place (the last may have fewer)."""
    tolerance: int = 0
    """How many places off an answer may be."""

    def __post_init__(self) -> None:
        if self.n_images < 1 or self.every < 1 or self.tolerance < 0:
            raise SettingsError(
                f"{self.n_images} images in places of {self.every} with a tolerance of {self.tolerance} are "
                "impossible: give at least 1 image, places of at least 1, a tolerance of at least 0"
            )

    @property
    def n(self) -> int:
        """The number of places."""
        return -(-self.n_images // self.every)

    def where(self, xy: Floats) -> Ints:
        """The numbers of the images: a query is taken to be in step with the map's drive."""
        return np.arange(len(xy), dtype=np.int64)

    def label(self, where: ArrayLike) -> Ints:
        """(n,) the place of each image number (n,); -1 beyond the map's drive."""
        images = np.asarray(where, np.int64)
        return np.where((images >= 0) & (images < self.n_images), images // self.every, -1)

    def seen(self, where: ArrayLike) -> Bools:
        """(n,) whether some place is within the tolerance of each image number (n,)."""
        wanted = np.asarray(where, np.int64) // self.every
        return np.asarray((wanted >= -self.tolerance) & (wanted < self.n + self.tolerance), np.bool_)

    def accepts(self, places: ArrayLike, where: ArrayLike) -> Bools:
        """(n,) whether each place (n,) is at most `tolerance` places from that of the image number (n,)."""
        chosen = np.asarray(places, np.int64)
        wanted = np.asarray(where, np.int64) // self.every
        return np.asarray((chosen >= 0) & (np.abs(chosen - wanted) <= self.tolerance), np.bool_)

    def right(self, where: ArrayLike) -> Bools:
        """(n, places) which places are right answers for each image number (n,)."""
        wanted = np.asarray(where, np.int64) // self.every
        return np.asarray(np.abs(np.arange(self.n) - wanted[:, None]) <= self.tolerance, np.bool_)

    def centres(self) -> Floats:
        """(places, 2) NaN: these places have no positions."""
        return np.full((self.n, 2), np.nan)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON."""
        return {"kind": "runs", "n_images": self.n_images, "every": self.every, "tolerance": self.tolerance}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The runs that `to_dict` wrote; PlaceMapError where they are damaged."""
        n_images, every, tolerance = (_of(values, name, int) for name in ("n_images", "every", "tolerance"))
        if max(n_images, every, tolerance) > _REACH:
            raise _damaged(f"{n_images} images in places of {every}")
        try:
            return cls(n_images, every, tolerance)
        except SettingsError as error:
            raise _damaged(str(error)) from error


def from_dict(values: Mapping[str, Any]) -> PlaceGrid | PlaceRuns:
    """The places that `to_dict` wrote; PlaceMapError where they are of no known kind or damaged."""
    match values.get("kind"):
        case "grid":
            return PlaceGrid.from_dict(values)
        case "runs":
            return PlaceRuns.from_dict(values)
        case other:
            raise PlaceMapError(f"the map's places are of the kind {other!r}: known are 'grid' and 'runs'")


def _damaged(why: str) -> PlaceMapError:
    return PlaceMapError(f"the places of the map are damaged ({why}): make the map again")


def _of(values: Mapping[str, Any], name: str, *kinds: type) -> Any:
    """The entry of that name; PlaceMapError where it is missing or of none of the kinds."""
    if type(values.get(name)) not in kinds:
        raise _damaged(f"'{name}' is missing or of a wrong kind")
    return values[name]


def _number(value: object) -> float:
    """A finite number as a float; PlaceMapError where it is none."""
    if not isinstance(value, int | float) or isinstance(value, bool) or not abs(value) < 1e12:
        raise _damaged(f"{value!r} metres")
    return float(value)


def _is_cell(value: object) -> bool:
    return type(value) is int and abs(value) < _REACH


def _cells(xy: ArrayLike, cell_m: float, origin: tuple[float, float]) -> tuple[Ints, Bools]:
    """(n, 2) cells of the positions (n, 2), and (n,) where these are known."""
    positions = np.asarray(xy, np.float64).reshape(-1, 2)
    steps = np.floor((positions - np.asarray(origin)) / cell_m)
    known = np.all(np.abs(steps) < _REACH, axis=1)  # False for NaN
    return np.where(known[:, None], steps, 0).astype(np.int64), known


def _keys(cells: Ints) -> Ints:
    """(n,) one number for each cell (n, 2)."""
    return cells[:, 0] * (4 * _REACH) + cells[:, 1]
