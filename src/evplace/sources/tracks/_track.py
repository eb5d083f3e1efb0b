"""Track: where the camera was, and when."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Fixes, Keep
from evplace.sources.tracks._order import in_order

_MIN_SPEED_MPS = 1.0
"""Below this the direction of movement is mostly GPS noise."""
_MAX_STEP_US = 5_000_000
"""A heading is not taken from fixes further apart than this."""
_ZONE_REACH_DEG = 15.0
"""How far from a zone's central meridian its metres are still useful."""
_LATITUDES = (-80.0, 84.0)
"""UTM is defined between these."""
MAX_SPEED_MPS = 70.0
"""No vehicle on a road goes faster."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """Positions over time in one UTM zone. NaN where there is no fix (only after `at`)."""

    t_us: NDArray[np.int64]
    """(N,) microseconds; since 1970 where the log has dates, else since midnight. Increasing from `of`."""
    latitude: Floats
    """(N,) degrees; NaN everywhere in a local plane."""
    longitude: Floats
    """(N,) degrees; NaN everywhere in a local plane."""
    easting: Floats
    """(N,) metres in the zone."""
    northing: Floats
    """(N,) metres in the zone."""
    heading_deg: Floats
    """(N,) degrees clockwise from north, NaN where unknown.

    From the log (true north) or from the movement (the zone's north, up to 3 degrees off true north).
    """
    zone: int
    """UTM zone, 1 to 60, of all positions; 0 for a local plane."""
    northern: bool
    """Whether northings count from the equator (else from 10,000 km south of it)."""
    dropped: dict[str, int] = field(default_factory=dict)
    """Reason -> number of fixes that were left out."""
    notes: tuple[str, ...] = ()
    """What was guessed or left out, a sentence each, with an example."""
    fault: str | None = None
    """What broke the log off; this is its good part."""
    dated: bool = True
    """Whether times count from 1970; else from the midnight before the first fix."""
    unit: str | None = None
    """The unit that the log's times were taken in, where the log does not say."""
    held_against: str = ""
    """What of the log's own its positions were held against: "speed and course", in which a slow drift shows;
    "speed", in which one to the side does not; or nothing, which is so from `local`, too."""

    def __len__(self) -> int:
        return len(self.t_us)

    @property
    def xy(self) -> Floats:
        """(N, 2) easting and northing in metres, NaN where there is no fix."""
        return np.column_stack([self.easting, self.northing])

    @property
    def known(self) -> NDArray[np.bool_]:
        """(N,) where there is a position."""
        return np.isfinite(self.easting) & np.isfinite(self.northing)

    @classmethod
    def of(
        cls,
        fixes: Fixes,
        offset_us: int = 0,
        zone: int | None = None,
        northern: bool | None = None,
        max_speed_mps: float = MAX_SPEED_MPS,
        keep: Keep | None = None,
    ) -> Track:
        """The fixes that can be true, in one UTM zone: `zone` and `northern`, or those of the middle fix.

        One wrong fix does not matter: it is left out, counted and shown. `max_speed_mps` is the fastest that
        the vehicle goes; `keep` the side that is right where the log's clock was set, or its positions leapt.
        Raises TrackError where no fix is usable, or most cannot be true or lie too far from the zone.
        """
        from evplace.sources.tracks._possible import possible  # compiles: not needed without a log

        if fixes.xy is None:
            fixes, zone, northern = _in_zone(_known(fixes), zone, northern)
        else:
            fixes, zone, northern = _finite(fixes), 0, True
        good = possible(in_order(fixes, keep), max_speed_mps, keep, zone)
        assert good.xy is not None
        easting, northing = np.ascontiguousarray(good.xy.T)
        heading = _heading(good.t_us, easting, northing, good.heading_deg)
        notes = (*good.notes, *good.losses.sentences())
        return cls(
            good.t_us + np.int64(offset_us), good.latitude, good.longitude, easting, northing, heading, zone,
            northern, good.losses.counts, notes, good.fault, good.dated, good.unit, good.held_against,
        )  # fmt: skip

    @classmethod
    def local(cls, t_us: ArrayLike, xy: ArrayLike, heading_deg: ArrayLike | None = None) -> Track:
        """Positions (N, 2) in metres on a plane of their own (zone 0): a game, a simulator, poses.

        `t_us` (N,) must increase; headings (N,) are computed from movement where None or NaN.
        Raises TrackError where the arrays do not fit or the times do not increase.
        """
        times, metres = np.asarray(t_us, np.int64), np.asarray(xy, np.float64)
        if metres.shape != (len(times), 2) or not len(times):
            raise TrackError(
                f"{len(times)} times need positions of shape ({len(times)}, 2), not {metres.shape}"
            )
        if np.any(np.diff(times) <= 0):
            raise TrackError("the times of the positions must increase: sort them and drop duplicates")
        nowhere = np.full(len(times), np.nan)
        given = nowhere if heading_deg is None else np.asarray(heading_deg, np.float64)
        easting, northing = metres[:, 0].copy(), metres[:, 1].copy()
        heading = _heading(times, easting, northing, given)
        return cls(times, nowhere, nowhere.copy(), easting, northing, heading, 0, True)

    def in_zone(self, zone: int, northern: bool) -> Track:
        """The same fixes in metres of another UTM zone: a query's, in its map's zone.

        Raises TrackError where only one of the two is a local plane (zone 0), or the zone is far away.
        """
        import utm

        if not (zone and self.zone):
            raise TrackError("positions in a local plane and positions on the Earth cannot be compared")
        known = self.known
        _check_zone(zone, self.longitude[known])
        easting, northing = np.full(len(self), np.nan), np.full(len(self), np.nan)
        easting[known], northing[known], _, _ = utm.from_latlon(
            self.latitude[known], self.longitude[known], force_zone_number=zone, force_northern=northern
        )
        return replace(self, easting=easting, northing=northing, zone=zone, northern=northern)

    def at(self, t_us: ArrayLike, max_gap_s: float = 1.0, max_gap_m: float = 20.0) -> Track:
        """The track at the times `t_us` (M,), in any order, linear in UTM between two fixes.

        NaN beyond the ends, and between fixes further apart than `max_gap_s` seconds or `max_gap_m`
        metres (one cell): what has no position is unlabelled, not guessed. The time of a fix gets that fix.
        """
        times = np.asarray(t_us, np.int64)
        after = np.searchsorted(self.t_us, times)
        exact = self.t_us[np.minimum(after, len(self) - 1)] == times
        known = exact | (after > 0) & (after < len(self))
        right = np.clip(after, 0, len(self) - 1)
        left = np.where(exact, right, np.maximum(after - 1, 0))
        span_us = self.t_us[right] - self.t_us[left]
        step_m = np.hypot(
            self.easting[right] - self.easting[left], self.northing[right] - self.northing[left]
        )
        known &= exact | (span_us <= max_gap_s * 1e6) & (step_m <= max_gap_m)
        share = np.where(known & ~exact, (times - self.t_us[left]) / np.maximum(span_us, 1), 0.0)

        def between(start: Floats, end: Floats) -> Floats:
            return np.where(known, start + share * (end - start), np.nan)

        def along(values: Floats) -> Floats:
            return between(values[left], values[right])

        # Of the neighbours only: a track is asked for one time after another, and may be long.
        start, end = np.deg2rad(self.heading_deg[left]), np.deg2rad(self.heading_deg[right])
        east, north = between(np.sin(start), np.sin(end)), between(np.cos(start), np.cos(end))
        heading = np.rad2deg(np.arctan2(east, north)) % 360
        return replace(
            self,
            t_us=times,
            latitude=along(self.latitude),
            longitude=along(self.longitude),
            easting=along(self.easting),
            northing=along(self.northing),
            heading_deg=heading,
        )


def _known(fixes: Fixes) -> Fixes:
    """The fixes with a position on the Earth that UTM covers; TrackError where there is none."""
    latitude, longitude = fixes.latitude, fixes.longitude
    finite = np.isfinite(latitude) & np.isfinite(longitude)
    zero = finite & (latitude == 0) & (longitude == 0)  # what receivers write before a fix
    inside = (latitude >= _LATITUDES[0]) & (latitude <= _LATITUDES[1]) & (np.abs(longitude) <= 180)
    fixed = fixes.without(~finite | zero, "no fix")
    return _some(fixed.without(~inside[finite & ~zero], "out of range"))


def _finite(fixes: Fixes) -> Fixes:
    """The fixes with a position on their plane; TrackError where there is none."""
    return _some(fixes.without(~np.isfinite(fixes.xy).all(axis=1), "no position"))  # type: ignore[arg-type]


def _some(fixes: Fixes) -> Fixes:
    if not len(fixes):
        raise TrackError(f"no usable fix{fixes.losses}")
    return fixes


def _in_zone(fixes: Fixes, zone: int | None, northern: bool | None) -> tuple[Fixes, int, bool]:
    """The fixes with metres in one zone, by default that of the middle one; far ones are counted."""
    import utm

    middle = float(np.sort(fixes.longitude)[len(fixes) // 2])  # of a fix: a mean of two may be of none
    if northern is None:
        northern = bool(np.median(fixes.latitude) >= 0)
    if zone is None:
        zone = int(utm.latlon_to_zone_number(float(np.median(fixes.latitude)), middle))
    _check_zone(zone, np.array([middle]))
    near = fixes.without(_away(zone, fixes.longitude) > _ZONE_REACH_DEG, "far from all others")
    easting, northing, _, _ = utm.from_latlon(
        near.latitude, near.longitude, force_zone_number=zone, force_northern=northern
    )
    return replace(near, xy=np.column_stack([easting, northing])), zone, northern


def _away(zone: int, longitude: Floats) -> Floats:
    """Degrees from the middle of a zone."""
    return np.asarray(np.abs((longitude - (6 * zone - 183) + 180) % 360 - 180), np.float64)


def _check_zone(zone: int, longitude: Floats) -> None:
    if not 1 <= zone <= 60:
        raise TrackError(f"there is no UTM zone {zone}: give one from 1 to 60")
    away = _away(zone, longitude)
    if np.any(away > _ZONE_REACH_DEG):
        raise TrackError(
            f"fixes lie up to {away.max():.0f} degrees from the middle of UTM zone {zone}: "
            "the track and the map are of different regions, or a fix is wrong"
        )


def _heading(t_us: NDArray[np.int64], easting: Floats, northing: Floats, given: Floats) -> Floats:
    """(N,) headings: the given ones, and where NaN the direction from the fix before to the one after.

    Still NaN where the camera moves slower than 1 m/s or the two are over 5 s apart.
    """
    before = np.maximum(np.arange(len(t_us)) - 1, 0)
    after = np.minimum(np.arange(len(t_us)) + 1, len(t_us) - 1)
    east, north = easting[after] - easting[before], northing[after] - northing[before]
    span_us = t_us[after] - t_us[before]
    moving = np.hypot(east, north) * 1e6 >= _MIN_SPEED_MPS * np.maximum(span_us, 1)
    moved = np.where(moving & (span_us <= _MAX_STEP_US), np.rad2deg(np.arctan2(east, north)), np.nan)
    return np.where(np.isfinite(given), given, moved) % 360
