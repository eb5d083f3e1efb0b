"""GPX 1.0 and 1.1: the points of all tracks and segments, in the file's order; waypoints are no track."""

from __future__ import annotations

import codecs
import datetime
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Fix, Fixes

_EPOCH = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
_ENCODING = re.compile(r"""\sencoding=["']([\w.:-]+)["']""")
_MICROSECOND = datetime.timedelta(microseconds=1)


@dataclass(frozen=True, slots=True)
class Settings:
    """GPX needs none."""


PRESETS: dict[str, Settings] = {}


def recognises(head: bytes) -> bool:
    """Whether this is XML with a <gpx> element (ASCII-compatible or UTF-16)."""
    return bool(re.search(rb"<(\w+:)?gpx[\s>]", head.replace(b"\x00", b"")))


def read(path: Path, settings: Settings) -> Fixes:
    """All track points that have a time; those without are counted.

    Raises TrackError where the file is no sound GPX or no track point has a time.
    """
    del settings
    points = list(_points(_parsed(path)))
    if not points:
        raise TrackError("the GPX file has no track point (waypoints and routes have no times to go by)")
    dropped: Counter[str] = Counter()
    fixes = []
    for point in points:
        if point.time is None:
            dropped["no time"] += 1
        else:
            fixes.append(Fix(_microseconds(point.time), point.latitude, point.longitude, np.nan))
    if not fixes:
        raise TrackError(f"none of the {len(points)} track points has a time: export the track with times")
    return Fixes.of(fixes, dict(dropped))


def _parsed(path: Path) -> Any:
    import gpxpy

    try:
        return gpxpy.parse(_text(path.read_bytes()))
    except (gpxpy.gpx.GPXException, ValueError, LookupError, TypeError, AttributeError) as error:
        raise TrackError(f"not a sound GPX file: {' '.join(str(error).split())}") from error


def _text(xml: bytes) -> str:
    """The file as text, by its byte order mark, else by the encoding that it declares, else as UTF-8."""
    if xml.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return _ENCODING.sub("", xml.decode("utf-16"), count=1)
    declared = _ENCODING.search(xml[:200].decode("ascii", "replace"))
    plain = xml.removeprefix(codecs.BOM_UTF8).decode(declared[1] if declared else "utf-8")
    return _ENCODING.sub("", plain, count=1)


def _points(gpx: Any) -> Iterator[Any]:
    for track in gpx.tracks:
        for segment in track.segments:
            yield from segment.points


def _microseconds(time: datetime.datetime) -> int:
    """Since 1970; a time without a zone is UTC, as GPX says."""
    aware = time if time.tzinfo else time.replace(tzinfo=datetime.UTC)
    return (aware - _EPOCH) // _MICROSECOND
