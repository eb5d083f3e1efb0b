"""Tracks from the command line: what a log says of itself reaches the user; the flags that mend it work."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evplace.cli import main
from evplace.core.events import Events
from evplace.sources.writers import write_recording
from made_logs import LATITUDE, START_S, Log, csv_log, gga_body, gpx_log, rmc_log, sentence, written

Capture = pytest.CaptureFixture[str]
LOG = Log(12)


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Ten seconds of few events from 2020-04-21 07:03:02 UTC on."""
    rng = np.random.default_rng(0)
    t_us = START_S * 1_000_000 + np.sort(rng.integers(0, 10_000_000, 20_000))
    events = Events.of(
        t_us, rng.integers(0, 64, 20_000), rng.integers(0, 48, 20_000), t_us % 2 == 0, (64, 48)
    )
    write_recording(tmp_path / "drive.npz", [events], events.size)
    return tmp_path / "drive.npz"


def images(capsys: Capture, recording: Path, *flags: object, code: int = 0) -> tuple[int, list[str]]:
    """Images with a position, and what was said."""
    capsys.readouterr()
    out = ["-o", str(recording.parent / "out"), "--overwrite", "--dt", "1/5", "--json"]
    assert main(["images", str(recording), *out, *map(str, flags)]) == code
    heard = capsys.readouterr()
    assert "Traceback" not in heard.err
    placed = json.loads(heard.out)["with_position"] if heard.out else 0
    return placed, heard.err.splitlines()


def test_a_good_log_is_used_without_a_word(tmp_path: Path, recording: Path, capsys: Capture) -> None:
    assert images(capsys, recording, "--track", written(tmp_path, rmc_log(LOG))) == (50, [])


@pytest.mark.parametrize("hours", [10, -5, 5.5])
def test_the_flag_that_is_named_mends_a_time_zone(
    tmp_path: Path, recording: Path, capsys: Capture, hours: float
) -> None:
    log = Log(12)
    log.t_s += hours * 3600
    track = ("--track", written(tmp_path, rmc_log(log)))
    _, (told,) = images(capsys, recording, *track, code=2)
    assert f"a time zone of {abs(hours):g} h" in told
    offset = told.rpartition("--track-offset ")[2].rstrip(")")
    assert float(offset) == -hours * 3600
    assert images(capsys, recording, *track, "--track-offset", offset) == (50, [])


@pytest.mark.parametrize("later_days", [0, 1, -400])
def test_a_log_without_dates(tmp_path: Path, recording: Path, capsys: Capture, later_days: int) -> None:
    rows = [sentence(gga_body(t + later_days * 86_400, lat, lon)) for t, lat, lon, _, _ in LOG.rows()]
    track = ("--track", written(tmp_path, "\n".join(rows)))
    placed, said = images(capsys, recording, *track)
    assert placed == 50
    assert said == [
        "evplace: the log has no dates: 2020-04-21 was taken from the images (--track-date says otherwise)"
    ]
    assert images(capsys, recording, *track, "--track-date", "2020-04-21") == (50, [])
    assert "do not overlap" in images(capsys, recording, *track, "--track-date", "2020-04-22", code=2)[1][0]


def test_a_cut_log_is_used_and_exits_with_3(tmp_path: Path, recording: Path, capsys: Capture) -> None:
    whole = gpx_log(LOG)
    path = written(tmp_path, whole[: int(0.6 * len(whole))])
    placed, (told,) = images(capsys, recording, "--track", path, code=3)
    assert 20 <= placed < 40
    assert told.startswith(f"evplace: {path} breaks off: ")
    main(["images", str(recording), "-o", str(tmp_path / "made"), "--dt", "1/5"])
    capsys.readouterr()
    assert main(["doctor", str(recording), "--track", str(path)]) == 3
    assert "The log is damaged" in capsys.readouterr().out


def test_what_was_left_out_is_told(tmp_path: Path, recording: Path, capsys: Capture) -> None:
    log = Log(12)
    log.latitude[5] = -LATITUDE
    track = ("--track", written(tmp_path, csv_log(log)))
    placed, (told,) = images(capsys, recording, *track)
    assert placed == 40
    assert told.startswith("evplace: left out of the track: 1 faster than 70 m/s (first line 7: 15874525")
    assert main(["doctor", str(recording), "--track", str(track[1])]) == 0
    assert "1 faster than 70 m/s" in " ".join(capsys.readouterr().out.split())


def test_a_clock_that_was_set_and_a_speed_that_cannot_be(
    tmp_path: Path, recording: Path, capsys: Capture
) -> None:
    log = Log(40)
    log.t_s[20:] += 5
    track = ("--track", written(tmp_path, rmc_log(log)))
    assert "set by +5 s" in images(capsys, recording, *track, code=2)[1][0]
    assert images(capsys, recording, *track, "--track-keep", "before")[0] == 50
    slow = ("--track", written(tmp_path, rmc_log(LOG)), "--track-max-speed", 5)
    assert "no vehicle goes faster than 5 m/s" in images(capsys, recording, *slow, code=2)[1][0]
    rows = "\n".join(["timestamp,latitude,longitude", *(f"{n},-27.5,{152 + n / 1e4}" for n in range(12))])
    told = images(capsys, recording, "--track", written(tmp_path, rows), code=2)[1][0]
    assert "--track-set time_unit=s" in told


@pytest.mark.parametrize(
    "flag", [("--track-date", "2020-04-21"), ("--track-max-speed", "50"), ("--track-keep", "after")]
)
def test_flags_of_a_track_need_one(recording: Path, capsys: Capture, flag: tuple[str, str]) -> None:
    assert "need a --track" in images(capsys, recording, *flag, code=2)[1][0]


@pytest.mark.parametrize("log", [rmc_log, gpx_log])
def test_a_log_that_is_taken_for_a_recording_is_named(
    tmp_path: Path, capsys: Capture, log: Callable[[Log], str]
) -> None:
    file = written(tmp_path, log(LOG))
    for words in (["info", str(file)], ["images", str(file), "-o", f"{tmp_path}/out"]):
        assert main(words) == 2
        (told,) = capsys.readouterr().err.splitlines()
        assert "is a log of positions" in told
        assert "give it as the --track of one" in told
