"""Which of a map's items an image is compared with: all of them, or those near a rough position."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import PlaceMapError, SettingsError
from evplace.placemap import PlaceMap
from evplace.sources.tracks import Track

Compared = Literal["all", "position", "match"]
"""All items; those near a position that was given; those near the last match."""
Rough = Callable[[int], tuple[float, float] | None]
"""Time in microseconds -> easting and northing in the map's metres; None where they are not known."""

FURTHER = 0.5
"""Items so much further away, as a share, are compared, too: so the part of a map need not change with each
image."""
FASTEST_MPS = 20.0
"""A match is a rough position for as long as so fast a camera needs to leave what is near it."""


class Region(NamedTuple):
    """What an image is compared with."""

    compared: Compared
    items: NDArray[np.int64] | None = None
    """Sorted; None: all."""


class Regions:
    """The regions of one drive, image by image."""

    def __init__(
        self, place_map: PlaceMap, near_m: float | None = None, track: Track | Rough | None = None
    ) -> None:
        """Within `near_m` metres of where `track` says, else of the last match; None: all of the map.

        Raises SettingsError where `near_m` cannot be, PlaceMapError where the map has no positions,
        TrackError where a track's cannot be compared with these.
        """
        if near_m is None and track is not None:
            raise SettingsError("`track` says where to compare, and `near_m` how far around: give both")
        if near_m is not None and not (near_m > 0 and math.isfinite(near_m)):
            raise SettingsError(f"`near_m` is metres above 0, not {near_m}")
        self._xy = place_map.items.position
        if near_m is not None and not np.isfinite(self._xy).all(axis=1).any():
            raise PlaceMapError(
                "no item of the map has a position, so that none is near one: leave out `near_m`"
            )
        self._near_m = near_m
        self._rough = _of_track(place_map, track) if isinstance(track, Track) else track
        self._last: tuple[int, tuple[float, float]] | None = None
        self._centre = (math.nan, math.nan)
        self._items = np.zeros(0, np.int64)

    def at(self, t_us: int) -> Region:
        """What the image of a time is compared with."""
        if self._near_m is None:
            return Region("all")
        rough = self._rough(t_us) if self._rough is not None else self._last_match(t_us)
        if rough is None:
            return Region("all")
        if not math.dist(rough, self._centre) <= FURTHER * self._near_m:
            away = np.hypot(self._xy[:, 0] - rough[0], self._xy[:, 1] - rough[1])
            self._centre, self._items = rough, np.flatnonzero(away <= (1 + FURTHER) * self._near_m)
        return Region("match" if self._rough is None else "position", self._items)

    def found(self, t_us: int, position: tuple[float, float]) -> None:
        """A match that is accepted."""
        self._last = t_us, position

    def _last_match(self, t_us: int) -> tuple[float, float] | None:
        if self._last is None or self._near_m is None:
            return None
        then_us, position = self._last
        return position if (t_us - then_us) * 1e-6 <= self._near_m / FASTEST_MPS else None


def _of_track(place_map: PlaceMap, track: Track) -> Rough:
    zone = place_map.zone
    there = track if zone is None or (track.zone, track.northern) == zone else track.in_zone(*zone)

    def rough(t_us: int) -> tuple[float, float] | None:
        easting, northing = there.at([t_us], max_gap_s=5.0, max_gap_m=math.inf).xy[0]
        return None if math.isnan(easting) else (float(easting), float(northing))

    return rough
