"""Gaps: found where they were cut, and not where events are few."""

from __future__ import annotations

import numpy as np
import pytest
from examined import at_times, found, merged, noise

from evplace.doctor import gaps


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
