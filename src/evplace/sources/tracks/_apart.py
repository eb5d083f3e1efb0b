"""A track and a recording of different times: by how much, why so, and what mends it."""

from __future__ import annotations

import datetime
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

from evplace.sources._times import DATED_US, DAY_US, UNIT_US
from evplace.sources.tracks._track import Track

_SECOND_US = 1_000_000
_HOUR_US = 3600 * _SECOND_US
_LEAP_US = 18 * _SECOND_US
"""GPS time is ahead of UTC by the leap seconds since 1980: 18 since 2017."""
_ROLLOVER_US = 1024 * 7 * DAY_US
"""Old receivers count weeks in 10 bits: after 1024 weeks they begin anew."""
_GPS_EPOCH_US = 315_964_800 * _SECOND_US
"""1980-01-06, from which GPS counts."""
_ZONES_H = 14
"""No time zone is further from UTC."""


class Apart(NamedTuple):
    """What is said of a track and a recording that do not overlap."""

    sentence: str
    """By how much they differ, and the likely cause."""
    advice: str
    """What to do, with the argument and the flag."""

    def __str__(self) -> str:
        return f"{self.sentence}; {self.advice}"


class Span(NamedTuple):
    """From and to, in microseconds."""

    first_us: int
    last_us: int

    def shifted(self, shift_us: int) -> Span:
        """The same, later."""
        return Span(self.first_us + shift_us, self.last_us + shift_us)

    def fits(self, other: Span) -> bool:
        """Whether half of the shorter of the two lies within the other."""
        shared_us = min(self.last_us, other.last_us) - max(self.first_us, other.first_us)
        shorter_us = min(self.last_us - self.first_us, other.last_us - other.first_us)
        return shared_us >= 0 and 2 * shared_us >= shorter_us

    def __str__(self) -> str:
        return f"{self.first_us / 1e6:.3f} s to {self.last_us / 1e6:.3f} s"


def apart(track: Track, first_us: int, last_us: int) -> Apart:
    """Why a track does not overlap images from `first_us` to `last_us` (microseconds), and what mends it."""
    log, images = Span(int(track.t_us[0]), int(track.t_us[-1])), Span(first_us, last_us)
    sentence = f"the track and the images do not overlap: the track runs from {log}, the images from {images}"
    unit = _other_unit(track, log, images)
    if unit is not None:
        return Apart(f"{sentence}: {unit.sentence}", unit.advice)
    for shift_us, cause in _shifts(log, images):
        if log.shifted(shift_us).fits(images):
            return Apart(f"{sentence}: {cause}", f"shift its times: {_argument(shift_us)}")
    begin_us = images.first_us - log.first_us
    together = f"{_argument(begin_us)} lets both begin at once"
    if _dated(log) != _dated(images):
        which = "images" if _dated(log) else "track's times"
        return Apart(f"{sentence}: the {which} do not count from 1970", f"shift the track: {together}")
    advice = f"give the recording's own track, or shift its times: {together}"
    return Apart(f"{sentence}; they begin {abs(begin_us) / 1e6:,.3f} s apart", advice)


def on_day_of(track: Track, first_us: int) -> Track:
    """A track without dates on the day on which it is nearest to images that begin at `first_us`.

    The same track where it has dates, or the images have none.
    """
    if track.dated or not _dated(Span(first_us, first_us)):
        return track
    log = Span(int(track.t_us[0]), int(track.t_us[-1]))
    day = (first_us - log.first_us) // DAY_US
    days = min((day, day + 1), key=lambda days: _distance(log.shifted(days * DAY_US), first_us))
    date = datetime.date(1970, 1, 1) + datetime.timedelta(days=days)
    note = f"the log has no dates: {date} was taken from the images (`date` says otherwise)"
    return replace(track, t_us=track.t_us + days * DAY_US, dated=True, notes=(*track.notes, note))


def _distance(span: Span, t_us: int) -> int:
    return max(span.first_us - t_us, t_us - span.last_us, 0)


def _dated(span: Span) -> bool:
    return DATED_US[0] <= span.first_us <= DATED_US[1]


def _argument(shift_us: int) -> str:
    return f"`offset_us={shift_us}`"


def _shifts(log: Span, images: Span) -> Iterator[tuple[int, str]]:
    """What may have to be added to the log's times, the likelier first, and why."""
    begin_us = images.first_us - log.first_us
    for sign in (-1, 1):
        yield sign * _LEAP_US, "they differ by 18 s, the leap seconds between GPS time and UTC"
    for base_us, cause in _bases(begin_us):
        yield base_us, cause
        for sign in (-1, 1):
            yield base_us + sign * _LEAP_US, f"{cause}, and by 18 leap seconds"


def _bases(begin_us: int) -> Iterator[tuple[int, str]]:
    for step_us in (_HOUR_US, _HOUR_US // 2, _HOUR_US // 4):
        zone_us = round(begin_us / step_us) * step_us
        if 0 < abs(zone_us) <= _ZONES_H * _HOUR_US:
            hours = abs(zone_us) / _HOUR_US
            yield zone_us, f"they differ by {hours * 3600:,.0f} s, a time zone of {hours:g} h"
    for weeks in (1, 2):
        for sign in (1, -1):
            yield (
                sign * weeks * _ROLLOVER_US,
                f"they differ by {1024 * weeks} weeks, after which old receivers count anew (rollover)",
            )
    for sign in (1, -1):
        yield sign * _GPS_EPOCH_US, "one of them counts from 1980, as GPS does, the other from 1970"


def _is_other(span: Span, factor: float, other: Span) -> bool:
    """Whether a span that is no date is one in a unit `factor` times its own, and fits."""
    scaled = Span(*(round(t_us * factor) for t_us in span))
    return not _dated(span) and _dated(scaled) and scaled.fits(other)


def _other_unit(track: Track, log: Span, images: Span) -> Apart | None:
    """Whether one of the two was read in a unit 1000, or a power of that, from its own."""
    units = list(UNIT_US)  # the largest first
    for power in (1, 2, 3):
        for larger in (True, False):
            factor = 1000**power if larger else 1 / 1000**power
            times = f"by a factor of {1000**power:,}: another unit of time"
            if _is_other(log, factor, images):
                at = units.index(track.unit) + (-power if larger else power) if track.unit else -1
                unit = units[at] if 0 <= at < len(units) else "UNIT"
                mend = f"say the log's unit: `open_track(time_unit={unit})`"
                return Apart(f"the track's times differ {times}", mend)
            if _is_other(images, factor, log):
                told = "say the recording's unit with `time_unit`: s, ms, us or ns"
                return Apart(f"the images' times differ {times}", told)
    return None
