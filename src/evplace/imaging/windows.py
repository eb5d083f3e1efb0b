"""Cut a stream of events into windows: by time (paper, Eq. 4) or by count.

A window is a half-open stretch of time, open on the left: window n holds the events with
(n-1) dt < t <= n dt, counted from the first event. dt = 1/60 s is not a whole number of microseconds, so
the edges are worked out in integers: n = ceil(t rate / 10^6). The first event has t = 0, which belongs to no
window by Eq. 4; it is put into window 1.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import RecordingError, SettingsError
from evplace.core.events import Events

MICROSECONDS = 1_000_000
LONGEST_S = 86_400
_SECONDS = re.compile(r"[0-9]{0,12}(\.[0-9]{0,18})?([eE][+-]?[0-9]{1,2})?(/[0-9]{1,12})?")
MOST_EMPTY = 100_000
"""Windows without events, one after another, that are still believed: half an hour at 1/60 s."""


@dataclass(frozen=True)
class WindowSettings:
    """How a stream of events is cut."""

    dt: str = "1/30"
    """Length of a window in seconds, as a fraction or a decimal (paper: 1/60, 1/16 and 1/30)."""
    count: int = 0
    """Events in a window; 0 cuts by time."""

    def __post_init__(self) -> None:
        if self.count < 0:
            raise SettingsError(f"the setting 'count' cannot be {self.count}: it takes 0 or more events")
        _ = self.seconds

    @property
    def seconds(self) -> Fraction:
        """dt as an exact fraction of seconds."""
        try:
            # Bounded before it is computed with: 1e999999999 would be.
            seconds = Fraction(self.dt if _SECONDS.fullmatch(self.dt) else "none")
        except (ValueError, ZeroDivisionError):
            raise SettingsError(
                f"the setting 'dt' cannot be '{self.dt}': write seconds as 1/30 or 0.05"
            ) from None
        if not 1 <= seconds * MICROSECONDS <= LONGEST_S * MICROSECONDS:
            raise SettingsError(
                f"the setting 'dt' cannot be '{self.dt}': it takes a microsecond or more, up to a day"
            )
        return seconds


class Window(NamedTuple):
    """A closed window."""

    n: int
    """Its number, from 1."""
    t_us: int
    """The time of its end, in microseconds: the time of its image."""
    events: int
    """How many events it holds; 0 for an empty window, which is kept."""


class TimeWindows:
    """Windows of equal length; those without events are closed too, so that numbers never jump."""

    def __init__(self, seconds: Fraction, origin_us: int | None = None) -> None:
        """Windows of `seconds`, counted from `origin_us` (the first event's time if None)."""
        self._dt = seconds * MICROSECONDS
        self._origin_us = origin_us
        self._open = 1
        self._events = 0
        self._begun = False

    def push(self, events: Events) -> Iterator[tuple[Events, Window | None]]:
        """The packet in pieces, in order, each with the window that it closes, if it closes one.

        RecordingError where the times leap ahead by more than MOST_EMPTY windows.
        """
        if not len(events):
            return
        if self._origin_us is None:
            self._origin_us = int(events.t_us[0])
        start = 0
        while start < len(events):
            end_us = self._end_us(self._open)
            # A later event is what shows that a window is over.
            stop = start + int(np.searchsorted(events.t_us[start:], end_us, side="right"))
            self._events += stop - start
            if stop < len(events) and self._begun:
                self._check_leap(int(events.t_us[stop]), end_us)
            self._begun = True
            yield events[start:stop], (self._close() if stop < len(events) else None)
            start = stop

    @property
    def end_us(self) -> int | None:
        """The last microsecond of the open window; None before the first event, which says where it is."""
        return None if self._origin_us is None else self._end_us(self._open)

    def add(self, events: int) -> None:
        """So many more events in the open window, none of them after `end_us`."""
        self._events += events

    def tick(self, t_us: int) -> Iterator[Window]:
        """The windows that are over once no event up to `t_us` will come any more, with their events.

        Nothing before the first event, which says where windows begin. RecordingError as `push`.
        """
        if self._origin_us is None:
            return
        self._check_leap(t_us, self._end_us(self._open))
        while self._end_us(self._open) <= t_us:
            yield self._close()

    def finish(self) -> Window | None:
        """The last window, which no later event has closed; None where there never was an event."""
        return self._close() if self._events else None

    def _check_leap(self, t_us: int, end_us: int) -> None:
        """Whether the windows between an end and the next event can be empty ones of a recording."""
        empty = int((t_us - end_us) / self._dt)
        if empty > MOST_EMPTY:
            raise RecordingError(
                f"the clock leaps: from {end_us / MICROSECONDS:.3f} s to {t_us / MICROSECONDS:.3f} s no "
                f"event comes, which makes {empty:,} empty images: cut the recording there, or mend its "
                "times (is it the right `time_unit`?)"
            )

    def _close(self) -> Window:
        window = Window(self._open, self._end_us(self._open), self._events)
        self._open += 1
        self._events = 0
        return window

    def _end_us(self, n: int) -> int:
        """The last whole microsecond of window n: t <= n dt is t <= floor(n dt) for whole t."""
        assert self._origin_us is not None
        return self._origin_us + n * self._dt.numerator // self._dt.denominator


class CountWindows:
    """Windows of equally many events; the last may hold fewer."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._closed = 0
        self._events = 0
        self._t_us = 0

    def push(self, events: Events) -> Iterator[tuple[Events, Window | None]]:
        """The packet in pieces, in order, each with the window that it closes, if it closes one."""
        start = 0
        while start < len(events):
            stop = min(len(events), start + self._count - self._events)
            self._events += stop - start
            self._t_us = int(events.t_us[stop - 1])
            yield events[start:stop], (self._close() if self._events == self._count else None)
            start = stop

    def tick(self, t_us: int) -> Iterator[Window]:  # noqa: ARG002 - windows by time need it
        """Nothing: time closes no window that is cut by count."""
        yield from ()

    def finish(self) -> Window | None:
        """The last window, if it holds an event."""
        return self._close() if self._events else None

    def _close(self) -> Window:
        window = Window(self._closed + 1, self._t_us, self._events)
        self._closed += 1
        self._events = 0
        return window


def open_windows(settings: WindowSettings, origin_us: int | None = None) -> TimeWindows | CountWindows:
    """A fresh cutter for one stream."""
    if settings.count:
        return CountWindows(settings.count)
    return TimeWindows(settings.seconds, origin_us)


def windows_before(t_us: NDArray[np.int64], events: Events, settings: WindowSettings) -> Iterator[Events]:
    """For each time (n,) in microseconds the events of the last dt up to it, or the last `count` of them.

    That is for images at times that are given; these windows may overlap. Open on the left, as above.
    """
    ends = np.searchsorted(events.t_us, t_us, "right")
    if settings.count:
        starts = np.maximum(ends - settings.count, 0)
    else:
        starts = np.searchsorted(events.t_us, t_us - round(settings.seconds * MICROSECONDS), "right")
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        yield events[start:end]
