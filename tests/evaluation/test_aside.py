"""Matches that all lie to one side of the track."""

from __future__ import annotations

import numpy as np

from evplace.evaluation import Result, measure
from evplace.evaluation._aside import aside
from evplace.evaluation.truth import by_frames
from evplace.matchers import Path as Answers

T_S = np.arange(0, 120, 0.2)
ROAD = np.column_stack([10 * T_S, 0 * T_S])


def judged(track: np.ndarray, item: np.ndarray | None = None) -> Result:
    """A drive along the road of the map at 10 m/s, with the positions that its log says."""
    n = len(T_S)
    item = np.arange(n) if item is None else item
    answers = Answers(item, np.ones(n), np.ones(n, np.bool_))
    return measure(
        answers, by_frames(n, n, 5), positions=ROAD, t_us=np.round(T_S * 1e6).astype(np.int64), query_xy=track
    )


def test_a_good_track_and_noise_are_nothing() -> None:
    noise = np.random.default_rng(0).normal(0, 5, ROAD.shape)
    assert aside(judged(ROAD + noise)) == ""
    assert aside(judged(np.full_like(ROAD, np.nan))) == ""


def test_a_drift_is_told_with_its_place_and_size() -> None:
    metres = np.interp(T_S, [40, 80, 80.1], [0, 100, 0])
    told = aside(judged(ROAD + np.column_stack([0 * T_S, metres])))
    assert told.startswith("all matches lie 37 to 87 m to one side of the drive's track for 30 s (first 50 s")


def test_a_clock_that_is_off_is_told() -> None:
    assert "for 120 s (first 0 s" in aside(judged(ROAD + np.array([30.0, 0.0])))


def test_wrong_matches_are_no_drift() -> None:
    item = np.random.default_rng(0).integers(0, len(T_S), len(T_S))
    assert aside(judged(ROAD, item)) == ""
    assert aside(judged(ROAD, np.full(len(T_S), 300))) == ""
    assert aside(judged(ROAD + np.array([0.0, 2000.0]))) == ""
