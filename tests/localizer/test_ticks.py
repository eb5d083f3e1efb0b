"""Windows are closed by time as well: where the clock is right, that changes no answer."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conftest import Drive
from evplace.core.errors import RecordingError
from evplace.core.events import Events
from evplace.imaging.windows import WindowSettings, open_windows
from evplace.localizer import Localizer, Match
from evplace.placemap import PlaceMap


def gap(events: Events, start_us: int, stop_us: int) -> Events:
    keep = (events.t_us < start_us) | (events.t_us > stop_us)
    return Events(events.t_us[keep], events.x[keep], events.y[keep], events.p[keep], events.size)


@settings(max_examples=15)
@given(
    cuts=st.lists(st.integers(0, 40_000), max_size=8),
    shares=st.lists(st.floats(0, 1), min_size=10, max_size=10),
)
def test_ticking_at_any_moment_changes_no_answer(
    cuts: list[int], shares: list[float], image_map: PlaceMap, night_drive: Drive
) -> None:
    """At each cut the clock is anywhere between the last event and the next."""
    events = gap(night_drive.events, 500_000, 900_000)
    where = Localizer(image_map, "best")
    wanted = [*where.push(events), *where.finish()]
    where.reset()
    found: list[Match] = []
    edges = [0, *sorted(min(cut, len(events)) for cut in cuts), len(events)]
    for start, stop, share in zip(edges, edges[1:], shares, strict=False):
        found += where.push(events[start:stop])
        if 0 < stop < len(events):
            before, after = int(events.t_us[stop - 1]), int(events.t_us[stop])
            found += where.tick(before + int(share * max(after - before - 1, 0)))
    found += where.finish()
    assert found == wanted


def test_a_silent_camera_is_said_window_by_window(image_map: PlaceMap, night_drive: Drive) -> None:
    where = Localizer(image_map, "best")
    before = list(where.push(night_drive.events[:20_000]))
    now_us = int(night_drive.events.t_us[19_999]) + 1_000_000
    after = list(where.tick(now_us))
    assert after[0].state == "localised"  # the window that the silence has ended
    assert {match.state for match in after[1:]} == {"no-events"}
    times = [match.t_us for match in [*before, *after]]
    assert len(after) in (30, 31)
    assert times == sorted(times)
    assert now_us - 34_000 < times[-1] <= now_us
    assert list(where.tick(now_us)) == []


def test_nothing_ticks_before_the_first_event_and_by_count(image_map: PlaceMap) -> None:
    assert list(Localizer(image_map, "best").tick(10**12)) == []
    windows = open_windows(WindowSettings(count=10))
    list(windows.push(Events.of([0], [0], [0], [True], (4, 4))))
    assert list(windows.tick(10**9)) == []


def test_a_clock_that_leaps_is_refused(image_map: PlaceMap, night_drive: Drive) -> None:
    where = Localizer(image_map, "best")
    list(where.push(night_drive.events[:100]))
    with pytest.raises(RecordingError, match="the clock leaps"):
        list(where.tick(10**12))


def test_a_new_clock_goes_on_with_the_drive(image_map: PlaceMap, night_drive: Drive) -> None:
    """A camera that is started again counts from 0; its windows are as if the drive began there."""
    events = night_drive.events
    half = len(events) // 2
    second = events[half:]
    again = Events(second.t_us - second.t_us[0], second.x, second.y, second.p, events.size)
    where = Localizer(image_map, "best")
    list(where.push(events[:half]))
    assert len(list(where.new_clock())) == 1
    found = [*where.push(again), *where.finish()]
    alone = Localizer(image_map, "best")
    assert found == [*alone.push(again), *alone.finish()]
