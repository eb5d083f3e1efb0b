"""Faults of a receiver that place images wrongly without a word: what is left must be true."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import TrackError
from evplace.sources.tracks import Track, open_track
from made_logs import (
    DEGREES,
    LATITUDE,
    LONGITUDE,
    MPS,
    START_S,
    Log,
    csv_log,
    gga_log,
    gpx_log,
    rmc_log,
    written,
)  # fmt: skip

Fault = Callable[[Log], None]


def aside(metres: float, first: int, last: int) -> Fault:
    """Positions that lie aside for a while, as of a reflected signal."""

    def make(log: Log) -> None:
        log.longitude[first:last] += metres * DEGREES / np.cos(np.deg2rad(LATITUDE))

    return make


def other_hemisphere(first: int, last: int) -> Fault:
    def make(log: Log) -> None:
        log.latitude[first:last] *= -1

    return make


def other_side_of_greenwich(first: int, last: int) -> Fault:
    def make(log: Log) -> None:
        log.longitude[first:last] *= -1

    return make


def frozen(first: int, last: int) -> Fault:
    """The receiver repeats one position; its speed goes on."""

    def make(log: Log) -> None:
        log.latitude[first:last] = log.latitude[first]

    return make


def frozen_with_noise(first: int, last: int) -> Fault:
    """The receiver stands, and its position wanders by half a metre."""

    def make(log: Log) -> None:
        noise = np.random.default_rng(3).normal(0, 0.5, (2, last - first)) * DEGREES
        log.latitude[first:last] = log.latitude[first] + noise[0]
        log.longitude[first:last] = log.longitude[first] + noise[1]

    return make


def drift(metres: float, first: int, last: int) -> Fault:
    """Positions that move away to one side, ever further, and are right again after the last."""

    def make(log: Log) -> None:
        aside_m = np.linspace(0, metres, last - first)
        log.longitude[first:last] += aside_m * DEGREES / np.cos(np.deg2rad(LATITUDE))

    return make


def time_of_one(at: int, seconds: float) -> Fault:
    def make(log: Log) -> None:
        log.t_s[at] += seconds

    return make


def clock_for_a_while(first: int, last: int, seconds: float) -> Fault:
    def make(log: Log) -> None:
        log.t_s[first:last] += seconds

    return make


FAULTS = {
    "ten fixes 550 m off": aside(550, 50, 60),
    "ten fixes 60 m off": aside(60, 50, 60),
    "thirty fixes 2 km off": aside(-2000, 100, 130),
    "the first ten 550 m off": aside(550, 0, 10),
    "the last ten 550 m off": aside(550, 190, 200),
    "one fix 300 m off": aside(300, 77, 78),
    "five of the other hemisphere": other_hemisphere(50, 55),
    "the first fix of the other hemisphere": other_hemisphere(0, 1),
    "three west of Greenwich": other_side_of_greenwich(80, 83),
    "frozen for 30 s": frozen(50, 80),
    "frozen for 5 s": frozen(120, 125),
    "frozen twice": lambda log: (frozen(20, 40)(log), frozen(90, 130)(log)),  # type: ignore[func-returns-value]
    "frozen for 30 s with noise": frozen_with_noise(50, 80),
    "ten fixes 35 m off": aside(35, 50, 60),
    "a drift to 100 m in 20 s": drift(100, 50, 70),
    "a drift to 100 m in 40 s": drift(100, 100, 140),
    "a drift to 100 m in 40 s that ends near the end": drift(-100, 140, 180),
    "a drift to 100 m in 40 s until the end": drift(100, 160, 200),
    "a drift to 100 m in 60 s until the end": drift(100, 140, 200),
    "one time 40 s ahead": time_of_one(100, 40),
    "one time 40 s behind": time_of_one(100, -40),
    "one time 5 s ahead": time_of_one(60, 5),
    "the last time 40 s ahead": time_of_one(199, 40),
    "a clock 5 s off for 20 s": clock_for_a_while(70, 90, 5),
}
BY_OWN_SPEED = (
    "frozen for 5 s", "a drift to 100 m in 20 s", "a drift to 100 m in 40 s",
    "a drift to 100 m in 40 s until the end", "a drift to 100 m in 60 s until the end",
)  # fmt: skip
"""These leave no trace in a log that has no speed of its own, or one that may have two causes."""
LOGS = {"rmc": rmc_log, "csv": csv_log, "gpx": gpx_log}


def placed(track: Track, log: Log) -> tuple[np.ndarray, np.ndarray]:
    """Metres by which each image (10 a second) is placed wrong, NaN without a position; which have one."""
    t_s = np.arange(0, log.seconds, 0.1)
    here = track.at(np.round((START_S + t_s) * 1e6).astype(np.int64))
    north = (here.latitude - LATITUDE) / DEGREES - MPS * t_s
    east = (here.longitude - LONGITUDE) / DEGREES * np.cos(np.deg2rad(LATITUDE))
    return np.hypot(north, east), here.known


@pytest.mark.parametrize("kind", LOGS)
def test_a_good_log_is_whole(tmp_path: Path, kind: str) -> None:
    track = open_track(written(tmp_path, LOGS[kind](Log())))
    assert (len(track), track.dropped) == (200, {})
    wrong, known = placed(track, Log())
    assert known.sum() == 1991
    assert np.nanmax(wrong) < 3


@pytest.mark.parametrize(
    ("kind", "fault"),
    [(kind, fault) for fault in FAULTS for kind in LOGS if kind == "rmc" or fault not in BY_OWN_SPEED],
)
def test_no_image_is_placed_wrong_and_the_reason_is_told(tmp_path: Path, kind: str, fault: str) -> None:
    log = Log()
    FAULTS[fault](log)
    track = open_track(written(tmp_path, LOGS[kind](log)))
    wrong, known = placed(track, log)
    assert np.nanmax(wrong) < 25
    assert known.mean() > 0.6
    assert sum(track.dropped.values()) == log.seconds - len(track) > 0
    assert any("left out of the track" in note and "first " in note for note in track.notes)


@pytest.mark.parametrize("kind", LOGS)
@pytest.mark.parametrize(("at", "seconds"), [(70, 5), (150, 5), (20, -5), (100, 40), (100, -3)])
def test_a_clock_that_was_set_is_asked_about(tmp_path: Path, kind: str, at: int, seconds: int) -> None:
    log = Log()
    log.t_s[at:] += seconds
    path = written(tmp_path, LOGS[kind](log))
    with pytest.raises(TrackError, match=rf"set by \{seconds:+d} s at .*`keep=before`") as caught:
        open_track(path)
    assert "`keep=before`" in str(caught.value)
    wrong, known = placed(open_track(path, keep="before"), log)
    assert np.nanmax(wrong) < 3
    assert known.sum() == 10 * (at - 1) + 1
    later = open_track(path, keep="after", offset_us=-seconds * 1_000_000)
    wrong, known = placed(later, log)
    assert np.nanmax(wrong) < 3
    assert known.sum() == 10 * (199 - at) + 1


@pytest.mark.parametrize("kind", LOGS)
@pytest.mark.parametrize(("metres", "at"), [(550, 100), (-2000, 60), (100, 140)])
def test_positions_that_leap_for_good_are_asked_about(
    tmp_path: Path, kind: str, metres: float, at: int
) -> None:
    log = Log()
    aside(metres, at, 200)(log)
    path = written(tmp_path, LOGS[kind](log))
    with pytest.raises(TrackError, match=r"leaps by [\d,]+ m at .*, and not back.*`keep=after`"):
        open_track(path)
    track = open_track(path, keep="before")
    wrong, known = placed(track, log)
    assert np.nanmax(wrong) < 3
    assert known.sum() == 10 * (at - 1) + 1
    assert track.dropped == {"of the other side of a leap": 200 - at}
    assert len(open_track(path, keep="after")) == 200 - at


@pytest.mark.parametrize("kind", ["csv", "gpx"])
@pytest.mark.parametrize(("first", "last"), [(50, 70), (100, 140)])
def test_a_leap_back_from_a_drift_is_asked_about(tmp_path: Path, kind: str, first: int, last: int) -> None:
    """Without a speed of the log's own, it may as well be a leap into what is wrong."""
    log = Log()
    drift(100, first, last)(log)
    with pytest.raises(TrackError, match=r"leaps by 10\d m at .*, and not back"):
        open_track(written(tmp_path, LOGS[kind](log)))


def test_a_receiver_that_finds_its_way_after_a_gap_is_left_out_until_then(tmp_path: Path) -> None:
    log = Log()
    aside(-175, 100, 103)(log)
    rows = csv_log(log).splitlines(keepends=True)
    track = open_track(written(tmp_path, "".join(rows[:80] + rows[101:])))
    assert len(track) == 200 - 21 - 3
    wrong, _ = placed(track, log)
    assert np.nanmax(wrong) < 3


def test_a_drift_of_the_whole_log_is_told(tmp_path: Path) -> None:
    """Its positions may be wrong, or its course."""
    log = Log()
    drift(300, 0, 200)(log)
    track = open_track(written(tmp_path, rmc_log(log)))
    assert len(track) == 200
    assert any("keep drifting away" in note and "not checked" in note for note in track.notes)


def test_a_track_says_what_it_was_held_against(tmp_path: Path) -> None:
    assert open_track(written(tmp_path, rmc_log(Log()))).held_against == "speed and course"
    assert open_track(written(tmp_path, csv_log(Log()))).held_against == ""
    rows = csv_log(Log()).splitlines()
    with_speed = "\n".join([f"{rows[0]},speed", *(f"{row},10" for row in rows[1:])])
    assert open_track(written(tmp_path, with_speed)).held_against == "speed"


@pytest.mark.parametrize("longitude", [147.1, 152.9])
def test_courses_are_those_of_the_true_north(tmp_path: Path, longitude: float) -> None:
    """At the edges of a zone its north lies up to 3 degrees off: no drift of the positions."""
    log = Log(600)
    log.latitude -= 40
    log.latitude[:] = log.latitude[0] + 3 * (log.latitude - log.latitude[0])
    log.mps[:] *= 3
    log.longitude += longitude - LONGITUDE
    track = open_track(written(tmp_path, rmc_log(log)))
    assert (len(track), track.notes) == (600, ())


def winding(mps: float, hertz: int, seconds: int = 60) -> Log:
    """A drive at speeds around `mps`, through bends, as a receiver with a noise of a metre sees it."""
    log, rng = Log(seconds * hertz), np.random.default_rng(0)
    since = np.arange(seconds * hertz) / hertz
    log.t_s, log.mps = START_S + since, mps * (1 + 0.2 * np.sin(since / 9))
    course = 0.5 * np.sin(since / 17)
    noise = np.cumsum(rng.normal(0, 0.3 / np.sqrt(hertz), (2, len(since))), axis=1)
    north = np.cumsum(log.mps * np.cos(course)) / hertz + noise[0]
    east = np.cumsum(log.mps * np.sin(course)) / hertz + noise[1]
    log.latitude = LATITUDE + north * DEGREES
    log.longitude = LONGITUDE + east * DEGREES / np.cos(np.deg2rad(LATITUDE))
    log.course = np.rad2deg(course) % 360
    return log


@pytest.mark.parametrize(("kind", "hertz"), [("rmc", 1), ("rmc", 5), ("gga", 1), ("csv", 5), ("gpx", 1)])
def test_clocks_set_by_a_little_or_much_at_any_speed(tmp_path: Path, kind: str, hertz: int) -> None:
    """Where an image would be placed over 25 m wrong, on one side, the clock is asked about."""
    write, asked = {**LOGS, "gga": gga_log}[kind], 0
    for mps, seconds in product((5, 12, 20, 28), (-10, -3, -2, -1, -0.5, 0.5, 1, 2, 5)):
        log = winding(mps, hertz)
        true = open_track(written(tmp_path, write(log)))
        images_us = true.t_us[0] + np.arange(0, 59_000_000, 100_000)
        log.t_s[len(log.t_s) // 3 :] += seconds
        path = written(tmp_path, write(log))
        try:
            track = open_track(path)
        except TrackError as error:
            asked += bool(re.search(r"clock was set by [-+]\d+ s .*`keep=before`.*`keep=both`", str(error)))
            track = open_track(path, keep="before")
        wrong = np.hypot(*(track.at(images_us).xy - true.at(images_us).xy).T)
        assert np.nanmax(wrong) < 25, (mps, seconds)
    assert asked >= 20


def test_a_clock_that_was_set_is_taken_as_it_is_on_demand(tmp_path: Path) -> None:
    log = winding(28, 1)
    log.t_s[40:] += 1
    assert len(open_track(written(tmp_path, csv_log(log)), keep="both")) == 60


@pytest.mark.parametrize("kind", LOGS)
def test_a_log_that_pauses_while_the_vehicle_stands_is_no_clock_that_was_set(
    tmp_path: Path, kind: str
) -> None:
    """It slows down at 3 m/s each second, stands for 20 s, and drives on; the log has none of that time."""
    log = Log(100)
    log.mps[46:55] = [9, 6, 3, 1, 1, 3, 6, 9, 10]
    log.latitude = LATITUDE + np.cumsum(log.mps) * DEGREES
    log.t_s[50:] += 20
    assert len(open_track(written(tmp_path, LOGS[kind](log)))) == 100


def test_the_example_is_the_first_wrong_line(tmp_path: Path) -> None:
    log = Log()
    aside(550, 50, 60)(log)
    track = open_track(written(tmp_path, rmc_log(log)))
    assert track.dropped == {"faster than 70 m/s": 10}
    line = rmc_log(log).splitlines()[50]
    assert track.notes == (f"left out of the track: 10 faster than 70 m/s (first line 51: {line})",)


@pytest.mark.parametrize(("unit", "per_s"), [("us", 1e3), ("us", 1), ("ns", 1e3), ("ns", 1e6), ("ms", 1)])
def test_speeds_that_cannot_be_name_the_unit(tmp_path: Path, unit: str, per_s: float) -> None:
    """Times of a log that is read in a unit 1000 times too small, or more."""
    rows = [f"{(t - START_S) * per_s:.0f},{lat:.7f},{lon}" for t, lat, lon, _, _ in Log(60).rows()]
    path = written(tmp_path, "\n".join(["timestamp,latitude,longitude", *rows]))
    true = {1: "s", 1e3: "ms", 1e6: "us"}[per_s]
    cause = rf"m/s: its times were taken in {unit}, in {true} it would be 9\.96 m/s: "
    told = cause + rf"`open_track\(time_unit={true}\)`"
    with pytest.raises(TrackError, match=told):
        open_track(path, time_unit=unit)
    assert len(open_track(path, time_unit=true)) == 60


@pytest.mark.parametrize("mps", [71.0, 90.0, 250.0])
def test_a_faster_vehicle_is_allowed_on_demand(tmp_path: Path, mps: float) -> None:
    log = Log(60)
    log.latitude = LATITUDE + (log.t_s - START_S) * mps * DEGREES
    path = written(tmp_path, csv_log(log))
    if mps > 80:
        with pytest.raises(TrackError, match="max_speed_mps"):
            open_track(path)
    assert len(open_track(path, max_speed_mps=300.0)) == 60


@pytest.mark.parametrize("factor", [3600 / 1852, 3.6, 2.2369])
def test_the_unit_of_the_logs_own_speed_is_found(tmp_path: Path, factor: float) -> None:
    """Knots, km/h and miles an hour: the freeze shows by the speed alone."""
    log = Log()
    frozen(150, 200)(log)
    rows = [f"{t * 1e6:.0f},{lat:.8f},{lon},{mps * factor:.3f}" for t, lat, lon, mps, _ in log.rows()]
    track = open_track(written(tmp_path, "\n".join(["timestamp,latitude,longitude,speed", *rows])))
    assert track.dropped == {"repeated while moving": 49}


@pytest.mark.parametrize("factor", [3600 / 1852, 3.6, 2.2369])
def test_the_log_goes_no_faster_than_it_says(tmp_path: Path, factor: float) -> None:
    """A jump aside that the fastest speed allows, but not the log's own."""
    log = Log()
    aside(60, 50, 60)(log)
    rows = [f"{t * 1e6:.0f},{lat:.8f},{lon:.8f},{mps * factor:.3f}" for t, lat, lon, mps, _ in log.rows()]
    track = open_track(written(tmp_path, "\n".join(["timestamp,latitude,longitude,speed", *rows])))
    assert track.dropped == {"against the log's own speed": 10}


@pytest.mark.parametrize("speed", [0.0, 900.0])
def test_speeds_that_do_not_fit_are_not_used(tmp_path: Path, speed: float) -> None:
    log = Log()
    log.mps[:] = speed
    track = open_track(written(tmp_path, rmc_log(log)))
    assert len(track) == 200
    assert any("own speeds do not fit" in note for note in track.notes) == (speed > 0)


def test_a_vehicle_that_stands_loses_no_fix(tmp_path: Path) -> None:
    log = Log()
    way = np.concatenate([np.arange(80), np.full(40, 79.0), np.arange(80, 160)])
    log.latitude = LATITUDE + MPS * way * DEGREES
    log.mps = np.where(np.diff(way, append=way[-1] + 1) > 0, MPS, 0.0)
    for kind, make in LOGS.items():
        assert len(open_track(written(tmp_path, make(log), kind))) == 200


def by_every_pair(log: Log, max_mps: float = 70.0) -> int:
    """The size of the largest set of fixes in which each can be reached from the one before: all pairs."""
    t_s, north = log.t_s, (log.latitude - LATITUDE) / DEGREES
    best = np.ones(len(t_s), int)
    for j in range(len(t_s)):
        for i in range(j):
            if t_s[j] > t_s[i] and abs(north[j] - north[i]) <= max_mps * (t_s[j] - t_s[i]) + 10:
                best[j] = max(best[j], best[i] + 1)
    return int(best.max())


@pytest.mark.parametrize("seed", range(6))
def test_as_many_fixes_as_can_be_are_kept(tmp_path: Path, seed: int) -> None:
    """Fixes too far apart in time to say anything of the movement: only the fastest speed decides."""
    rng = np.random.default_rng(seed)
    log = Log(60)
    log.t_s = START_S + 10.0 * np.arange(60)
    wrong = rng.random(60) < 0.3
    log.latitude = (
        LATITUDE + np.where(wrong, rng.uniform(-20_000, 20_000, 60), 100.0 * np.arange(60)) * DEGREES
    )
    track = open_track(written(tmp_path, csv_log(log)))
    assert len(track) == by_every_pair(log)
