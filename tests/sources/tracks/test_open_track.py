"""Logs -> Track, on real logs and on small ones made here."""

from __future__ import annotations

import contextlib
import math
from functools import reduce
from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import SettingsError, TrackError
from evplace.sources.tracks import open_track
from evplace.sources.tracks.csv import PRESETS

DAY_US = 86_400_000_000


def sentence(body: str) -> str:
    return f"${body}*{reduce(lambda a, b: a ^ b, body.encode()):02X}\r\n"


def rmc(clock: str, status: str = "A", lat: str = "5540.0000", date: str = "041112") -> str:
    return sentence(f"GPRMC,{clock},{status},{lat},N,01231.2858,E,10.0,86.57,{date},,,A")


def gga(clock: str, quality: int = 1, lat: str = "5540.0000") -> str:
    return sentence(f"GPGGA,{clock},{lat},N,01231.2858,E,{quality},10,0.8,36.1,M,41.5,M,,0000")


def write(folder: Path, text: str, name: str = "log.txt") -> Path:
    path = folder / name
    path.write_bytes(text.encode())
    return path


def test_the_walk_has_603_fixes_in_zone_33(data: Path) -> None:
    track = open_track(data / "gps/amod_walk.nmea")
    assert len(track) == 603
    assert (track.zone, track.northern, track.dropped) == (33, True, {})
    assert (track.t_us[-1] - track.t_us[0]) / 60e6 == pytest.approx(16.41, abs=0.01)
    assert np.ptp(track.easting) < 2000


def test_the_nordland_logs_have_their_known_faults(data: Path) -> None:
    spring = open_track(data / "gps/nordland_spring.csv", preset="nordland")
    with pytest.raises(TrackError, match="set by -2 s at line 20521"):
        open_track(data / "gps/nordland_summer.csv", preset="nordland")
    summer = open_track(data / "gps/nordland_summer.csv", preset="nordland", keep="both")
    left_out = {"duplicate time": 324, "faster than 70 m/s": 1, "against the movement around": 3}
    assert (len(spring) + 4, spring.dropped) == (32371, left_out)
    left_out = {
        "broken row": 1,
        "duplicate time": 35,
        "faster than 70 m/s": 2,
        "against the movement around": 16,
    }
    assert (len(summer) + 18, summer.dropped) == (33938, left_out)
    assert np.diff(summer.t_us).max() == 2348_000_000
    length_km = np.hypot(*np.diff(spring.xy, axis=0).T).sum() / 1000
    assert length_km == pytest.approx(728, abs=10)
    jump = int(np.argmax(np.diff(summer.t_us)))
    inside = summer.at(summer.t_us[jump] + np.array([0, 1_000_000, 1_000_000_000]), max_gap_m=100)
    assert inside.known.tolist() == [True, False, False]


def test_every_gpx_file_is_a_track_or_one_clear_line(data: Path) -> None:
    outcomes = {}
    for path in sorted((data / "gps/gpx").iterdir()):
        try:
            outcomes[path.name] = len(open_track(path))
        except TrackError as error:
            outcomes[path.name] = -str(error).count("\n")
    assert len(outcomes) == 10
    assert min(outcomes.values()) == 0
    assert outcomes["cerknicko-jezero-with-elevations-zero.gpx"] == 295  # one step is of 92 m/s
    assert outcomes["track-with-empty-segment.gpx"] == 9
    assert sum(count > 0 for count in outcomes.values()) == 6


def test_a_csv_without_positions_says_what_it_has(data: Path) -> None:
    with pytest.raises(TrackError, match="it has Image name, index"):
        open_track(data / "gps/robotcar_sun_timestamps.csv")


def test_rmc_gives_unix_times_position_and_course(tmp_path: Path) -> None:
    track = open_track(write(tmp_path, rmc("134730.361") + rmc("134731.361", lat="5540.0010")))
    assert track.t_us.tolist() == [1352036850361000, 1352036851361000]
    assert track.latitude[0] == pytest.approx(55 + 40 / 60)
    assert track.heading_deg.tolist() == pytest.approx([86.57, 86.57])


def test_sentences_without_a_fix_or_damaged_are_counted(tmp_path: Path) -> None:
    damaged = rmc("100001.00").replace("N", "S", 1)
    text = rmc("100000.00") + damaged + rmc("100002.00", status="V") + gga("100003.00", 0) + rmc("100003.00")
    track = open_track(write(tmp_path, text + rmc("100004.00")[:40]))
    assert len(track) == 1
    assert track.dropped == {"damaged sentence": 2, "no fix": 2}


def test_gga_alone_goes_on_after_midnight(tmp_path: Path) -> None:
    track = open_track(write(tmp_path, gga("235959.50") + gga("000000.50") + gga("000001.00", 0)))
    assert np.diff(track.t_us).tolist() == [1_000_000]
    assert track.t_us[0] < DAY_US < track.t_us[1]
    assert track.dropped == {"no fix": 1}


def test_robotcar_columns_are_the_default(tmp_path: Path) -> None:
    text = "timestamp,latitude,longitude,northing,easting,utm_zone\n1000001,51.76,-1.26,5735500,620000,30U\n"
    track = open_track(write(tmp_path, text), offset_us=-1)
    assert (track.t_us.tolist(), track.zone) == ([1_000_000], 30)


@pytest.mark.parametrize(("zone", "northern"), [("30U", True), ("56J", False)])
def test_utm_columns_serve_where_there_are_no_degrees(tmp_path: Path, zone: str, northern: bool) -> None:
    text = f"timestamp,northing,easting,utm_zone\n1,5735500,620000,{zone}\n2,bad,620000,{zone}\n3,1,2,QQ\n"
    track = open_track(write(tmp_path, text))
    assert track.xy[0] == pytest.approx([620000, 5735500], abs=0.01)
    assert (track.northern, track.dropped) == (northern, {"broken row": 2})


@pytest.mark.parametrize(
    ("unit", "text"), [("s", "1.5"), ("ms", "1500"), ("us", "1.5e6"), ("ns", "1500000000")]
)
def test_times_in_any_unit(tmp_path: Path, unit: str, text: str) -> None:
    path = write(tmp_path, f"when;lat;lon\r\n{text};51;-1\r\n")
    track = open_track(path, time="when", time_unit=unit, latitude="lat", longitude="lon")
    assert track.t_us.tolist() == [1_500_000]


def test_headings_of_radians(tmp_path: Path) -> None:
    path = write(tmp_path, f"timestamp,latitude,longitude,yaw\n1,51,-1,{-math.pi / 2}\n2,51,-1,\n")
    track = open_track(path, preset="robotcar-ins")
    assert track.heading_deg[0] == pytest.approx(270)
    assert np.isnan(track.heading_deg[1])


def test_bad_fixes_are_masked_before_utm(tmp_path: Path) -> None:
    rows = ["1,51,-1", "2,nan,-1", "3,95,-1", "4,0,0", "5,51,181", "5,51,-1", "3,51,-1", "6,51,-1", "7,51"]
    track = open_track(write(tmp_path, "\n".join(["timestamp,latitude,longitude", *rows])))
    assert track.t_us.tolist() == [1, 3, 5, 6]
    assert track.dropped == {"broken row": 1, "no fix": 2, "out of range": 2}
    assert track.notes[-1] == "left out of the track: 2 out of range (first line 4: 3,95,-1)"


@pytest.mark.parametrize("encoding", ["UTF-8", "UTF-8-SIG", "UTF-16", "ISO-8859-1"])
def test_gpx_in_any_encoding(tmp_path: Path, encoding: str) -> None:
    point = '<trkpt lat="51" lon="-1"><time>2020-01-01T00:00:00Z</time></trkpt>'
    text = f'<gpx version="1.1" creator="é"><trk><trkseg>{point}</trkseg></trk></gpx>'
    declared = encoding.removesuffix("-SIG")
    path = tmp_path / "walk.gpx"
    path.write_bytes(f'<?xml version="1.0" encoding="{declared}"?>{text}'.encode(encoding))
    assert open_track(path).t_us.tolist() == [1577836800000000]


def test_odd_cells_cost_one_row_each(tmp_path: Path) -> None:
    rows = [
        "1,51,-1,9",
        '2,"51,-1,9',
        "1e30,51,-1,9",
        "NaN,51,-1,9",
        "3,51,-1,inf",
        f"4,{'5' * 200_000},-1,9",
    ]
    path = write(tmp_path, "\n".join(["timestamp,latitude,longitude,course", *rows, "5,51,-1,9"]))
    track = open_track(path, heading="course")
    assert track.t_us.tolist() == [1, 3, 5]
    assert track.dropped == {"broken row": 4}
    assert np.isnan(track.heading_deg[1])


def test_one_zone_for_the_whole_track_and_for_its_queries(tmp_path: Path) -> None:
    rows = ["1000000,50,5.999", "4000000,50,6.001", "7000000,50,6.003"]
    path = write(tmp_path, "\n".join(["timestamp,latitude,longitude", *rows]))
    track = open_track(path)
    assert track.zone == 32
    assert np.hypot(*np.diff(track.xy, axis=0)[0]) == pytest.approx(143, abs=1)
    assert open_track(path, zone=31).zone == 31
    with pytest.raises(TrackError, match="UTM zone 10"):
        open_track(path, zone=10)
    with pytest.raises(TrackError, match="no UTM zone 61"):
        open_track(path, zone=61)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        (" \n", "is empty"),
        ("\x00\x01\x02,", "no GPS log"),
        ("<gpx version='1.1'><trk>", "not a sound GPX file"),
        ("<gpx version='1.1'></gpx>", "no track point"),
        ("timestamp,latitude,longitude\n", "no usable fix"),
        ("timestamp,latitude,longitude\n1,nan,2\n", "no usable fix, 1 dropped: no fix"),
        (rmc("100000.00", status="V"), "no usable fix"),
        (rmc("100000.00").replace("N", "S", 1), "1 dropped: damaged sentence .first line 1: .GPRMC,1000"),
    ],
)
def test_bad_logs_are_one_clear_line(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(TrackError, match=words) as caught:
        open_track(write(tmp_path, text))
    assert "log.txt" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_files_and_unknown_settings(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match="No such file"):
        open_track(tmp_path / "none")
    path = write(tmp_path, "timestamp,latitude,longitude\n1,51,2\n")
    with pytest.raises(SettingsError, match="did you mean 'latitude'"):
        open_track(path, latitud="x")
    with pytest.raises(SettingsError, match="robotcar-ins"):
        open_track(path, preset="oxford")
    assert PRESETS["robotcar"].time == "timestamp"


def test_cut_and_flipped_logs_never_crash(tmp_path: Path) -> None:
    whole = "".join(rmc(f"1000{second:02}.00") for second in range(20)).encode()
    rng = np.random.default_rng(0)
    for _ in range(100):
        damaged = bytearray(whole[: rng.integers(1, len(whole))])
        damaged[rng.integers(len(damaged))] ^= 1 << int(rng.integers(8))
        path = tmp_path / "damaged"
        path.write_bytes(damaged)
        with contextlib.suppress(TrackError):
            assert 0 < len(open_track(path)) <= 20
