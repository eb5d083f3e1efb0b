"""The track: known gaps, jumps, drops and coverage."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from examined import SIZE, found, noise, outcome, road

from evplace.core.events import Events
from evplace.doctor import gps

T_S = np.arange(0, 60.1, 0.5)
EVENTS = noise(500, 60)


def test_a_good_track_is_good() -> None:
    findings = outcome(gps, EVENTS, road(T_S, 8 * T_S)).findings
    assert [finding.state for finding in findings] == ["good"] * 5
    assert all(not finding.advice for finding in findings)


def test_without_a_track_nothing_is_said() -> None:
    assert not outcome(gps, EVENTS).findings


def test_a_gap_is_its_share_of_the_time() -> None:
    t_s = T_S[(T_S < 20) | (T_S > 32)]
    track = road(t_s, 8 * t_s)
    gap = found(gps, EVENTS, "GPS gaps", track)
    assert (gap.state, gap.value) == ("bad", pytest.approx(100 * 13 / 60, abs=0.01))
    assert "1 step " in gap.sentence
    covered = found(gps, EVENTS, "GPS coverage", track)
    assert (covered.state, covered.value) == ("look", pytest.approx(100 * 47 / 60, abs=0.5))


def test_steps_over_twenty_metres_have_no_position_inside() -> None:
    t_s = np.arange(0, 61.0)
    gap = found(gps, EVENTS, "GPS gaps", road(t_s, 25 * t_s))
    assert (gap.state, gap.value) == ("bad", pytest.approx(100))


@pytest.mark.parametrize("mps", [0.0, 3.0, 30.0])
def test_a_jump_is_found_at_any_speed(mps: float) -> None:
    metres = mps * T_S
    assert found(gps, EVENTS, "GPS jumps", road(T_S, metres)).value == 0
    metres[60:] += 150
    jump = found(gps, EVENTS, "GPS jumps", road(T_S, metres))
    assert (jump.state, jump.value) == ("look", 1)
    assert f"{150 + mps / 2:,.0f} m in 0.5 s" in jump.sentence


@pytest.mark.parametrize(("lost", "state"), [(0, "good"), (1, "good"), (20, "look"), (60, "bad")])
def test_fixes_that_were_left_out(lost: int, state: str) -> None:
    track = replace(road(T_S, 8 * T_S), dropped={"no fix": lost} if lost else {})
    finding = found(gps, EVENTS, "GPS fixes", track)
    assert (finding.state, finding.value) == (state, pytest.approx(100 * lost / (lost + len(T_S))))


def test_a_log_faster_than_its_receiver_repeats_positions() -> None:
    finding = found(gps, EVENTS, "GPS repeats", road(T_S, 8 * np.floor(T_S)))
    assert (finding.state, finding.value) == ("look", pytest.approx(50, abs=3))
    stands = np.where(T_S < 30, 8 * T_S, 240)
    assert found(gps, EVENTS, "GPS repeats", road(T_S, stands)).state == "good"


def test_a_track_of_another_day_does_not_overlap() -> None:
    finding = found(gps, EVENTS, "GPS coverage", road(T_S + 5000, 8 * T_S))
    assert (finding.state, finding.value) == ("bad", 0)
    assert "do not overlap" in finding.sentence
    assert "5000.000 s to 5060.000 s" in finding.sentence


def test_one_fix_and_no_events() -> None:
    assert found(gps, EVENTS, "GPS fixes", road(T_S[:1], T_S[:1])).state == "bad"
    assert found(gps, Events.empty(SIZE), "GPS coverage", road(T_S, T_S)).state == "unknown"


@pytest.mark.parametrize("ahead_s", [36_000, -18_000, 1024 * 7 * 86_400])
def test_the_cause_of_times_apart_is_named_with_the_flag(ahead_s: int) -> None:
    finding = found(gps, EVENTS, "GPS coverage", road(T_S + ahead_s, 8 * T_S))
    assert finding.state == "bad"
    assert "a time zone of" in finding.sentence or "1024 weeks" in finding.sentence
    assert f"`offset_us={-ahead_s * 1_000_000}`" in finding.advice


def test_what_was_left_out_of_the_log_is_told() -> None:
    notes = (
        "the log is not in the order of time: it was sorted",
        "left out of the track: 3 no fix (first fix 1)",
    )
    track = replace(road(T_S, 8 * T_S), dropped={"no fix": 3}, notes=notes)
    finding = found(gps, EVENTS, "GPS log", track)
    assert (finding.state, finding.value) == ("look", 2)
    assert "it was sorted. Left out of the track: 3 no fix (first fix 1)." in finding.sentence
    damaged = found(gps, EVENTS, "GPS log", replace(track, fault="it breaks off"))
    assert damaged.state == "bad"
    assert damaged.sentence.startswith("The log is damaged: it breaks off. ")


@pytest.mark.parametrize(
    ("held_against", "words"),
    [
        ("speed and course", "No slow drift:"),
        ("speed", "to the side is not checked"),
        ("", "drift is not checked"),
    ],
)
def test_it_is_said_whether_a_drift_would_show(held_against: str, words: str) -> None:
    for dropped in ({}, {"no fix": 3}):
        track = replace(road(T_S, 8 * T_S), held_against=held_against, dropped=dropped)
        assert words in found(gps, EVENTS, "GPS fixes", track).sentence


@pytest.mark.parametrize(
    ("reason", "word"),
    [
        ("repeated while moving", "static navigation"),
        ("faster than 70 m/s", "`max_speed_mps`"),
        ("against the log's own speed", "one receiver"),
        ("broken row", "lines shown"),
    ],
)
def test_the_advice_fits_the_reason(reason: str, word: str) -> None:
    track = replace(road(T_S, 8 * T_S), dropped={reason: 50, "no fix": 2})
    assert word in found(gps, EVENTS, "GPS fixes", track).advice
