"""Flicker: a lamp of known frequency in a known region."""

from __future__ import annotations

import numpy as np
import pytest
from examined import SIZE, found, merged, noise, outcome

from evplace.core.events import Events
from evplace.doctor import Map, flicker


def lamp(frequency_hz: float, seconds: float = 2.0, seed: int = 0) -> Events:
    """A lamp in the region of columns 32 to 47, rows 16 to 31: two events brighter, two darker a period."""
    rng = np.random.default_rng(seed)
    n = int(seconds * frequency_hz)
    phases = np.tile([0.05, 0.15, 0.55, 0.65], n) + np.repeat(np.arange(n), 4)
    t_us = ((phases + rng.normal(0, 0.03, 4 * n)) * 1e6 / frequency_hz).clip(0).astype(np.int64)
    x, y = rng.integers(32, 48, 4 * n), rng.integers(16, 32, 4 * n)
    order, p = np.argsort(t_us, kind="stable"), np.tile([True, True, False, False], n)
    return Events.of(t_us[order], x[order], y[order], p[order], SIZE)


@pytest.mark.parametrize("frequency_hz", [50, 60, 100, 120])
def test_a_lamp_is_found_in_its_region_at_its_frequency(frequency_hz: int) -> None:
    events = merged(noise(4000, 2), lamp(frequency_hz + 0.1))
    finding = found(flicker, events, "flicker")
    assert finding.state in ("look", "bad")
    assert finding.advice == f"`flicker_hz={frequency_hz}`"
    assert f"{frequency_hz} Hz in 1 of 12 regions" in finding.sentence
    (drawing,) = outcome(flicker, events).drawings
    assert isinstance(drawing, Map)
    assert np.unravel_index(np.nanargmax(drawing.values), drawing.values.shape) == (1, 2)


@pytest.mark.parametrize("rate_hz", [800, 4000, 40_000])
@pytest.mark.parametrize("seed", range(3))
def test_noise_does_not_flicker(rate_hz: float, seed: int) -> None:
    assert found(flicker, noise(rate_hz, 2, seed), "flicker").state in ("good", "unknown")


def test_a_lamp_off_the_mains_is_none() -> None:
    assert found(flicker, merged(noise(4000, 2), lamp(77)), "flicker").state == "good"


def test_a_short_recording_does_not_tell() -> None:
    assert found(flicker, noise(100_000, 0.2), "flicker").state == "unknown"
