"""Stretches in which the car stands: the events fall off, and the track does not move.

Many images of one place make a map lopsided and a match easy to overrate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.doctor._outcome import Curve, Finding, Outcome, State, counted
from evplace.doctor._speed import speed_at
from evplace.doctor._subject import BIN_US, AtTheEnd, Subject, stretches

OF = ("events", "frames")

Floats = NDArray[np.float64]
Stretches = list[tuple[int, int]]

LOW = 0.15
"""Share of the busy rate (its 90th percentile) below which the scene seems to stand."""
SLOW_MPS = 0.7
"""Speed below which the car stands: a receiver's noise is less, a walk is more."""
SHORTEST_S = 3.0
"""Shorter stands are left alone."""
MUCH = 5.0
"""Per cent of the time above which stands should be thinned out."""


class Check(AtTheEnd):
    """Asks the subject's activity, and its track."""

    def outcome(self) -> Outcome:
        """Findings: quiet stretches, and stand-still where a track covers the recording."""
        t_us, activity = self._subject.smooth_activity()
        if np.isfinite(activity).sum() * BIN_US < 2 * SHORTEST_S * 1e6:
            sentence = f"Cannot be determined: the recording has less than {2 * SHORTEST_S:g} s without gaps."
            return Outcome([Finding("quiet stretches", "unknown", None, "%", sentence)])
        quiet = _long(activity <= LOW * np.nanpercentile(activity, 90))
        findings = [_finding("quiet stretches", quiet, self._subject, t_us, "the image hardly changes")]
        drawings = [
            _curve(
                "quiet",
                "activity",
                "Activity, mean over a second",
                self._unit(),
                self._subject,
                t_us,
                activity,
                quiet,
            )
        ]
        mps = self._speed(t_us)
        if not np.isnan(mps).all():
            stands = _long(mps < SLOW_MPS)
            findings.append(_finding("stand-still", stands, self._subject, t_us, "the track stands still"))
            drawings.append(
                _curve("stands", "speed", "Speed of the track", "m/s", self._subject, t_us, mps, stands)
            )
        return Outcome(findings, drawings)

    def _speed(self, t_us: NDArray[np.int64]) -> Floats:
        """Metres a second; NaN throughout without a track."""
        if self._subject.track is None:
            return np.full(len(t_us), np.nan)
        return speed_at(self._subject.track, t_us.astype(np.float64))

    def _unit(self) -> str:
        return "events/s" if self._subject.kind == "events" else "pixels/s"


def _long(where: NDArray[np.bool_]) -> Stretches:
    return [(a, b) for a, b in stretches(where) if (b - a) * BIN_US >= SHORTEST_S * 1e6]


def _curve(
    what: str,
    name: str,
    title: str,
    up: str,
    subject: Subject,
    t_us: NDArray[np.int64],
    values: Floats,
    found: Stretches,
) -> Curve:
    seconds = subject.seconds(t_us)
    spans = [(float(seconds[start]), float(seconds[stop - 1]), what) for start, stop in found]
    return Curve(name, title, "time in s", up, seconds, values, spans)


def _finding(name: str, found: Stretches, subject: Subject, t_us: NDArray[np.int64], what: str) -> Finding:
    seconds = sum(stop - start for start, stop in found) * BIN_US / 1e6
    share = 100 * seconds / max(subject.span_s, 1e-6)
    if not found:
        return Finding(name, "good", 0.0, "%", f"There is no stretch of {SHORTEST_S:g} s in which {what}.")
    longest = max(found, key=lambda stretch: stretch[1] - stretch[0])
    sentence = (
        f"{what.capitalize()} in {counted(len(found), 'stretch', 'stretches')}, {seconds:.1f} s in all; "
        f"the longest is {(longest[1] - longest[0]) * BIN_US / 1e6:.1f} s "
        f"from {float(subject.seconds(t_us)[longest[0]]):.1f} s on."
    )
    state: State = "good" if share < MUCH else "look"
    thin = (
        "`every_m=1` makes an image a metre"
        if subject.track is not None
        else "`every_events` makes few images"
    )
    return Finding(name, state, share, "%", sentence, "" if state == "good" else f"{thin} where it stands")
