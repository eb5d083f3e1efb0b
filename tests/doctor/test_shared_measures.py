"""What several examinations share, against plain twins: silences, speeds, fits, windows and regions."""

from __future__ import annotations

import itertools
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from examined import SIZE, noise, outcome, road
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.core.events import Events
from evplace.doctor import Subject, empty
from evplace.doctor import film as film_check
from evplace.doctor._outcome import counted
from evplace.doctor._silences import EDGE_US, LEAP_US, SHORTEST_US, Silences
from evplace.doctor._speed import BASE_US, REACH_US, speed_at, speeds, turning_at
from evplace.doctor._subject import BIN_US
from evplace.doctor.film import _motion, _repeated, _sizes, _times
from evplace.doctor.flicker import _of_regions
from evplace.doctor.offset import DRAWS, Fit, _draws, _sums
from evplace.imaging.windows import WindowSettings
from evplace.sources.tracks import Track

times = st.lists(st.integers(0, 400_000), min_size=2, max_size=60).map(sorted)
Floats = NDArray[np.float64]


def plain_silences(t_us: list[int]) -> list[tuple[int, int, int, int]]:
    """Start, end, events within EDGE_US up to the start, and from the end on."""
    return [
        (a, b, sum(a - EDGE_US <= t <= a for t in t_us), sum(b <= t <= b + EDGE_US for t in t_us))
        for a, b in itertools.pairwise(t_us)
        if b - a >= SHORTEST_US
    ]


@given(times, st.integers(1, 9))
def test_silences_and_the_rates_at_their_edges_do_not_depend_on_packets(t_us: list[int], packet: int) -> None:
    silences = Silences()
    for start in range(0, len(t_us), packet):
        silences.push(np.array(t_us[start : start + packet], np.int64))
    found = zip(silences._starts, silences._ends, silences._before, silences._after, strict=True)
    assert list(found) == plain_silences(t_us)


def gaps_of(t_us: NDArray[np.int64]) -> tuple[list[int], list[int]]:
    silences = Silences()
    silences.push(t_us)
    counts = np.bincount((t_us - t_us[0]) // BIN_US)
    starts, ends = silences.gaps(int(t_us[0]), BIN_US, counts)
    return starts.tolist(), ends.tolist()


def test_a_gap_needs_enough_missed_events_and_sudden_edges() -> None:
    busy = np.arange(0, 2_000_000, 1000)
    cut = busy[(busy <= 900_000) | (busy >= 1_000_000)]
    assert gaps_of(cut) == ([900_000], [1_000_000])
    assert gaps_of(busy[(busy <= 900_000) | (busy >= 930_000)]) == ([], []), "30 events are not missed"
    dying = np.concatenate([cut[cut < 850_000], [900_000], cut[cut >= 1_000_000]])
    assert gaps_of(dying) == ([], []), "the events died away"
    leap = np.concatenate([[0, 1, 2], np.array([3, 4]) + LEAP_US])
    assert gaps_of(leap) == ([2], [LEAP_US + 3])
    assert gaps_of(np.array([5])) == ([], [])


@given(st.floats(0.1, 30.0), st.integers(5, 40), st.sampled_from([0.1, 0.2, 0.5, 1.0]))
def test_an_even_drive_has_its_speed_everywhere(mps: float, seconds: int, step_s: float) -> None:
    t_s = np.arange(0, seconds, step_s)
    track = road(t_s, mps * t_s)
    at_us, found = speeds(track)
    np.testing.assert_allclose(found, mps, rtol=1e-6)
    np.testing.assert_allclose(np.diff(at_us), step_s * 1e6)
    assert at_us[0] == BASE_US // 2
    inside = np.linspace(at_us[0], at_us[-1], 7)
    np.testing.assert_allclose(speed_at(track, inside), mps, rtol=1e-6)
    assert np.isnan(speed_at(track, np.array([at_us[0] - 1.0, at_us[-1] + 1.0]))).all()


def test_speed_and_turning_are_unknown_in_gaps() -> None:
    t_s = np.concatenate([np.arange(0, 10, 0.5), np.arange(20, 30, 0.5)])
    track = road(t_s, 5 * t_s)
    asked = np.array([5.0, 12.0, 15.0, 18.0, 25.0]) * 1e6
    assert np.isfinite(speed_at(track, asked)).tolist() == [True, False, False, False, True]
    assert REACH_US < 10_000_000
    assert speed_at(road(np.array([0.0, 1.5]), np.array([0.0, 9.0])), asked).tolist() == pytest.approx(
        [np.nan] * 5, nan_ok=True
    )


@given(st.floats(5.0, 100.0), st.floats(2.5, 10.0))
def test_a_circle_turns_by_speed_over_radius(radius: float, mps: float) -> None:
    rate = min(mps / radius, 1.0)
    t_s = np.arange(0, 20, 0.05)
    angle = rate * t_s
    xy = (mps / rate) * np.column_stack([np.cos(angle), np.sin(angle)])
    track = Track.local(np.round(t_s * 1e6).astype(np.int64), xy)
    found = turning_at(track, np.array([5e6, 10e6]))
    np.testing.assert_allclose(found, rate, rtol=0.02)
    assert turning_at(road(t_s, 9 * t_s), np.array([5e6])) == pytest.approx(0, abs=1e-6)
    assert turning_at(road(t_s, 0.1 * t_s), np.array([5e6])).tolist() == [0.0]
    assert turning_at(track, np.array([-5e6, 90e6])).tolist() == [0.0, 0.0]


@given(st.integers(0, 10_000))
def test_sums_of_blocks_give_numpys_correlation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=80)
    y = 0.5 * x + rng.normal(size=80)
    y[rng.random(80) < 0.2] = np.nan
    fit = Fit(np.array([-0.1, 0.0, 0.1]), np.stack([_sums(x, y, 8)] * 3, axis=1))
    weights = np.array([[1.0] * 8, [1, 0, 2, 0, 1, 1, 0, 3]])
    known = np.isfinite(y)
    for found, counts in zip(fit.correlation(weights), weights, strict=True):
        often = np.repeat(counts, 10).astype(int)
        here = np.repeat(np.arange(80), often)
        here = here[known[here]]
        assert found[1] == pytest.approx(np.corrcoef(x[here], y[here])[0, 1])


@given(st.floats(-0.9, 0.9))
def test_the_best_shift_lies_at_the_parabolas_top(top: float) -> None:
    class Known(Fit):
        def correlation(self, weights: Floats) -> Floats:
            return np.asarray(0.8 - 0.01 * (np.arange(-5.0, 6.0) - top) ** 2)[None]

    fit = Known(np.arange(-5, 6) * BIN_US / 1e6, np.ones((4, 11, 6)))
    assert fit.best(fit.every)[0] == pytest.approx(top * BIN_US / 1e6)


def test_blocks_are_drawn_with_replacement() -> None:
    draws = _draws(12)
    assert draws.shape == (DRAWS, 12)
    np.testing.assert_array_equal(draws.sum(1), 12)
    assert draws.mean() == 1
    assert 0.8 < draws.var() < 1.1
    np.testing.assert_array_equal(draws, _draws(12))


@given(st.integers(1, 30), st.integers(1, 30), st.integers(1, 9))
def test_regions_share_out_every_event(height: int, width: int, region: int) -> None:
    counts = np.arange(height * width).reshape(height, width)
    regions = _of_regions(counts, region)
    assert regions.shape == (-(-height // region), -(-width // region))
    assert regions.sum() == counts.sum()
    assert (
        regions[-1, -1] == counts[(height - 1) // region * region :, (width - 1) // region * region :].sum()
    )


@given(times, st.sampled_from(["1/30", "1/7", "0.004"]), st.integers(1, 9))
def test_empty_windows_in_any_packets(t_us: list[int], dt: str, packet: int) -> None:
    n = len(t_us)
    events = Events.of(t_us, [0] * n, [0] * n, [True] * n, SIZE)
    length = Fraction(dt) * 1_000_000
    numbers = {max(1, -((t_us[0] - t) // length)) for t in t_us}
    (finding,) = outcome(empty, events, dt=dt, packet=packet).findings
    assert finding.value == pytest.approx(100 * (1 - len(numbers) / max(numbers)))


def test_activity_of_a_film_is_laid_on_an_even_grid() -> None:
    subject = Subject(Path("made"), "frames", SIZE, WindowSettings())
    subject.motion = [(100_000 * k, 2.0) for k in range(5)] + [(1_000_000, 8.0)]
    for t_us in (0, 1_000_000):
        subject.see_frame(t_us)
    t_us, smooth = subject.smooth_activity()
    np.testing.assert_array_equal(t_us, np.arange(10) * 100_000)
    raw = np.interp(t_us, [100_000 * k for k in range(5)] + [1_000_000], [2.0] * 5 + [8.0])
    np.testing.assert_allclose(smooth, [raw[max(k - 5, 0) : k + 6].mean() for k in range(10)])
    assert subject.span_s == 1.0


def test_smooth_activity_is_unknown_about_a_gap() -> None:
    events = noise(20_000, 10)
    gap = (events.t_us > 4_000_000) & (events.t_us < 6_000_000)
    subject = Subject(Path("made"), "events", SIZE, WindowSettings())
    subject.see_events(events[~gap])
    t_us, smooth = subject.smooth_activity()
    unknown = t_us[np.isnan(smooth)]
    assert unknown.min() == pytest.approx(3_500_000, abs=BIN_US)
    assert unknown.max() == pytest.approx(6_500_000, abs=BIN_US)
    np.testing.assert_allclose(smooth[np.isfinite(smooth)], 20_000, rtol=0.1)


def test_frame_findings_step_at_their_limits() -> None:
    even = np.full(200, 10_000)
    late = even.copy()
    late[3] = 16_000
    very = np.where(np.arange(200) % 50 == 0, 20_000, 10_000)
    assert [_times(steps, 100.0, True).state for steps in (even, late, very)] == ["good", "look", "bad"]
    assert _times(even, 100.0, False).state == "look"
    assert [_times(even, fps, True).state for fps in (0.01, 2e4)] == ["bad", "bad"]
    assert [_repeated(same, 100).state for same in (0, 1, 19, 20)] == ["good", "look", "look", "bad"]
    assert [_sizes(odd, 5).state for odd in (0, 1)] == ["good", "bad"]
    moved = [np.where(np.arange(1000) < fast, 1.5, 0.2) for fast in (0, 50, 200)]
    assert [_motion(pixels, 30.0).state for pixels in moved] == ["good", "look", "bad"]
    assert "45 frames a second" in _motion(moved[2], 30.0).advice


def test_a_film_is_measured_from_frame_to_frame() -> None:
    subject = Subject(Path("made"), "frames", SIZE, WindowSettings())
    check = film_check.Check(subject)
    ramp = np.tile(np.arange(64, dtype=np.float64) ** 2, (48, 1))
    for k, moved in enumerate((0.0, 0.5, 0.5, 1.0)):
        check.see((20_000 * k, (np.sqrt(ramp) + moved) ** 2))
    check.see((80_000, np.zeros((8, 8))))
    assert [t_us for t_us, _ in subject.motion] == [10_000, 30_000, 50_000]
    np.testing.assert_allclose([pixels for _, pixels in subject.motion], [25, 0, 25], rtol=0.01)
    findings = {finding.name: finding for finding in check.outcome().findings}
    assert findings["frames"].state == "bad"
    assert findings["repeated frames"].value == pytest.approx(100 / 3)
    assert findings["frame times"].value == pytest.approx(50)


def test_numbers_go_with_their_words() -> None:
    assert [counted(n, "fix", "fixes") for n in (0, 1, 1000)] == ["0 fixes", "1 fix", "1,000 fixes"]
