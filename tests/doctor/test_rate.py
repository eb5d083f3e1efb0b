"""The event rate and the signs."""

from __future__ import annotations

import numpy as np
import pytest
from examined import SIZE, found, noise, outcome
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.events import Events
from evplace.doctor import rate
from evplace.doctor._subject import BIN_US, Rates, mean_around, stretches


@given(st.lists(st.integers(0, 3_000_000), min_size=1), st.integers(1, 20))
def test_rates_against_numpy(times: list[int], packet: int) -> None:
    t_us = np.sort(np.array(times, np.int64)) - 1_000_000
    rates = Rates()
    for start in range(0, len(t_us), packet):
        rates.push(t_us[start : start + packet])
    middles, counts = rates.laid_out()
    assert np.array_equal(counts, np.bincount((t_us - t_us[0]) // BIN_US))
    assert middles[0] == t_us[0] + BIN_US // 2


def test_a_clock_that_leaps_a_century_costs_no_memory() -> None:
    rates = Rates()
    rates.push(np.array([0, 1, 3_000_000_000_000_000]))
    assert rates.laid_out()[1].tolist() == [2]


@given(st.lists(st.booleans(), max_size=60), st.integers(0, 9))
def test_means_and_stretches_against_plain_loops(values: list[bool], reach: int) -> None:
    array = np.array(values, np.bool_)
    plain = [np.mean(array[max(0, n - reach) : n + reach + 1]) for n in range(len(array))]
    np.testing.assert_allclose(mean_around(array, reach), plain)
    again = np.zeros(len(array), np.bool_)
    for start, stop in stretches(array):
        again[start:stop] = True
        assert start == 0 or not array[start - 1]
    assert np.array_equal(again, array)


def test_the_rate_is_events_over_seconds() -> None:
    finding = found(rate, noise(50_000, 3), "event rate")
    assert (finding.state, finding.value) == ("good", pytest.approx(50_000, rel=0.02))


def test_the_rate_as_a_curve() -> None:
    (curve,) = outcome(rate, noise(50_000, 3)).drawings
    assert len(curve.x) == len(curve.y) == 29
    assert np.allclose(curve.y, 0.05, rtol=0.1)


def test_few_events_are_worth_a_look() -> None:
    assert found(rate, noise(20, 10), "event rate").state == "look"


def test_no_events_and_one_time_are_bad() -> None:
    assert found(rate, Events.empty(SIZE), "event rate").state == "bad"
    finding = found(rate, Events.of([7, 7], [0, 1], [0, 1], [0, 1], SIZE), "event rate")
    assert (finding.state, finding.value) == ("bad", None)


@pytest.mark.parametrize(("share", "state"), [(0.5, "good"), (0.2, "good"), (1.0, "look"), (0.0, "look")])
def test_a_missing_sign_is_told(share: float, state: str) -> None:
    events = noise(5000, 2)
    signs = np.random.default_rng(1).random(len(events)) < share
    assert found(rate, Events.of(events.t_us, events.x, events.y, signs, SIZE), "signs").state == state
