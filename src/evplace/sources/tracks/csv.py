"""Tables with a header line: columns by name, units by setting. The default is Oxford RobotCar's gps.csv."""

from __future__ import annotations

import csv
import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Literal

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Fix, Fixes, unroll_days

_CLOCK = re.compile(r"\d{1,8}")
_ZONE = re.compile(r"(\d{1,2})\s*([C-HJ-NP-X]?)", re.IGNORECASE)
_MAX_US = 2**62
_UNIT_US = {"s": Decimal(1_000_000), "ms": Decimal(1000), "us": Decimal(1), "ns": Decimal("0.001")}


@dataclass(frozen=True, slots=True)
class Settings:
    """Which columns to read, and their units."""

    time: str = "timestamp"
    """Column of the times. Default: RobotCar's."""
    time_unit: Literal["s", "ms", "us", "ns", "clock"] = "us"
    """Unit of the times; clock: the digits HHMMSScc of a time of day. Default: RobotCar's."""
    latitude: str = "latitude"
    """Column of the latitudes. Where the table has none, easting, northing and zone are read."""
    longitude: str = "longitude"
    """Column of the longitudes."""
    degree_scale: float = 1.0
    """Degrees in one unit of latitude and longitude, for example 1e-5."""
    easting: str = "easting"
    """Column of the UTM eastings in metres."""
    northing: str = "northing"
    """Column of the UTM northings in metres."""
    utm_zone: str = "utm_zone"
    """Column of the UTM zones, for example 30U."""
    heading: str = ""
    """Column of the headings, clockwise from north; empty: computed from the movement."""
    heading_scale: float = 1.0
    """Degrees in one unit of the heading; 57.29578 for radians."""


PRESETS = {
    "robotcar": Settings(),
    "robotcar-ins": Settings(heading="yaw", heading_scale=180 / math.pi),
    "nordland": Settings(
        time="tid", time_unit="clock", latitude="lat", longitude="lon", degree_scale=1e-5,
        heading="course", heading_scale=0.01,
    ),
}  # fmt: skip
"""robotcar: gps/gps.csv; robotcar-ins: gps/ins.csv; nordland: the railway's logs."""

Row = dict[str, str]


def recognises(head: bytes) -> bool:
    """Whether this is text, neither XML nor NMEA, whose first line names at least two columns."""
    lines = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    first = re.split(rb"[\r\n]", head.removeprefix(b"\xef\xbb\xbf").lstrip())[0]
    binary = b"\x00" in head or any(byte < 9 for byte in first)
    sentences = any(line.startswith(b"$") for line in lines)
    named = re.match(rb"[\w\"'#%]", first) is not None
    return named and not binary and not sentences and re.search(rb"[,;\t ]", first) is not None


def read(path: Path, settings: Settings) -> Fixes:
    """All rows that can be read; broken rows are counted.

    Raises TrackError where a column is missing.
    """
    first, *lines = _lines(path)
    delimiter = max(",;\t ", key=first.count)
    header = [name.strip() for name in _cells(first.lstrip("#% "), delimiter)]
    position = _position_reader(header, settings)
    dropped: Counter[str] = Counter()
    fixes = []
    for line in lines:
        try:
            row = dict(zip(header, _cells(line, delimiter), strict=False))
            fixes.append(Fix(_time_us(row, settings), *position(row), _heading(row, settings)))
        except (ValueError, KeyError, InvalidOperation, OverflowError, csv.Error):
            dropped["broken row"] += 1
    found = Fixes.of(fixes, dict(dropped))
    t_us = unroll_days(found.t_us) if settings.time_unit == "clock" else found.t_us
    return Fixes(t_us, found.latitude, found.longitude, found.heading_deg, found.dropped)


def _lines(path: Path) -> list[str]:
    """The lines that are not empty (at least one, as the format was recognised), whatever ends them."""
    text = path.read_bytes().decode("utf-8-sig", "replace")
    return [line for line in re.split(r"\r\n|\r|\n", text) if line.strip()]


def _cells(line: str, delimiter: str) -> list[str]:
    """One line's cells. Read alone, so that a quote that is not closed costs one row, not the rest."""
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))


def _position_reader(header: list[str], settings: Settings) -> Callable[[Row], tuple[float, float]]:
    """What turns a row into latitude and longitude in degrees."""
    geographic = (settings.latitude, settings.longitude)
    metric = (settings.easting, settings.northing, settings.utm_zone)
    wanted = [settings.time] + ([settings.heading] if settings.heading else [])
    missing = [name for name in wanted if name not in header]
    if missing or not (set(geographic) <= set(header) or set(metric) <= set(header)):
        absent = missing or [name for name in geographic if name not in header]
        raise TrackError(
            f"no column {' or '.join(map(repr, absent))}: it has {', '.join(header)[:200]}; name the "
            "columns by the settings time, latitude, longitude (or easting, northing, utm_zone), or "
            f"choose a preset: {', '.join(PRESETS)}"
        )
    if set(geographic) <= set(header):
        scale = settings.degree_scale
        return lambda row: (float(row[geographic[0]]) * scale, float(row[geographic[1]]) * scale)
    return lambda row: _from_utm(float(row[metric[0]]), float(row[metric[1]]), row[metric[2]])


def _from_utm(easting: float, northing: float, zone: str) -> tuple[float, float]:
    """Latitude and longitude in degrees of a UTM position; ValueError where it has none."""
    import utm

    found = _ZONE.fullmatch(zone.strip())
    if not found:
        raise ValueError(zone)
    northern = found[2].upper() >= "N" if found[2] else True
    latitude, longitude = utm.to_latlon(easting, northing, int(found[1]), northern=northern)
    return float(latitude), float(longitude)


def _time_us(row: Row, settings: Settings) -> int:
    text = row[settings.time].strip()
    if settings.time_unit == "clock":
        return _clock_us(text)
    t_us = int((Decimal(text) * _UNIT_US[settings.time_unit]).to_integral_value())
    if abs(t_us) > _MAX_US:
        raise ValueError(text)
    return t_us


def _clock_us(text: str) -> int:
    """HHMMSScc (leading zeros may be missing) as microseconds since midnight."""
    if not _CLOCK.fullmatch(text):
        raise ValueError(text)
    digits = text.zfill(8)
    hours, minutes, seconds, hundredths = (int(digits[at : at + 2]) for at in (0, 2, 4, 6))
    if hours > 23 or minutes > 59 or seconds > 60:
        raise ValueError(text)
    return ((hours * 60 + minutes) * 60 + seconds) * 1_000_000 + hundredths * 10_000


def _heading(row: Row, settings: Settings) -> float:
    """Degrees; NaN where there is no such column or the cell is empty."""
    text = row[settings.heading].strip() if settings.heading else ""
    return float(text) * settings.heading_scale if text else math.nan
