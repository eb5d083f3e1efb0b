"""Stretches in which the car stands, of known length."""

from __future__ import annotations

import numpy as np
import pytest
from examined import at_times, found, noise, outcome, road

from evplace.core.events import Events
from evplace.doctor import standing


def drive(stops: list[tuple[float, float]], seconds: float = 60.0) -> Events:
    """10,000 events a second, 300 in the stops."""
    moving, still = noise(10_000, seconds).t_us, noise(300, seconds, 1).t_us
    for start, stop in stops:
        moving = moving[(moving < start * 1e6) | (moving >= stop * 1e6)]
    return at_times(np.concatenate([moving, still]))


def positions(stops: list[tuple[float, float]], seconds: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    t_s = np.arange(0, seconds + 0.1, 0.2)
    moves = np.ones(len(t_s))
    for start, stop in stops:
        moves[(t_s >= start) & (t_s < stop)] = 0
    return t_s, np.concatenate([[0], np.cumsum(moves)[:-1]]) * 2.0


def test_stands_are_measured_by_events_and_by_the_track() -> None:
    stops = [(10.0, 15.0), (30.0, 42.0)]
    events, track = drive(stops), road(*positions(stops))
    quiet = found(standing, events, "quiet stretches", track)
    assert (quiet.state, quiet.value) == ("look", pytest.approx(100 * 17 / 60, abs=3))
    still = found(standing, events, "stand-still", track)
    assert (still.state, still.value) == ("look", pytest.approx(100 * 17 / 60, abs=4))
    assert "2 stretches" in quiet.sentence
    assert "2 stretches" in still.sentence
    assert "`every_m=1`" in still.advice
    assert [drawing.name for drawing in outcome(standing, events, track).drawings] == ["activity", "speed"]


def test_without_a_track_events_are_counted_off() -> None:
    finding = found(standing, drive([(30.0, 42.0)]), "quiet stretches")
    assert "`every_events`" in finding.advice


def test_a_short_stop_and_a_steady_drive_are_good() -> None:
    track = road(*positions([]))
    for stops in ([], [(20.0, 22.0)]):
        assert found(standing, drive(stops), "quiet stretches", track).value == 0
        assert found(standing, drive(stops), "stand-still", track).value == 0


def test_a_gap_is_no_stand() -> None:
    events = drive([])
    t_us = events.t_us[(events.t_us < 20e6) | (events.t_us >= 26e6)]
    assert found(standing, at_times(t_us), "quiet stretches").value == 0


def test_a_short_recording_does_not_tell() -> None:
    assert found(standing, drive([], 4.0), "quiet stretches").state == "unknown"


def test_a_track_elsewhere_says_nothing_of_the_speed() -> None:
    names = [
        finding.name
        for finding in outcome(standing, drive([]), road(np.arange(9.0) + 900, np.arange(9.0))).findings
    ]
    assert names == ["quiet stretches"]
