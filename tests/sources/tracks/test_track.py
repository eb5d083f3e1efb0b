"""Positions at given times, and headings from movement."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.errors import TrackError
from evplace.sources.tracks import Track

SECOND = 1_000_000


def straight(seconds: list[float], speed: float = 10.0) -> Track:
    times = np.array(seconds)
    return Track.local(times * SECOND, np.column_stack([np.zeros(len(times)), speed * times]))


def test_positions_are_linear_between_fixes() -> None:
    here = straight([0, 1, 2]).at([500_000, 1_250_000, 2_000_000])
    assert here.northing.tolist() == [5.0, 12.5, 20.0]
    assert here.heading_deg.tolist() == [0.0, 0.0, 0.0]


def test_nothing_is_guessed_beyond_the_ends_or_across_gaps() -> None:
    track = straight([0, 1, 2.5, 3])
    here = track.at(np.array([-1, 0, 1, 1.5, 2.5, 2.75, 3, 3.000001]) * SECOND)
    assert here.known.tolist() == [False, True, True, False, True, True, True, False]
    assert track.at([1_500_000], max_gap_s=2).known.all()


def test_a_jump_of_more_than_a_cell_is_a_gap() -> None:
    assert not straight([0, 1], speed=21).at([500_000]).known.any()
    assert straight([0, 1], speed=21).at([500_000], max_gap_m=30).known.all()


@given(
    st.lists(st.integers(0, 20_000_000), min_size=1, max_size=30, unique=True).map(sorted),
    st.lists(st.integers(-1_000_000, 21_000_000), max_size=30),
)
def test_every_answer_lies_between_its_neighbours(times: list[int], wanted: list[int]) -> None:
    track = Track.local(times, np.column_stack([np.cumsum(np.arange(len(times))), np.zeros(len(times))]))
    here = track.at(wanted)
    for t_us, known, x in zip(wanted, here.known, here.easting, strict=True):
        after = int(np.searchsorted(times, t_us))
        exact = after < len(times) and times[after] == t_us
        inside = 0 < after < len(times) and times[after] - times[after - 1] <= SECOND
        inside &= 0 < after < len(times) and track.easting[after] - track.easting[after - 1] <= 20
        assert known == (exact or inside)
        if known:
            low = track.easting[after if exact else after - 1]
            assert low <= x <= track.easting[after]


def test_headings_come_from_movement_that_is_fast_enough() -> None:
    xy = [[0, 0], [10, 0], [20, 0], [20.1, 0], [20.2, 0]]
    assert Track.local(np.arange(5) * SECOND, xy).heading_deg[:2].tolist() == [90.0, 90.0]
    assert np.isnan(Track.local(np.arange(5) * SECOND, xy).heading_deg[4])


def test_headings_turn_the_short_way_round() -> None:
    track = Track.local([0, SECOND], [[0, 0], [1, 0]], heading_deg=[350, 10])
    assert track.at([500_000]).heading_deg[0] % 360 == pytest.approx(0, abs=1e-9)


def test_wrong_shapes_and_orders_are_refused() -> None:
    with pytest.raises(TrackError, match="shape"):
        Track.local([0, 1], [[0, 0]])
    with pytest.raises(TrackError, match="increase"):
        Track.local([1, 1], [[0, 0], [0, 0]])


def by_the_whole_track(track: Track, t_us: list[int]) -> np.ndarray:
    """The headings of `Track.at`, from the sines and cosines of all fixes."""
    here = track.at(t_us)
    after = np.searchsorted(track.t_us, t_us)
    right = np.clip(after, 0, len(track) - 1)
    left = np.where(track.t_us[right] == t_us, right, np.maximum(after - 1, 0))
    share = (np.array(t_us) - track.t_us[left]) / np.maximum(track.t_us[right] - track.t_us[left], 1)
    turn = np.deg2rad(track.heading_deg)
    east, north = (part[left] + share * (part[right] - part[left]) for part in (np.sin(turn), np.cos(turn)))
    return np.where(here.known, np.rad2deg(np.arctan2(east, north)) % 360, np.nan)


@given(
    st.lists(st.integers(0, 5_000_000), min_size=1, max_size=30, unique=True).map(sorted),
    st.lists(st.integers(0, 5_000_000), min_size=1, max_size=30),
    st.integers(0, 1000),
)
def test_headings_come_of_the_neighbours_alone(times: list[int], wanted: list[int], seed: int) -> None:
    heading = np.random.default_rng(seed).uniform(0, 360, len(times))
    track = Track.local(times, np.zeros((len(times), 2)), heading)
    found, twin = track.at(wanted), by_the_whole_track(track, wanted)
    apart = (found.heading_deg - twin + 180) % 360 - 180
    np.testing.assert_array_equal(np.isnan(apart), ~found.known)
    np.testing.assert_allclose(apart[found.known], 0, atol=1e-6)


def test_one_time_costs_no_more_in_a_long_track(monkeypatch: pytest.MonkeyPatch) -> None:
    track = straight([float(second) for second in range(1000)])
    asked: list[int] = []
    sine = np.sin
    monkeypatch.setattr(np, "sin", lambda values: (asked.append(np.size(values)), sine(values))[1])
    track.at([500_000])
    assert max(asked) == 1
