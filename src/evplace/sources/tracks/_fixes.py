"""Fixes: what every format of GPS log gives, and what is left of it once bad ones are out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import TrackError

DAY_US = 86_400_000_000
_LATITUDES = (-80.0, 84.0)
"""UTM is defined between these."""


class Fix(NamedTuple):
    """One line of a log."""

    t_us: int
    latitude: float
    longitude: float
    heading_deg: float


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """Fixes in the order of the file, not yet checked."""

    t_us: NDArray[np.int64]
    """(N,) microseconds; since 1970 where the file has dates, else since midnight."""
    latitude: NDArray[np.float64]
    """(N,) degrees, NaN where unknown."""
    longitude: NDArray[np.float64]
    """(N,) degrees, NaN where unknown."""
    heading_deg: NDArray[np.float64]
    """(N,) degrees clockwise from north, NaN where unknown."""
    dropped: dict[str, int] = field(default_factory=dict)
    """Reason -> number of lines left out by the reader."""

    @classmethod
    def of(cls, fixes: Iterable[Fix], dropped: dict[str, int]) -> Fixes:
        """The fixes as arrays."""
        columns = list(zip(*fixes, strict=True)) or [(), (), (), ()]
        return cls(
            np.array(columns[0], np.int64),
            np.array(columns[1], np.float64),
            np.array(columns[2], np.float64),
            np.array(columns[3], np.float64),
            dropped,
        )

    def __getitem__(self, part: NDArray[np.bool_]) -> Fixes:
        return Fixes(
            self.t_us[part], self.latitude[part], self.longitude[part], self.heading_deg[part], self.dropped
        )


def usable(fixes: Fixes) -> Fixes:
    """Only fixes with a position and a time later than all before them; the others counted by reason.

    Raises TrackError where none is left, or where more than half run backwards in time.
    """
    dropped = dict(fixes.dropped)
    if not len(fixes.t_us):
        raise TrackError(f"no usable fix{_counts(dropped)}")
    here = fixes[_where_known(fixes, dropped)]
    if not len(here.t_us):
        raise TrackError(f"no usable fix{_counts(dropped)}")
    forward = _where_later(here.t_us, dropped)
    if 2 * dropped.get("backwards", 0) > len(forward):
        raise TrackError(
            f"{dropped['backwards']} of {len(forward)} fixes run backwards in time: sort the log by time"
        )
    kept = here[forward]
    return Fixes(kept.t_us, kept.latitude, kept.longitude, kept.heading_deg, dropped)


def unroll_days(t_us: NDArray[np.int64]) -> NDArray[np.int64]:
    """Times of day (N,) in microseconds that go on after midnight: a step back of over 12 h is a new day."""
    steps = np.diff(t_us, prepend=t_us[:1])
    return t_us + DAY_US * np.cumsum((steps < -DAY_US // 2).astype(np.int64))


def _where_known(fixes: Fixes, dropped: dict[str, int]) -> NDArray[np.bool_]:
    """(N,) which fixes have a position on the earth that UTM covers."""
    finite = np.isfinite(fixes.latitude) & np.isfinite(fixes.longitude)
    zero = finite & (fixes.latitude == 0) & (fixes.longitude == 0)  # what receivers write before a fix
    inside = (fixes.latitude >= _LATITUDES[0]) & (fixes.latitude <= _LATITUDES[1])
    inside &= (fixes.longitude >= -180) & (fixes.longitude <= 180)
    _count(dropped, "no fix", int(np.sum(~finite | zero)))
    _count(dropped, "out of range", int(np.sum(finite & ~inside)))
    return np.asarray(finite & ~zero & inside, np.bool_)


def _where_later(t_us: NDArray[np.int64], dropped: dict[str, int]) -> NDArray[np.bool_]:
    """(N,) which times are later than every time before them."""
    latest_before = np.maximum.accumulate(t_us)[:-1]
    _count(dropped, "duplicate time", int(np.sum(t_us[1:] == latest_before)))
    _count(dropped, "backwards", int(np.sum(t_us[1:] < latest_before)))
    return np.concatenate([[True], t_us[1:] > latest_before])


def _count(dropped: dict[str, int], reason: str, number: int) -> None:
    if number:
        dropped[reason] = dropped.get(reason, 0) + number


def _counts(dropped: dict[str, int]) -> str:
    return "".join(f", {number} dropped: {reason}" for reason, number in dropped.items())
