"""GPX 1.1: one track of the positions that the method stands by; a new segment after each it does not."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta

from evplace.exports import Located

ABOUT = "GPX 1.1, a track of the sure positions"
SUFFIX = ".gpx"
NEEDS = "degrees"
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def lines(found: Iterable[Located]) -> Iterator[str]:
    """The file, point by point."""
    yield '<?xml version="1.0" encoding="UTF-8"?>'
    yield '<gpx version="1.1" creator="evplace" xmlns="http://www.topografix.com/GPX/1/1"><trk>'
    is_open = False
    for one in found:
        if one.is_sure != is_open:
            yield "<trkseg>" if one.is_sure else "</trkseg>"
            is_open = one.is_sure
        if one.is_sure:
            yield _point(one)
    if is_open:
        yield "</trkseg>"
    yield "</trk></gpx>"


def _point(one: Located) -> str:
    time = (EPOCH + timedelta(microseconds=one.match.t_us)).strftime("%Y-%m-%dT%H:%M:%S.%fZ")
    return f'<trkpt lat="{one.latitude:.7f}" lon="{one.longitude:.7f}"><time>{time}</time></trkpt>'
