"""Families of logs as users have them: each variant must give the drive it was written from."""

from __future__ import annotations

import datetime
from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import TrackError
from evplace.sources.tracks import Track, open_track
from made_logs import LATITUDE, START_S, Log, gga_body, gpx_log, iso, rmc_body, rmc_log, sentence, written

LOG = Log(40)
ROWS = list(LOG.rows())


def check(track: Track, dated: bool = True) -> None:
    """The whole drive, at its times and places."""
    assert len(track) == 40
    assert track.dated == dated
    since_s = START_S if dated else START_S % 86_400
    assert (track.t_us / 1e6 - since_s).tolist() == pytest.approx(np.arange(40.0), abs=1e-3)
    assert track.latitude.tolist() == pytest.approx(LOG.latitude.tolist(), abs=2e-7)
    assert track.longitude.tolist() == pytest.approx(LOG.longitude.tolist(), abs=2e-7)
    assert track.zone == 56
    assert not track.northern
    assert not track.dropped


def day(t_s: float, form: str) -> str:
    return datetime.datetime.fromtimestamp(t_s, datetime.UTC).strftime(form)


PREFIXES = {
    "date and time": lambda t: day(t, "%Y-%m-%d %H:%M:%S "),
    "microseconds": lambda t: day(t, "%Y-%m-%d %H:%M:%S.%f "),
    "iso": lambda t: day(t, "%Y-%m-%dT%H:%M:%SZ,"),
    "unix": lambda t: f"{t:.2f},",
    "unix in ms": lambda t: f"{t * 1e3:.0f};",
    "unix in ns": lambda t: f"{t * 1e9:.0f} ",
    "brackets": lambda t: day(t, "[%Y/%m/%d %H:%M:%S] "),
    "port": lambda t: f"/dev/ttyUSB0 {t:.3f}: ",
    "number": lambda t: f"{t % 100:.0f}\t",
}


@pytest.mark.parametrize("prefix", PREFIXES)
@pytest.mark.parametrize("checked", [True, False])
def test_a_logger_before_each_sentence(tmp_path: Path, prefix: str, checked: bool) -> None:
    lines = [PREFIXES[prefix](row[0]) + sentence(rmc_body(*row), checked) for row in ROWS]
    check(open_track(written(tmp_path, "\n".join(lines))))


@pytest.mark.parametrize("prefix", ["date and time", "iso", "unix", "unix in ns", "brackets"])
def test_a_logger_dates_sentences_without_a_date(tmp_path: Path, prefix: str) -> None:
    lines = [PREFIXES[prefix](t + 0.4) + sentence(gga_body(t, lat, lon)) for t, lat, lon, _, _ in ROWS]
    check(open_track(written(tmp_path, "\n".join(lines))))


@pytest.mark.parametrize("end", ["\r\n", "\n", "\r", "*\n", ",1587452582.12\r\n"])
def test_sentences_without_checksums_are_told(tmp_path: Path, end: str) -> None:
    text = "".join(sentence(rmc_body(*row), False) + end for row in ROWS)
    if "*" in end:
        with pytest.raises(TrackError, match="40 dropped: damaged sentence"):
            open_track(written(tmp_path, text))
        return
    track = open_track(written(tmp_path, text))
    check(track)
    assert "40 of 40 sentences have no checksum" in track.notes[0]


def test_one_sentence_without_a_checksum_is_damaged(tmp_path: Path) -> None:
    lines = rmc_log(LOG).splitlines()
    lines[7] = lines[7].partition("*")[0]
    track = open_track(written(tmp_path, "\n".join(lines)))
    assert track.dropped == {"damaged sentence": 1}
    assert f"first line 8: {lines[7]}" in track.notes[0]


def without_date(row: tuple[float, ...]) -> str:
    fields = rmc_body(*row).split(",")  # type: ignore[arg-type]
    return ",".join([*fields[:9], "", *fields[10:]])


def zda(t_s: float) -> str:
    return "GPZDA," + day(t_s, "%H%M%S.00,%d,%m,%Y,00,00")


DATED = {
    "every second RMC has a date": [
        sentence(rmc_body(*row) if n % 2 else without_date(row)) for n, row in enumerate(ROWS)
    ],
    "only the first": [
        sentence(rmc_body(*row) if n == 0 else without_date(row)) for n, row in enumerate(ROWS)
    ],
    "only the last": [
        sentence(rmc_body(*row) if n == 39 else without_date(row)) for n, row in enumerate(ROWS)
    ],
    "GGA and ZDA": [
        line for t, lat, lon, _, _ in ROWS for line in (sentence(zda(t)), sentence(gga_body(t, lat, lon)))
    ],
    "one ZDA": [sentence(zda(START_S))] + [sentence(gga_body(t, lat, lon)) for t, lat, lon, _, _ in ROWS],
}


@pytest.mark.parametrize("name", DATED)
def test_sentences_without_a_date_beside_dated_ones(tmp_path: Path, name: str) -> None:
    track = open_track(written(tmp_path, "\r\n".join(DATED[name])))
    check(track)
    assert any("have no date" in note for note in track.notes)


GGA_LIKE = {
    "GGA": [sentence(gga_body(t, lat, lon)) for t, lat, lon, _, _ in ROWS],
    "RMC": [sentence(without_date(row)) for row in ROWS],
    "GLL": [
        sentence(
            "GPGLL," + ",".join(gga_body(t, lat, lon).split(",")[2:6]) + "," + day(t, "%H%M%S.00") + ",A,A"
        )
        for t, lat, lon, _, _ in ROWS
    ],
    "GNS": [
        sentence(",".join(["GNGNS", *gga_body(t, lat, lon).split(",")[1:6], "AN,08,1.0,50.0,35.0,,"]))
        for t, lat, lon, _, _ in ROWS
    ],
    "GGA and GSV": [
        line
        for t, lat, lon, _, _ in ROWS
        for line in ("$GPGSV,3,1,11,19,65,185,,11,54,274*79", sentence(gga_body(t, lat, lon)))
    ],
}


@pytest.mark.parametrize("name", GGA_LIKE)
def test_sentences_that_have_no_date_at_all(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, "\r\n".join(GGA_LIKE[name]))
    check(open_track(path), dated=False)
    check(open_track(path, date="2020-04-21"))


def test_vtg_gives_gga_its_speed(tmp_path: Path) -> None:
    log = Log()
    log.latitude[150:] = log.latitude[150]
    lines = [
        line
        for t, lat, lon, mps, course in log.rows()
        for line in (
            sentence(gga_body(t, lat, lon)),
            sentence(f"GPVTG,{course},T,,M,{mps * 3600 / 1852:.2f},N,{mps * 3.6:.2f},K,A"),
        )
    ]
    track = open_track(written(tmp_path, "\n".join(lines)))
    assert track.dropped == {"repeated while moving": 49}


def dms(degrees: float, form: str, sides: str) -> str:
    minutes, seconds = divmod(abs(degrees) * 3600, 60)
    hours, minutes = divmod(minutes, 60)
    return form.format(
        d=int(hours), m=int(minutes), s=seconds, side=sides[degrees < 0], sign="-" * (degrees < 0)
    )


def table(header: str, form: str, between: str = "\n") -> str:
    """A row for each fix: `form` is filled with t, lat, lon."""
    return (
        between.join([header, *(form.format(t=t, lat=lat, lon=lon) for t, lat, lon, _, _ in ROWS)]) + between
    )


def with_times(form: str) -> str:
    lines = [f"{day(t, form)},{lat:.8f},{lon:.8f}" for t, lat, lon, _, _ in ROWS]
    return "\n".join(["timestamp,latitude,longitude", *lines])


def with_angles(form: str, separator: str = ",") -> str:
    lines = [
        separator.join([f"{t * 1e6:.0f}", dms(lat, form, "NS"), dms(lon, form, "EW")])
        for t, lat, lon, _, _ in ROWS
    ]
    return "\n".join([separator.join(["timestamp", "latitude", "longitude"]), *lines])


def with_commas(text: str) -> str:
    return text.replace(".", ",")


CSV = {
    "iso": with_times("%Y-%m-%dT%H:%M:%SZ"),
    "iso with a space": with_times("%Y-%m-%d %H:%M:%S"),
    "iso with microseconds": with_times("%Y-%m-%dT%H:%M:%S.%f+00:00"),
    "iso of Brisbane": with_times("%Y-%m-%dT%H:%M:%SZ")
    .replace("T07:03", "T17:03")
    .replace("Z,", "+10:00,"),
    "slashes": with_times("%Y/%m/%d %H:%M:%S UTC"),
    "digits": with_times("%Y%m%d%H%M%S"),
    "basic": with_times("%Y%m%dT%H%M%SZ"),
    "s": table("timestamp,latitude,longitude", "{t:.3f},{lat:.8f},{lon:.8f}"),
    "whole s": table("timestamp,latitude,longitude", "{t:.0f},{lat:.8f},{lon:.8f}"),
    "exponents": table("timestamp,latitude,longitude", "{t:.9e},{lat:.8e},{lon:.8e}"),
    "us": table("timestamp,latitude,longitude", "{t:.0f}000000,{lat:.8f},{lon:.8f}"),
    "ns": table("timestamp,latitude,longitude", "{t:.0f}000000000,{lat:.8f},{lon:.8f}"),
    "commas": with_commas(table("timestamp;latitude;longitude", "{t:.3f};{lat:.8f};{lon:.8f}")),
    "commas and tabs": with_commas(table("timestamp\tlatitude\tlongitude", "{t:.3f}\t{lat:.8f}\t{lon:.8f}")),
    "quoted commas": with_commas(
        table("timestamp,latitude,longitude", '"{t:.3f}";"{lat:.8f}";"{lon:.8f}"')
    ).replace(";", ","),
    "spaces": table("timestamp latitude longitude", "{t:.3f} {lat:.8f} {lon:.8f}"),
    "usual names": table("time,lat,lon", "{t:.3f},{lat:.8f},{lon:.8f}"),
    "capitals": table("Time,Latitude,Longitude", "{t:.3f},{lat:.8f},{lon:.8f}"),
    "lng": table("unixtime;lat;lng", "{t:.3f};{lat:.8f};{lon:.8f}"),
    "other columns": table("id,lon,alt,lat,timestamp", "7,{lon:.8f},12.5,{lat:.8f},{t:.3f}"),
    "bom": "\ufeff" + table("timestamp,latitude,longitude", "{t:.3f},{lat:.8f},{lon:.8f}"),
    "marks": with_angles("{d}°{m:02d}'{s:08.5f}\"{side}"),
    "primes": with_angles("{d}°{m:02d}′{s:08.5f}″ {side}"),
    "letter before": with_angles("{side}{d}°{m:02d}'{s:08.5f}"),
    "colons": with_angles("{sign}{d}:{m:02d}:{s:08.5f}"),
    "d m s": with_angles("{sign}{d}d {m:02d}m {s:08.5f}s"),
    "spaces between": with_angles("{d} {m:02d} {s:08.5f} {side}"),
    "comma for the point": with_commas(with_angles("{d}°{m:02d}'{s:08.5f}\" {side}", ";")),
    "sides in columns": table(
        "timestamp,latitude,N/S,longitude,E/W", "{t:.3f},{lat:.8f},S,{lon:.8f},E"
    ).replace(",-", ","),
    "a side behind": table("timestamp,lat,lon", "{t:.3f},{lat:.8f}S,{lon:.8f}E").replace(",-", ","),
    "bare returns": table("timestamp,latitude,longitude", "{t:.3f},{lat:.8f},{lon:.8f}", "\r"),
    "a date and a time": "\n".join(
        ["date,time,lat,lon"]
        + [day(t, "%Y-%m-%d,%H:%M:%S") + f",{lat:.8f},{lon:.8f}" for t, lat, lon, _, _ in ROWS]
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CSV)
def test_tables(tmp_path: Path, name: str) -> None:
    check(open_track(written(tmp_path, CSV[name])))


@pytest.mark.parametrize("form", ["%H:%M:%S", "%H:%M:%S.%f", "%H:%M:%S,%f"])
def test_times_of_day_in_a_table(tmp_path: Path, form: str) -> None:
    text = (
        with_times(form) if "," not in form else with_times(form).replace(",-", ";-").replace(",152", ";152")
    )
    text = (
        text.replace("timestamp,latitude,longitude", "timestamp;latitude;longitude") if ";" in text else text
    )
    check(open_track(written(tmp_path, text)), dated=False)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1587452582,0;-27,5;152,95", "1 dropped: row longer than the header"),
        ("1587452582,-27,5,152,95", "1 dropped: row longer than the header"),
        ("1587452582,2733.0108S,152.95", "1 dropped: broken row"),
        ("1587452582,2733.0108,15257.000", "1 dropped: out of range"),
        ("1587452582,27°61'00\"S,152.95", "1 dropped: broken row"),
        ("21.04.2020 07:03,-27.5,152.95", "1 dropped: broken row"),
        ("2020-04-21T07:03:00+99:99,-27.5,152.95", "1 dropped: broken row"),
        ("1e999999,-27.5,152.95", "1 dropped: broken row"),
    ],
)
def test_what_cannot_be_told_is_no_position(tmp_path: Path, text: str, told: str) -> None:
    path = written(tmp_path, f"timestamp,latitude,longitude\n{text}\n".replace(";", ","))
    with pytest.raises(TrackError, match=rf"no usable fix, {told} \(first line 2: ") as caught:
        open_track(path)
    assert "\n" not in str(caught.value)


def jumbled(order: np.ndarray) -> dict[str, str]:
    rows = [ROWS[n] for n in order]
    return {
        "csv": "\n".join(["time,lat,lon", *(f"{t:.0f},{lat:.8f},{lon:.8f}" for t, lat, lon, _, _ in rows)]),
        "rmc": "\n".join(sentence(rmc_body(*row)) for row in rows),
        "gpx": "<gpx><trk><trkseg>"
        + "".join(
            f'<trkpt lat="{la:.8f}" lon="{lo:.8f}"><time>{iso(t)}</time></trkpt>' for t, la, lo, _, _ in rows
        )
        + "</trkseg></trk></gpx>",
    }


ORDERS = {
    "two blocks": np.r_[20:40, 0:20],
    "three blocks": np.r_[30:40, 0:15, 15:30],
    "backwards": np.arange(40)[::-1],
    "two swapped": np.r_[0:10, 11, 10, 12:40],
    "shuffled": np.random.default_rng(0).permutation(40),
}


@pytest.mark.parametrize("kind", ["csv", "rmc", "gpx"])
@pytest.mark.parametrize("order", ORDERS)
def test_rows_out_of_order_are_sorted_and_it_is_told(tmp_path: Path, order: str, kind: str) -> None:
    track = open_track(written(tmp_path, jumbled(ORDERS[order])[kind]))
    check(track)
    assert any("not in the order of time: it was sorted (first " in note for note in track.notes)


@pytest.mark.parametrize("cut", [0.98, 0.9, 0.7, 0.4, 0.2])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_a_cut_gpx_gives_its_good_part(tmp_path: Path, cut: float, encoding: str) -> None:
    whole = gpx_log(LOG).encode(encoding)
    path = written(tmp_path, whole[: int(cut * len(whole))])
    track = open_track(path)
    assert 40 * cut - 3 <= len(track) <= 40 * cut + 1
    assert track.latitude.tolist() == pytest.approx(LOG.latitude[: len(track)].tolist(), abs=2e-7)
    assert track.fault is not None
    assert track.fault.startswith(f"{path} breaks off: ")
    assert open_track(written(tmp_path, whole)).fault is None


WRONG = {
    "another country": ("4807.03800,N", "01131.00000,E"),
    "the other hemisphere": ("2730.00000,N", "15257.00000,E"),
    "the other side": ("2730.00000,S", "15257.00000,W"),
    "a degree off": ("2830.00000,S", "15257.00000,E"),
    "the pole": ("8959.00000,N", "15257.00000,E"),
    "the origin": ("0000.00000,N", "00000.00000,E"),
}


@pytest.mark.parametrize("name", WRONG)
@pytest.mark.parametrize("at", [0, 20, 39])
def test_one_wrong_fix_never_refuses_a_log(tmp_path: Path, name: str, at: int) -> None:
    lines = rmc_log(LOG).splitlines()
    fields = lines[at][1:].partition("*")[0].split(",")
    latitude, longitude = WRONG[name]
    lines[at] = sentence(",".join([*fields[:3], latitude, longitude, *fields[7:]]))
    track = open_track(written(tmp_path, "\n".join(lines)))
    assert len(track) == 39
    assert (track.zone, track.northern) == (56, False)
    assert list(track.dropped.values()) == [1]
    assert f"(first line {at + 1}: {lines[at][:60]}" in track.notes[0]


def tum(t: float, n: int, separator: str = " ", form: str = "{:.6f}") -> str:
    return separator.join([form.format(t), f"{10.0 * n}", f"{5.0 * n}", "0.5", "0", "0", "0", "1"])


EUROC = (
    "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []"
)
POSES = {
    "tum": ["# timestamp tx ty tz qx qy qz qw", *(tum(t, n) for n, (t, *_) in enumerate(ROWS))],
    "tum without a header": [tum(t, n) for n, (t, *_) in enumerate(ROWS)],
    "tum with exponents": [tum(t, n, " ", "{:.9e}") for n, (t, *_) in enumerate(ROWS)],
    "tum with tabs": ["#comment", "#another", *(tum(t, n, "\t") for n, (t, *_) in enumerate(ROWS))],
    "tum in ns": [tum(t * 1e9, n, " ", "{:.0f}") for n, (t, *_) in enumerate(ROWS)],
    "euroc": [EUROC, *(tum(t * 1e9, n, ",", "{:.0f}") for n, (t, *_) in enumerate(ROWS))],
    "euroc ground truth": [
        EUROC + ", v_RS_R_x [m s^-1]",
        *(tum(t * 1e9, n, ",", "{:.0f}") + ",10,5,0,0,0,0,0,0,0" for n, (t, *_) in enumerate(ROWS)),
    ],
    "a header of names": ["timestamp tx ty tz qx qy qz qw", *(tum(t, n) for n, (t, *_) in enumerate(ROWS))],
}


@pytest.mark.parametrize("name", POSES)
def test_poses_are_a_local_track(tmp_path: Path, name: str) -> None:
    track = open_track(written(tmp_path, "\n".join(POSES[name])))
    assert (len(track), track.zone, track.dropped) == (40, 0, {})
    assert (track.t_us / 1e6 - START_S).tolist() == pytest.approx(np.arange(40.0), abs=1e-3)
    assert track.xy.tolist() == [[10.0 * n, 5.0 * n] for n in range(40)]
    assert track.heading_deg[5] == pytest.approx(np.rad2deg(np.arctan2(2, 1)))
    assert "plane xy (z up); they span x 390 m, y 195 m, z 0 m" in track.notes[1]


def test_a_cameras_axes_are_told(tmp_path: Path) -> None:
    lines = [f"{t:.0f} {0.1 * n} 1.0 {10.0 * n} 0 0 0 1" for n, (t, *_) in enumerate(ROWS)]
    path = written(tmp_path, "\n".join(lines))
    track = open_track(path)
    assert track.northing.tolist() == [10.0 * n for n in range(40)]
    assert "plane xz (z ahead)" in track.notes[1]
    assert open_track(path, plane="xy").northing.tolist() == [1.0] * 40


def test_kitti_poses_have_no_times(tmp_path: Path) -> None:
    with pytest.raises(TrackError, match=r"12 numbers \(KITTI\) have no times"):
        open_track(written(tmp_path, "1 0 0 0 0 1 0 0 0 0 1 0\n" * 5))


def test_broken_poses_are_counted(tmp_path: Path) -> None:
    lines = list(POSES["tum"])
    lines[5], lines[9] = lines[5][:20], lines[9].replace("0.5", "x")
    lines[11] = lines[11].replace(f" {10.0 * 10} ", " 1e99 ")
    track = open_track(written(tmp_path, "\n".join(lines)))
    assert len(track) == 37
    assert track.dropped["broken row"] >= 2
    assert "(first line 6: " in track.notes[-1] or "(first line 6: " in track.notes[-2]


def test_the_latitude_is_that_of_the_drive() -> None:
    assert LOG.latitude[0] == LATITUDE
