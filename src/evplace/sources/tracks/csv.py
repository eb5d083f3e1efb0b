"""Tables with a header line: columns by name, units by setting. The default is Oxford RobotCar's gps.csv.

Times are numbers of any unit, ISO 8601, or times of day; positions are degrees (also with minutes and
seconds, or a comma for the point) or UTM.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Literal

from evplace.core.errors import TrackError
from evplace.sources._times import clock_us, dated_unit, iso_us, number, number_us, of_day_us
from evplace.sources.tracks import nmea, poses
from evplace.sources.tracks._fixes import Fix, Fixes, Losses, line_of, shown, unroll_days

_CLOCK = re.compile(r"[0-9]{1,8}")
_ZONE = re.compile(r"([0-9]{1,2})\s*([C-HJ-NP-X]?)", re.IGNORECASE)
_DEGREES = re.compile(
    r"([NSEW]?)\s*([+-]?)([0-9]{1,3}(?:\.[0-9]*)?)"
    r"(?:[\s°ºd:]+([0-9]{1,2}(?:\.[0-9]*)?)(?:[\s'′’m:]+([0-9]{1,2}(?:\.[0-9]*)?))?)?"
    r"[\s°ºd'′’m\"″”s]*([NSEW]?)"
)
"""Degrees, minutes and seconds with something between them, and the side of the equator or of Greenwich."""
_OTHER_NAMES = {
    "timestamp": ("time", "t", "stamp", "utc", "datetime", "date_time", "unixtime", "gps_time", "t_us"),
    "latitude": ("lat",),
    "longitude": ("lon", "lng", "long"),
    "speed": ("speed_mps", "velocity"),
}
"""Usual names of a column whose setting is at its default."""
_SIDES = {"latitude": ("n/s", "ns", "lat_dir", "lat_ref"), "longitude": ("e/w", "ew", "lon_dir", "lon_ref")}
"""Columns that loggers write beside a position without a sign."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Which columns to read, and their units."""

    time: str = "timestamp"
    """Column of the times. Default: RobotCar's."""
    time_unit: Literal["auto", "s", "ms", "us", "ns", "clock"] = "auto"
    """Unit of the times; clock: the digits HHMMSScc of a time of day. auto: as text says (ISO 8601, or a time
    of day), else the unit in which the numbers are dates, else us, as RobotCar's are."""
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
    speed: str = "speed"
    """Column of the speeds, by which positions are checked where it is there; their unit is found."""


PRESETS = {
    "robotcar": Settings(time_unit="us"),
    "robotcar-ins": Settings(time_unit="us", heading="yaw", heading_scale=180 / math.pi),
    "nordland": Settings(
        time="tid", time_unit="clock", latitude="lat", longitude="lon", degree_scale=1e-5,
        heading="course", heading_scale=0.01, speed="",
    ),
}  # fmt: skip
"""robotcar: gps/gps.csv; robotcar-ins: gps/ins.csv; nordland: the railway's logs."""

Row = dict[str, str]


def recognises(head: bytes) -> bool:
    """Whether this is text, neither XML, NMEA nor poses, whose first line names at least two columns."""
    lines = head.removeprefix(b"\xef\xbb\xbf").split(b"\n")
    first = re.split(rb"[\r\n]", head.removeprefix(b"\xef\xbb\xbf").lstrip())[0]
    binary = b"\x00" in head or any(byte < 9 for byte in first)
    sentences = any(line.startswith(b"$") for line in lines) or nmea.recognises(head)
    named = re.match(rb"[\w\"'#%]", first) is not None
    table = named and not binary and not sentences and re.search(rb"[,;\t ]", first) is not None
    return table and not poses.recognises(head)


def read(path: Path, settings: Settings) -> Fixes:
    """All rows that can be read; broken rows are counted.

    Raises TrackError where a column is missing.
    """
    lines = re.split(r"\r\n|\r|\n", path.read_bytes().decode("utf-8-sig", "replace"))
    top = next(n for n, line in enumerate(lines) if line.strip())
    delimiter = max(",;\t ", key=lines[top].count)
    header = [name.strip() for name in _cells(lines[top].lstrip("#% "), delimiter)]
    named, notes = _named(header, settings)
    position = _position_reader(header, named)
    losses, show = Losses(), line_of(lines)
    rows = list(_rows(lines, top, header, delimiter, losses))
    clock, unit = _clock(rows, named, notes)
    fixes = []
    for line, row in rows:
        try:
            latitude, longitude = position(row)
            fixes.append(Fix(clock(row), latitude, longitude, _heading(row, named), _speed(row, named), line))
        except (ValueError, KeyError, InvalidOperation, OverflowError):
            losses.add("broken row", show(line))
    found = Fixes.of(fixes, show=show, losses=losses, notes=notes, unit=unit, dated=unit != "clock")
    return found if found.dated else replace(found, t_us=unroll_days(found.t_us))


def _rows(
    lines: list[str], top: int, header: list[str], delimiter: str, losses: Losses
) -> Iterator[tuple[int, Row]]:
    """The rows under the header with their line numbers; those with more cells than it names are counted."""
    for line, text in enumerate(lines[top + 1 :], top + 2):
        if not text.strip():
            continue
        try:
            cells = _cells(text, delimiter)
        except csv.Error:
            losses.add("broken row", line_of(lines)(line))
            continue
        if any(cell.strip() for cell in cells[len(header) :]):
            losses.add("row longer than the header", line_of(lines)(line))
        else:
            yield line, dict(zip(header, cells, strict=False))


def _cells(line: str, delimiter: str) -> list[str]:
    """One line's cells. Read alone, so that a quote that is not closed costs one row, not the rest."""
    return next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))


def _named(header: list[str], settings: Settings) -> tuple[Settings, list[str]]:
    """The settings with the columns' own names: usual other names serve where a default one is missing."""
    lower = {name.lower(): name for name in reversed(header)}
    chosen: dict[str, str] = {}
    for field, default in (("time", "timestamp"), *((name, name) for name in list(_OTHER_NAMES)[1:])):
        if getattr(settings, field) == default and default not in header:
            found = [lower[name] for name in (default, *_OTHER_NAMES[default]) if name in lower]
            if found:
                chosen[field] = found[0]
    notes = [f"the column '{shown(name)}' is taken for the {field}" for field, name in chosen.items()]
    return replace(settings, **chosen), notes  # type: ignore[arg-type]  # all of them are names


def _position_reader(header: list[str], settings: Settings) -> Callable[[Row], tuple[float, float]]:
    """What turns a row into latitude and longitude in degrees."""
    geographic = (settings.latitude, settings.longitude)
    metric = (settings.easting, settings.northing, settings.utm_zone)
    wanted = [settings.time] + ([settings.heading] if settings.heading else [])
    missing = [name for name in wanted if name not in header]
    if missing or not (set(geographic) <= set(header) or set(metric) <= set(header)):
        absent = missing or [name for name in geographic if name not in header]
        raise TrackError(
            f"no column {' or '.join(map(repr, absent))}: it has {shown(', '.join(header))}; name the "
            "columns by the settings time, latitude, longitude (or easting, northing, utm_zone), or "
            f"choose a preset: {', '.join(PRESETS)}"
        )
    if set(geographic) <= set(header):
        lower = {name.lower(): name for name in header}
        sides = [next((lower[name] for name in _SIDES[axis] if name in lower), "") for axis in _SIDES]
        scale = settings.degree_scale
        return lambda row: (
            _degrees(row[geographic[0]], row.get(sides[0], ""), scale),
            _degrees(row[geographic[1]], row.get(sides[1], ""), scale),
        )
    return lambda row: _from_utm(_float(row[metric[0]]), _float(row[metric[1]]), row[metric[2]])


def _degrees(text: str, side: str, scale: float) -> float:
    """Degrees of a decimal number, or of degrees, minutes and seconds with their marks."""
    side = side.strip().upper()[:1]
    try:
        value, negative = _float(text) * scale, False
    except ValueError:
        value, negative = _of_minutes(text.strip().replace(",", "."))
    return -abs(value) if negative or side in ("S", "W") else value


def _of_minutes(text: str) -> tuple[float, bool]:
    """Degrees without their sign, and whether they lie south or west."""
    found = _DEGREES.fullmatch(text)
    if not found:
        raise ValueError(text)
    before, sign, degrees, minutes, seconds, after = found.groups(default="")
    if (before and after) or float(minutes or 0) >= 60 or float(seconds or 0) >= 60:
        raise ValueError(text)
    value = float(degrees) + float(minutes or 0) / 60 + float(seconds or 0) / 3600
    return value, (before or after) in ("S", "W") or sign == "-"


def _float(text: str) -> float:
    """A number with a point or a comma; "nan" is one."""
    return math.nan if text.strip().lower() == "nan" else float(number(text))


def _from_utm(easting: float, northing: float, zone: str) -> tuple[float, float]:
    """Latitude and longitude in degrees of a UTM position; ValueError where it has none."""
    import utm

    found = _ZONE.fullmatch(zone.strip())
    if not found:
        raise ValueError(zone)
    northern = found[2].upper() >= "N" if found[2] else True
    latitude, longitude = utm.to_latlon(easting, northing, int(found[1]), northern=northern)
    return float(latitude), float(longitude)


def _clock(
    rows: list[tuple[int, Row]], settings: Settings, notes: list[str]
) -> tuple[Callable[[Row], int], str | None]:
    """What turns a row into microseconds, and the unit that was taken."""
    name, unit = settings.time, settings.time_unit
    if unit == "clock":
        return (lambda row: _digits_us(row[name].strip())), unit
    if unit != "auto":
        return (lambda row: number_us(row[name], unit)), unit
    texts = [row.get(name, "").strip() for _, row in rows]
    if sum(_is(iso_us, text) for text in texts) * 2 > len(texts):
        return (lambda row: iso_us(row[name])), None
    if sum(_is(clock_us, text) for text in texts) * 2 > len(texts):
        return _of_day(rows, name)
    numbers = [number(text) for text in texts if _is(number, text)]
    told = dated_unit(numbers)
    if told not in (None, "us"):
        notes.append(f"the times of the column '{shown(name)}' are taken in {told}, in which they are dates")
    if told is None and numbers:
        notes.append(f"the times of the column '{shown(name)}' are no dates: they are taken in us")
    chosen = told or "us"
    return (lambda row: number_us(row[name], chosen)), chosen


def _of_day(rows: list[tuple[int, Row]], name: str) -> tuple[Callable[[Row], int], str | None]:
    """Times of day; with their dates where a column of that name holds them."""
    dates = [column for column in (rows[0][1] if rows else {}) if column.lower() == "date"]
    if dates and _is(iso_us, f"{rows[0][1][dates[0]].strip()} 00:00:00"):
        return (lambda row: iso_us(f"{row[dates[0]].strip()} {row[name].strip()}")), None
    return (lambda row: clock_us(row[name])), "clock"


def _is(read: Callable[[str], int | Decimal], text: str) -> bool:
    try:
        read(text)
    except (ValueError, OverflowError):
        return False
    return True


def _digits_us(text: str) -> int:
    """HHMMSScc (leading zeros may be missing) as microseconds since midnight."""
    if not _CLOCK.fullmatch(text):
        raise ValueError(text)
    digits = text.zfill(8)
    return of_day_us(digits[:2], digits[2:4], digits[4:6], digits[6:])


def _heading(row: Row, settings: Settings) -> float:
    """Degrees; NaN where there is no such column or the cell is empty."""
    text = row[settings.heading].strip() if settings.heading else ""
    return float(text) * settings.heading_scale if text else math.nan


def _speed(row: Row, settings: Settings) -> float:
    """In the log's own unit; NaN where there is none."""
    try:
        return _float(row.get(settings.speed, ""))
    except ValueError:
        return math.nan
