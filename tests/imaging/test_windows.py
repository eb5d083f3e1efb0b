"""Eq. 4 in integers: left-open, right-closed; empty windows kept; packets change nothing."""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.errors import RecordingError, SettingsError
from evplace.core.events import Events
from evplace.imaging.windows import (
    CountWindows,
    TimeWindows,
    Window,
    WindowSettings,
    open_windows,
    windows_before,
)


def events_at(t_us: list[int]) -> Events:
    return Events.of(t_us, [0] * len(t_us), [0] * len(t_us), [True] * len(t_us), (1, 1))


def cut(windows: TimeWindows | CountWindows, packets: list[Events]) -> list[Window]:
    closed = [window for packet in packets for _, window in windows.push(packet) if window]
    last = windows.finish()
    return closed + ([last] if last else [])


@pytest.mark.parametrize("dt", ["1/60", "1/16", "1/30", "0.05"])
def test_window_number_is_the_ceiling_of_t_rate(dt: str) -> None:
    rate = 1 / Fraction(dt)
    edges = {math.floor(n / rate * 10**6) + shift for n in range(1, 200) for shift in (-1, 0, 1)}
    times = [0, *sorted(edges)]
    closed = cut(TimeWindows(Fraction(dt)), [events_at(times)])
    wanted = [max(1, -((-t * rate.numerator) // (rate.denominator * 10**6))) for t in times]
    counts = np.bincount(wanted)[1:]
    assert [window.n for window in closed] == list(range(1, len(counts) + 1))
    assert [window.events for window in closed] == counts.tolist()


def test_an_event_on_the_edge_belongs_to_the_window_that_ends_there() -> None:
    closed = cut(TimeWindows(Fraction(1, 10)), [events_at([0, 100_000, 100_001])])
    assert closed == [Window(1, 100_000, 2), Window(2, 200_000, 1)]


def test_empty_windows_are_kept() -> None:
    closed = cut(TimeWindows(Fraction(1, 1000)), [events_at([5, 3_500])])
    assert [window.events for window in closed] == [1, 0, 0, 1]
    assert [window.t_us for window in closed] == [1005, 2005, 3005, 4005]


def test_windows_count_from_the_first_event_or_from_a_given_origin() -> None:
    late = [events_at([1_600_000_000_000_000, 1_600_000_000_000_001])]
    assert cut(TimeWindows(Fraction(1, 1000)), late) == [Window(1, 1_600_000_000_001_000, 2)]
    assert cut(TimeWindows(Fraction(1, 1000), origin_us=0), [events_at([2_500])])[-1] == Window(3, 3_000, 1)


@pytest.mark.parametrize("together", [True, False])
def test_a_leap_of_the_clock_is_told(together: bool) -> None:
    t_us = [0, 40, 1_587_452_582_000_000]
    packets = [events_at(t_us)] if together else [events_at([t]) for t in t_us]
    with pytest.raises(RecordingError, match=r"1587452582\.000 s no event comes"):
        cut(TimeWindows(Fraction(1, 30)), packets)


def test_a_long_pause_is_no_leap() -> None:
    assert len(cut(TimeWindows(Fraction(1, 10)), [events_at([0, 9_000_000_000])])) == 90_000


times = st.lists(st.integers(0, 5_000), max_size=60).map(sorted)


@given(times, st.lists(st.integers(0, 60), max_size=8), st.sampled_from([0, 1, 7]))
def test_the_size_of_packets_changes_nothing(t_us: list[int], cuts: list[int], count: int) -> None:
    settings = WindowSettings(dt="1/3000", count=count)
    whole = events_at(t_us)
    edges = [0, *sorted(min(c, len(t_us)) for c in cuts), len(t_us)]
    parts = [whole[a:b] for a, b in itertools.pairwise(edges)]
    assert cut(open_windows(settings), [whole]) == cut(open_windows(settings), parts)


def test_windows_by_count() -> None:
    assert cut(CountWindows(2), [events_at([1, 2, 3, 4, 9])]) == [
        Window(1, 2, 2),
        Window(2, 4, 2),
        Window(3, 9, 1),
    ]


def test_no_events_no_windows() -> None:
    assert cut(TimeWindows(Fraction(1, 30)), [events_at([])]) == []
    assert cut(CountWindows(3), []) == []


@pytest.mark.parametrize(
    "settings", [{"dt": "0"}, {"dt": "soon"}, {"dt": "1/0"}, {"dt": "-1"}, {"count": -1}]
)
def test_windows_that_cannot_be_are_refused(settings: dict[str, object]) -> None:
    with pytest.raises(SettingsError):
        WindowSettings(**settings)  # type: ignore[arg-type]


@given(
    st.lists(st.integers(0, 200), max_size=40).map(sorted),
    st.lists(st.integers(-50, 300), max_size=10),
    st.sampled_from([WindowSettings("1/50000"), WindowSettings("1/10"), WindowSettings(count=3)]),
)
def test_windows_before_given_times(times: list[int], ends: list[int], settings: WindowSettings) -> None:
    cut = windows_before(np.array(ends, np.int64), events_at(times), settings)
    for end, window in zip(ends, cut, strict=True):
        before = [t_us for t_us in times if t_us <= end]
        if settings.count:
            assert window.t_us.tolist() == before[-settings.count :]
        else:
            assert window.t_us.tolist() == [t for t in before if t > end - settings.seconds * 1_000_000]
