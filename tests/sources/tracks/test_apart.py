"""A track and a recording of different times: the cause, and the flag that mends it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from evplace.cli._output import in_flags
from evplace.sources.tracks import Track, open_track
from evplace.sources.tracks._apart import apart, on_day_of
from made_logs import START_S, Log, gga_body, rmc_log, sentence, written

FIRST_US, LAST_US = START_S * 1_000_000 + 2_000_000, START_S * 1_000_000 + 190_000_000
WEEKS_S = 1024 * 7 * 86_400


def shifted(seconds: float) -> Track:
    """The track of a drive whose log's clock is ahead by so much."""
    t_us = np.round((Log().t_s + seconds) * 1e6).astype(np.int64)
    return Track.local(t_us, np.column_stack([10.0 * np.arange(200), np.zeros(200)]))


@pytest.mark.parametrize(
    ("ahead_s", "cause"),
    [
        (36_000, "36,000 s, a time zone of 10 h"),
        (-18_000, "18,000 s, a time zone of 5 h"),
        (19_800, "19,800 s, a time zone of 5.5 h"),
        (20_700, "20,700 s, a time zone of 5.75 h"),
        (-12 * 3600, "43,200 s, a time zone of 12 h"),
        (36_004, "a time zone of 10 h"),
        (-WEEKS_S, "1024 weeks"),
        (WEEKS_S, "1024 weeks"),
        (-2 * WEEKS_S, "2048 weeks"),
        (-315_964_800, "counts from 1980"),
    ],
)
def test_the_cause_and_the_flag_are_named(ahead_s: int, cause: str) -> None:
    track = shifted(ahead_s)
    told = apart(track, FIRST_US, LAST_US)
    assert cause in told.sentence
    found = re.search(r"`offset_us=(-?\d+)`", told.advice)
    assert found is not None
    assert f"--track-offset {int(found[1]) // 1_000_000}" in in_flags(told.advice)
    moved = track.t_us + int(found[1])
    assert np.abs(moved - np.round(Log().t_s * 1e6)).max() <= 5_000_000
    assert "\n" not in str(told)


@pytest.mark.parametrize("sign", [1, -1])
def test_leap_seconds_of_a_short_recording(sign: int) -> None:
    t_us = START_S * 1_000_000 + np.arange(10) * 1_000_000 + sign * 18_000_000
    track = Track.local(t_us, np.zeros((10, 2)))
    told = apart(track, START_S * 1_000_000, START_S * 1_000_000 + 9_000_000)
    assert "18 s, the leap seconds" in told.sentence
    assert f"--track-offset {-sign * 18}" in in_flags(told.advice)


@pytest.mark.parametrize(
    ("unit", "factor", "true"), [("us", 1e-3, "ms"), ("us", 1e-6, "s"), ("s", 1e3, "ms")]
)
def test_a_log_of_another_unit(unit: str, factor: float, true: str) -> None:
    t_us = np.round(Log().t_s * 1e6 * factor).astype(np.int64)
    keep = np.concatenate([[True], np.diff(t_us) > 0])
    found = Track.local(t_us[keep], np.zeros((keep.sum(), 2)))
    track = Track(**{name: getattr(found, name) for name in Track.__slots__} | {"unit": unit})
    told = apart(track, FIRST_US, LAST_US)
    assert "another unit of time" in told.sentence
    assert f"--track-set time_unit={true}" in in_flags(told.advice)


@pytest.mark.parametrize("factor", [1e-3, 1e3, 1e-6])
def test_a_recording_of_another_unit(factor: float) -> None:
    told = apart(shifted(0), round(FIRST_US * factor), round(LAST_US * factor))
    assert "the images' times differ by a factor of 1,000" in told.sentence
    assert "`time_unit`" in told.advice


@pytest.mark.parametrize("first_us", [0, 33_333, 5_000_000])
def test_a_recording_that_counts_from_its_own_start(first_us: int) -> None:
    told = apart(shifted(0), first_us, first_us + 190_000_000)
    assert "the images do not count from 1970" in told.sentence
    seconds = float(re.search(r"--track-offset (-[\d.]+)", in_flags(told.advice))[1])  # type: ignore[index]
    assert START_S * 1e6 + seconds * 1e6 == pytest.approx(first_us)


@pytest.mark.parametrize("seconds", [700.0, 5_000.0, 86_400 * 30.0])
def test_another_drive_is_no_time_zone(seconds: float) -> None:
    told = apart(shifted(-seconds), FIRST_US, LAST_US)
    assert "apart" in told.sentence
    assert "recording's own track" in told.advice


@pytest.mark.parametrize("day_s", [0, 86_400, -40 * 86_400])
def test_a_log_without_dates_takes_that_of_the_images(tmp_path: Path, day_s: int) -> None:
    text = "\n".join(sentence(gga_body(t + day_s, lat, lon)) for t, lat, lon, _, _ in Log().rows())
    bare = open_track(written(tmp_path, text))
    assert not bare.dated
    track = on_day_of(bare, FIRST_US + day_s * 1_000_000)
    assert track.t_us[0] == (START_S + day_s) * 1_000_000
    assert track.dated
    assert "was taken from the images" in track.notes[-1]
    date = str(np.datetime64(START_S + day_s, "s").astype("datetime64[D]"))
    assert open_track(tmp_path / "log.txt", date=date).t_us.tolist() == track.t_us.tolist()
    assert on_day_of(bare, 1_000_000) is bare
    assert on_day_of(track, 0) is track


@pytest.mark.parametrize("before_s", [10, 100, 190])
def test_a_log_without_dates_over_midnight(tmp_path: Path, before_s: int) -> None:
    """It begins before midnight, the images at some time in it."""
    midnight_s = (START_S // 86_400 + 1) * 86_400
    log = Log()
    log.t_s = midnight_s - before_s + np.arange(200.0)
    text = "\n".join(sentence(gga_body(t, lat, lon)) for t, lat, lon, _, _ in log.rows())
    bare = open_track(written(tmp_path, text))
    for first_s in (log.t_s[0] - 100, log.t_s[0], midnight_s - 1, midnight_s + 5, log.t_s[-1] + 100):
        assert on_day_of(bare, int(first_s * 1e6)).t_us[0] == round(log.t_s[0] * 1e6)


def test_a_dated_log_refuses_a_date(tmp_path: Path) -> None:
    from evplace.core.errors import SettingsError

    path = written(tmp_path, rmc_log(Log()))
    with pytest.raises(SettingsError, match="has dates of its own"):
        open_track(path, date="2020-04-21")
    text = "\n".join(sentence(gga_body(t, lat, lon)) for t, lat, lon, _, _ in Log().rows())
    for bad in ("21.04.2020", "2020-13-01", "today"):
        with pytest.raises(SettingsError, match="write it as 2020-04-21"):
            open_track(written(tmp_path, text), date=bad)
