"""Gaps: found where they were cut, and not where events are few."""

from __future__ import annotations

import numpy as np
import pytest
from examined import at_times, found, merged, noise, outcome
from numpy.typing import NDArray

from evplace.doctor import gaps, standing


def test_a_gap_is_measured_where_it_is() -> None:
    t_us = np.arange(0, 10_000_000, 100)
    events = at_times(t_us[(t_us < 3_000_000) | (t_us >= 3_400_000)])
    finding = found(gaps, events, "gaps")
    assert (finding.state, finding.value) == ("look", pytest.approx(0.4, abs=2e-4))
    assert "1 time," in finding.sentence
    assert "at 3.000 s" in finding.sentence


def test_many_gaps_are_bad() -> None:
    t_us = np.arange(0, 10_000_000, 100)
    finding = found(gaps, at_times(t_us[t_us % 1_000_000 < 900_000]), "gaps")
    assert (finding.state, finding.value) == ("bad", pytest.approx(0.9, abs=2e-3))


@pytest.mark.parametrize("rate_hz", [5, 100, 2000, 100_000])
def test_random_events_have_no_gaps(rate_hz: float) -> None:
    assert found(gaps, noise(rate_hz, 20 if rate_hz < 10_000 else 2), "gaps").state == "good"


def test_a_sensor_that_falls_quiet_has_no_gap() -> None:
    """It stands: the rate falls to that of noise, and silences of noise are long."""
    events = merged(noise(20_000, 2), noise(100, 20), at_times(20_000_000 + np.arange(0, 2_000_000, 50)))
    assert found(gaps, events, "gaps").state == "good"


def test_flashes_in_the_dark_are_no_gaps() -> None:
    t_us = (np.arange(500)[:, None] * 10_000 + np.arange(200)).ravel()
    assert found(gaps, at_times(t_us), "gaps").state == "good"


def stop_and_go() -> NDArray[np.int64]:
    """10,000 events a second, without noise: it slows down over 4 s, stands for 15 s and speeds up again."""
    t_s = np.arange(0, 60, 1e-4)
    speed = np.interp(t_s, [20, 24, 39, 43], [1, 0, 0, 1])
    kept = np.random.default_rng(0).random(len(t_s)) < speed
    return np.round(t_s[kept] * 1e6).astype(np.int64)


@pytest.mark.parametrize("packet", [1000, 100_000])
def test_a_car_that_stands_before_a_clean_sensor_is_no_gap(packet: int) -> None:
    events = at_times(stop_and_go())
    (finding,) = outcome(gaps, events, packet=packet).findings
    assert finding.state == "good"
    quiet = found(standing, events, "quiet stretches")
    assert quiet.value == pytest.approx(100 * 15 / 60, abs=4)


@pytest.mark.parametrize("packet", [1, 7, 100_000])
def test_packets_change_no_gap(packet: int) -> None:
    t_us = np.arange(0, 1_000_000, 500)
    (finding,) = outcome(gaps, at_times(t_us[t_us // 50_000 % 4 != 1]), packet=packet).findings
    assert (finding.state, finding.value) == ("bad", pytest.approx(5 * 0.05, abs=5e-3))


@pytest.mark.parametrize("before", [[0], list(range(0, 3_000_000, 100))])
def test_a_leap_of_the_clock_is_no_gap(before: list[int]) -> None:
    t_us = np.array([*before, *range(1_587_452_582_000_000, 1_587_452_583_000_000, 100)])
    finding = found(gaps, at_times(t_us), "gaps")
    assert finding.state == "bad"
    assert "clock leaps ahead" in finding.sentence
    assert "cable" not in finding.advice
