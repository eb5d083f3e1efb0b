"""Damaged logs of every format: a track, or one clear line; never anything else."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from evplace.core.errors import TrackError
from evplace.sources.tracks import open_track
from made_bags import nav_sat_fix_bag
from made_logs import START_S, Log, csv_log, gga_body, gpx_log, iso, rmc_log, sentence

LOG = Log(12)
ODD = [
    b"", b"1e999999", b"-1e999999", b"1e-999999", b"9" * 40, b"-1", b"nan", b"inf", b"\x00", b"\xff\xfe",
    b'"',
    b"+99:99",
    b"2020-13-45T99:99:99Z", b"0000-00-00T00:00:00Z", b"9999-12-31T23:59:59-23:59", b"$GPRMC,*00",
    b"$GPRMC,100010.00,A*24", b",,,,,,,,,,,,,,", b"<trkpt>", b"&amp;", b"&x;", b"\n", b"\r", b"1,5", b"1.5.5",
    "٣".encode(), "²".encode(), b"1_000", b"0x10", b"N", b"-27.5S", b"91", b"-181", b"60Z", b"\x1b[2J",
]  # fmt: skip
LOGS = {
    "rmc": rmc_log(LOG),
    "gga": "\n".join(sentence(gga_body(t, lat, lon), checked=False) for t, lat, lon, _, _ in LOG.rows()),
    "prefixed": "\n".join(f"{iso(START_S)} {line}" for line in rmc_log(LOG).splitlines()),
    "csv": csv_log(LOG),
    "iso": "\n".join(["time;lat;lon", *(f"{iso(t)};{lat};{lon}" for t, lat, lon, _, _ in LOG.rows())]),
    "utm": "timestamp,northing,easting,utm_zone\n"
    + "\n".join(f"{n}000000,{5735500 + n},620000,30U" for n in range(10)),
    "gpx": gpx_log(LOG),
    "tum": "\n".join(f"{t} {n} {n} 0 0 0 0 1" for n, (t, *_) in enumerate(LOG.rows())),
}
WHOLE = {name: text.encode() for name, text in LOGS.items()}


def damaged(whole: bytes, data: st.DataObject) -> bytes:
    """Cells replaced by odd ones, bytes flipped, the end cut off."""
    content = bytearray(whole)
    for _ in range(data.draw(st.integers(1, 4))):
        how = data.draw(st.sampled_from(["cell", "cell", "flip", "cut", "swap"]))
        at = data.draw(st.integers(0, max(len(content) - 1, 0)))
        end = data.draw(st.integers(at, min(at + 40, len(content))))
        if how == "cell":
            content[at:end] = data.draw(st.sampled_from(ODD))
        elif how == "flip" and content:
            content[at] ^= 1 << data.draw(st.integers(0, 7))
        elif how == "cut":
            del content[at:]
        else:
            content[at:at] = content[end : end + 60]
    return bytes(content)


@pytest.mark.parametrize("name", WHOLE)
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_text_formats(tmp_path: Path, name: str, data: st.DataObject) -> None:
    check(tmp_path / "log", damaged(WHOLE[name], data))


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_bags(tmp_path: Path, data: st.DataObject) -> None:
    path = nav_sat_fix_bag(tmp_path, LOG)
    check(path, damaged(path.read_bytes(), data))


@pytest.mark.parametrize("name", WHOLE)
@pytest.mark.parametrize("odd", ODD)
def test_every_cell_of_a_row(tmp_path: Path, name: str, odd: bytes) -> None:
    """Each cell of one row is replaced in turn."""
    separator = b" " if name == "tum" else b";" if name == "iso" else b'"' if name == "gpx" else b","
    lines = WHOLE[name].split(b"\n")
    cells = lines[3].split(separator)
    for at in range(len(cells)):
        row = separator.join([*cells[:at], odd, *cells[at + 1 :]])
        check(tmp_path / "log", b"\n".join([*lines[:3], row, *lines[4:]]))


def check(path: Path, content: bytes) -> None:
    """A track whose positions are finite and whose times increase, or one line."""
    path.write_bytes(content)
    said: tuple[str, ...] = ()
    try:
        track = open_track(path)
    except TrackError as error:
        said = (str(error),)
    else:
        said = track.notes
        assert track.known.all()
        assert (track.t_us[1:] > track.t_us[:-1]).all()
    assert all("\n" not in text and "\x1b" not in text for text in said)
