"""Tracks that move while the camera sees nothing, and the other way round."""

from __future__ import annotations

import numpy as np
import pytest
from examined import found, outcome
from test_standing import drive, positions

from evplace.doctor import moving
from evplace.sources.tracks import Track


def road(t_s: np.ndarray, metres: np.ndarray) -> Track:
    """At 20 m/s where it moves."""
    return Track.local(np.round(t_s * 1e6).astype(np.int64), np.column_stack([2 * metres, 0 * metres]))


def test_a_track_that_stands_where_the_camera_does_is_good() -> None:
    stops = [(10.0, 15.0), (30.0, 42.0)]
    finding = found(moving, drive(stops), "movement", road(*positions(stops)))
    assert (finding.state, finding.value) == ("good", 0.0)


def test_a_track_that_moves_while_the_camera_sees_nothing() -> None:
    finding = found(moving, drive([(30.0, 42.0)]), "movement", road(*positions([])))
    assert (finding.state, finding.value) == ("bad", pytest.approx(20, abs=2))
    assert finding.sentence.startswith("The track moves while the camera sees hardly anything for 1")
    assert "clock offset" in finding.advice


def test_a_track_that_stands_while_the_camera_moves() -> None:
    finding = found(moving, drive([]), "movement", road(*positions([(30.0, 40.0)])))
    assert (finding.state, finding.value) == ("bad", pytest.approx(100 * 10 / 60, abs=3))
    assert finding.sentence.startswith("The track stands while the camera sees as much as on the way for ")


def test_a_second_of_either_is_nothing() -> None:
    assert found(moving, drive([(30.0, 32.5)]), "movement", road(*positions([]))).state == "good"


def test_what_cannot_be_compared_is_not() -> None:
    assert outcome(moving, drive([])).findings == ()
    late, metres = positions([])
    finding = found(moving, drive([]), "movement", road(late + 900, metres))
    assert (finding.state, finding.value) == ("unknown", None)
