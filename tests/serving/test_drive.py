"""A drive that is served says what `localize` says of the same events, and what happens when none come."""

from __future__ import annotations

import dataclasses
import io
import itertools
import json
import os
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from made_sources import Made, block

from conftest import HANG_S, Drive, make_drive
from evplace.core.events import Events
from evplace.localizer import Localizer, Match
from evplace.placemap import PlaceMap
from evplace.serving._drive import Drive as LiveDrive
from evplace.serving._feed import Feed
from evplace.serving._report import Describer, Report
from evplace.sources.live import ANEW, Live, open_live
from evplace.sources.live.stdin import Piped
from evplace.sources.readers import Block
from evplace.sources.writers import write_recording

SIZE = (80, 60)


class Driven:
    """A drive and its reports."""

    def __init__(
        self, place_map: PlaceMap, source: Live, matcher: str = "best", hold: int = 4_000_000
    ) -> None:
        self.reports: list[Report] = []
        self.feed = Feed(source, SIZE, hold=hold)
        self.drive = LiveDrive(Localizer(place_map, matcher), self.feed, self.reports.append)
        self.drive.start()

    @property
    def matches(self) -> list[Match]:
        return [report.match for report in self.reports]

    def until(self, done: Callable[[], Any]) -> None:
        until_s = time.monotonic() + HANG_S
        while not done():
            assert time.monotonic() < until_s, "it never came true"
            time.sleep(0.002)

    def end(self) -> list[Match]:
        assert self.drive.ended.wait(HANG_S)
        return self.matches


class Simulated:
    """A drive without threads, whose clock is moved by what is sent: 10 ms of a sensor take 10 ms."""

    def __init__(self, place_map: PlaceMap, patch: pytest.MonkeyPatch, matcher: str | None = None) -> None:
        self.now_s = 1000.0
        clock = SimpleNamespace(monotonic=lambda: self.now_s, time=lambda: self.now_s)
        for module in ("_feed", "_drive"):
            patch.setattr(f"evplace.serving.{module}.time", clock)
        self.reports: list[Report] = []
        self.feed = Feed(Made(), SIZE)
        self.drive = LiveDrive(Localizer(place_map, matcher), self.feed, self.reports.append)

    def send(self, events: Events) -> None:
        edges = np.arange(int(events.t_us[0]), int(events.t_us[-1]) + 10_000, 10_000)
        for start, stop in itertools.pairwise(np.searchsorted(events.t_us, edges).tolist()):
            self.now_s += 0.01
            self._come(block(events[start:stop]))

    def wait(self, seconds: float, says: bool = True) -> None:
        """The source has nothing, and says so or does not."""
        for _ in range(round(seconds / 0.05)):
            self.now_s += 0.05
            self._come(*([None] if says else []))

    def _come(self, *items: Block | None) -> None:
        for item in items:
            self.feed._push(item)
        while (packet := self.feed.take(0.0)) is not None:
            self.drive._push(packet)
        self.drive._tick()

    def states(self, since_s: float) -> list[tuple[float, str]]:
        """Seconds after a time, and the state that was told then."""
        later = [report for report in self.reports if report.host_s > since_s]
        return [(report.host_s - since_s, report.match.state) for report in later]


def offline(place_map: PlaceMap, events: Events, matcher: str | None = "best") -> list[Match]:
    where = Localizer(place_map, matcher)
    return [*where.push(events), *where.finish()]


def moved(events: Events, by_us: int) -> Events:
    return Events(events.t_us + by_us, events.x, events.y, events.p, SIZE)


def same(found: list[Match], wanted: list[Match]) -> None:
    """To the last bit; NaN is NaN."""
    assert list(map(repr, found)) == list(map(repr, wanted))


def replayed(events: Events, folder: Path) -> Live:
    write_recording(folder / "drive.raw", [events], SIZE)
    return open_live(str(folder / "drive.raw"), speed=0)


def paced(events: Events, folder: Path) -> Live:
    write_recording(folder / "drive.raw", [events], SIZE)
    return open_live(str(folder / "drive.raw"), speed=4.0)


def piped(events: Events, folder: Path) -> Live:
    write_recording(folder / "drive.raw", [events], SIZE)
    reading, writing = os.pipe()

    def write() -> None:
        with io.FileIO(writing, "w") as pipe:
            data = (folder / "drive.raw").read_bytes()
            while data:
                data = data[pipe.write(data) :]

    threading.Thread(target=write, daemon=True).start()
    return Piped(reading, None, SIZE, 0.0)


@pytest.mark.parametrize("opened", [replayed, paced, piped])
@pytest.mark.parametrize("matcher", ["best", "local", "seqslam", "bayes"])
def test_live_is_offline(
    opened: Callable[[Events, Path], Live],
    matcher: str,
    image_map: PlaceMap,
    night_drive: Drive,
    tmp_path: Path,
) -> None:
    driven = Driven(image_map, opened(night_drive.events, tmp_path), matcher)
    same(driven.end(), offline(image_map, night_drive.events, matcher))


def test_silence_is_said_and_what_comes_after_it_is_found(image_map: PlaceMap, night_drive: Drive) -> None:
    """No events for a while; then the drive goes on where it would have been."""
    events = night_drive.events
    source = Made()
    driven = Driven(image_map, source)
    source.put(block(events[:15_000]))
    driven.until(lambda: any(match.state == "no-events" for match in driven.matches))
    assert driven.reports[-1].silent_s > 0
    later = moved(events, 30_000_000)
    source.put(*(block(later[start : start + 2000]) for start in range(15_000, len(later), 2000)))
    source.end()
    found = driven.end()
    assert found[-1].state == "localised"
    assert [match.t_us for match in found] == sorted(match.t_us for match in found)


def test_a_camera_that_goes_is_missed_within_half_a_second_and_found_within_two(
    image_map: PlaceMap, night_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its writer is killed, and started again with a clock that begins anew."""
    driven = Simulated(image_map, monkeypatch)
    events = night_drive.events
    half = len(events) // 2
    driven.send(events[:half])
    assert driven.reports[-1].match.state == "localised"
    gone_s = driven.now_s
    driven.wait(5.0)
    said = driven.states(gone_s)
    assert min(after_s for after_s, state in said if state == "no-events") < 0.5
    assert {state for after_s, state in said if after_s >= 0.5} == {"no-events"}
    back_s = driven.now_s
    driven.send(moved(events[half:], -int(events.t_us[half])))
    assert min(after_s for after_s, state in driven.states(back_s) if state == "localised") < 2.0
    last = offline(image_map, events)[-2]
    assert driven.reports[-1].match.position is not None
    assert last.position is not None
    assert abs(driven.reports[-1].match.position[0] - last.position[0]) <= 20


def test_ten_seconds_without_an_event_are_the_gap_that_they_are_in_a_file(
    image_map: PlaceMap, night_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Windows are closed by time, each of them, and the drive goes on as it does offline."""
    events = night_drive.events
    half = len(events) // 2
    late = moved(events[half:], 10_000_000)
    driven = Simulated(image_map, monkeypatch)
    driven.send(events[:half])
    driven.wait(10.0)
    found = [report.match for report in driven.reports]
    assert 280 <= sum(match.state == "no-events" for match in found) <= 300
    driven.send(late)
    found = [report.match for report in driven.reports]
    same(found, offline(image_map, Events.concatenate([events[:half], late]), None)[: len(found)])
    assert found[-1].state == "localised"


def test_a_source_that_has_not_said_that_nothing_came_is_late_not_silent(
    image_map: PlaceMap, night_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a busy machine a replay stands still for a while: no window is closed before its events came."""
    events = night_drive.events
    driven = Simulated(image_map, monkeypatch)
    half = len(events) // 2
    driven.send(events[:half])
    driven.wait(3.0, says=False)
    driven.send(events[half:])
    found = [report.match for report in driven.reports]
    same(found, offline(image_map, events, None)[: len(found)])
    assert driven.feed.counters().skipped == 0


def test_a_clock_that_goes_back_costs_no_more_than_a_window(
    image_map: PlaceMap, night_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is set back by five seconds while the camera drives on: nothing is refused, the place is held."""
    events = night_drive.events
    half = len(events) // 2
    first = moved(events[:half], 10_000_000)
    driven = Simulated(image_map, monkeypatch)
    driven.send(first)
    set_back_s = driven.now_s
    driven.send(moved(events[half:], 5_000_000))
    assert {state for _, state in driven.states(set_back_s)} <= {"localised", "standing"}
    assert driven.feed.counters().rejected == {}
    assert len(driven.reports) >= len(offline(image_map, events)) - 2


def test_events_that_come_after_their_window_was_closed_are_counted(
    image_map: PlaceMap, night_drive: Drive
) -> None:
    events = night_drive.events
    source = Made()
    driven = Driven(image_map, source)
    source.put(block(events[:15_000]))
    driven.until(lambda: any(match.state == "no-events" for match in driven.matches))
    source.put(block(events[15_000:15_010]))  # of the time right after those
    driven.until(lambda: driven.feed.counters().skipped == 10)
    driven.drive.close(1.0)


@pytest.mark.parametrize("said", [True, False])
def test_a_camera_that_is_started_again_is_found_again(
    said: bool, image_map: PlaceMap, night_drive: Drive
) -> None:
    """Its clock begins anew, whether the source says so or not; so do the windows, and the drive goes on."""
    events = night_drive.events
    half = len(events) // 2
    first, second = moved(events[:half], 10_000_000), events[half:]
    again = moved(second, -int(second.t_us[0]))
    source = Made(pace=0)
    source.put(block(first), None, *([ANEW] if said else []))
    source.put(*(block(again[start : start + 2000]) for start in range(0, len(again), 2000)))
    source.end()
    found = Driven(image_map, source).end()
    wanted = [*offline(image_map, first), *offline(image_map, again)]
    same(found, wanted)


def test_too_many_events_are_dropped_counted_and_the_drive_goes_on(
    image_map: PlaceMap, night_drive: Drive, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A localizer that is held up: the oldest go; once it goes on, it says the newest place."""
    events = night_drive.events
    begun, go_on = threading.Event(), threading.Event()
    push = Localizer.push

    def slow(self: Localizer, packet: Events) -> Any:
        begun.set()
        assert go_on.wait(HANG_S)
        return push(self, packet)

    monkeypatch.setattr(Localizer, "push", slow)
    source = Made()
    driven = Driven(image_map, source, hold=10_000)
    source.put(block(events[:5000]))
    assert begun.wait(HANG_S)
    source.put(*(block(events[start : start + 1000]) for start in range(5000, len(events), 1000)))
    source.end()
    driven.until(lambda: driven.feed.ended)
    go_on.set()
    found = driven.end()
    counters = driven.feed.counters()
    assert counters.skipped + 10_000 + 5000 >= len(events) > counters.skipped > 0
    assert found[-1].item == offline(image_map, events)[-1].item


def test_a_fault_of_localising_ends_the_drive_with_one_line(image_map: PlaceMap) -> None:
    other = make_drive(windows=3).events
    source = Made(size=(40, 30))
    source.put(block(other), None)
    driven = Driven.__new__(Driven)
    driven.reports = []
    driven.feed = Feed(source, (40, 30))
    driven.drive = LiveDrive(Localizer(image_map, "best"), driven.feed, driven.reports.append)
    driven.drive.start()
    driven.end()
    assert driven.drive.fault is not None
    assert "sensor of 80x60 pixels, this recording has 40x30" in driven.drive.fault


def test_reports_carry_both_clocks_and_the_counters(
    image_map: PlaceMap, night_drive: Drive, tmp_path: Path
) -> None:

    before_s = time.time()
    driven = Driven(image_map, replayed(night_drive.events, tmp_path))
    driven.end()
    report = driven.reports[10]
    assert before_s <= report.host_s <= time.time()
    describe = Describer(image_map, "ab12")
    values = json.loads(describe.text(describe.values(report)))
    assert values["t_us"] == report.match.t_us
    assert values["map_sha256"] == "ab12"
    assert (values["item"], values["place"]) == (report.match.item, report.match.place)
    assert {"backlog", "skipped", "overflows", "recorded", "latency_ms", "rate", "epsg"} <= set(values)
    assert values["probability"] is None
    assert values["last"]["place"] == report.match.place
    gone = dataclasses.replace(report, match=Match(7, -1, -1, None, float("nan"), "no-events"))
    assert describe.values(gone)["last"] == values["last"]
    assert np.isfinite(values["latency_ms"])
