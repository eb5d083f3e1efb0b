"""GPX 1.0 and 1.1: the points of all tracks and segments, in the file's order; waypoints are no track.

Read point by point, so that a file that is cut off gives the points before the cut.
"""

from __future__ import annotations

import codecs
import io
import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element, ParseError, iterparse

from evplace.core.errors import TrackError
from evplace.sources._times import iso_us, number
from evplace.sources.tracks._fixes import Fix, Fixes, Losses, shown

_ENCODING = re.compile(r"""\sencoding=["']([\w.:-]+)["']""")


@dataclass(frozen=True, slots=True)
class Settings:
    """GPX needs none."""


PRESETS: dict[str, Settings] = {}


class Point(NamedTuple):
    """The text of a track point."""

    latitude: str
    longitude: str
    time: str
    speed: str

    def __str__(self) -> str:
        return shown(f"{self.latitude}, {self.longitude} at {self.time or 'no time'}")


def recognises(head: bytes) -> bool:
    """Whether this is XML with a <gpx> element (ASCII-compatible or UTF-16)."""
    return bool(re.search(rb"<(\w+:)?gpx[\s>]", head.replace(b"\x00", b"")))


def read(path: Path, settings: Settings) -> Fixes:
    """All track points that have a time; those without, and damaged ones, are counted.

    Raises TrackError where the file is no GPX or no track point has a time.
    """
    del settings
    points, fault = _points(path)
    losses = Losses()

    def show(line: int) -> str:
        return f"point {line}: {points[line - 1]}"

    fixes = []
    for line, point in enumerate(points, 1):
        try:
            if point.time:
                fixes.append(_fix(point, line))
            else:
                losses.add("no time", show(line))
        except (ValueError, OverflowError):
            losses.add("damaged point", show(line))
    if not points:
        raise TrackError(
            f"not a sound GPX file: {fault}"
            if fault
            else "the GPX file has no track point (waypoints and routes have no times to go by)"
        )
    if losses.counts.get("no time") == len(points):
        raise TrackError(f"none of the {len(points)} track points has a time: export the track with times")
    return Fixes.of(fixes, show=show, losses=losses, fault=fault and f"{path} breaks off: {fault}")


def _points(path: Path) -> tuple[list[Point], str | None]:
    """The track points of the file, and what broke it off."""
    points: list[Point] = []
    try:
        for _, element in iterparse(io.StringIO(_text(path.read_bytes()))):
            if _name(element) == "trkpt":
                points.append(_point(element))
                element.clear()
    except (ParseError, ValueError, LookupError) as error:
        return points, " ".join(str(error).split())
    return points, None


def _text(xml: bytes) -> str:
    """The file as text, by its byte order mark, else by the encoding that it declares, else as UTF-8."""
    if xml.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return _ENCODING.sub("", xml.decode("utf-16", "replace"), count=1)
    declared = _ENCODING.search(xml[:200].decode("ascii", "replace"))
    plain = xml.removeprefix(codecs.BOM_UTF8).decode(declared[1] if declared else "utf-8", "replace")
    return _ENCODING.sub("", plain, count=1)


def _name(element: Element) -> str:
    """The name without its namespace."""
    return element.tag.rpartition("}")[2]


def _point(element: Element) -> Point:
    inner = {_name(child): (child.text or "").strip() for child in element.iter()}
    return Point(
        element.get("lat", ""), element.get("lon", ""), inner.get("time", ""), inner.get("speed", "")
    )


def _fix(point: Point, line: int) -> Fix:
    latitude, longitude = float(number(point.latitude)), float(number(point.longitude))
    try:
        speed = float(number(point.speed))
    except ValueError:
        speed = math.nan
    return Fix(iso_us(point.time), latitude, longitude, speed=speed, line=line)
