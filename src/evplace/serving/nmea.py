"""Matches of a live source as NMEA 0183: the sentences of `evplace.exports.nmea`, at the host's time."""

from __future__ import annotations

from datetime import UTC, datetime

from evplace.exports import located
from evplace.exports.nmea import pair
from evplace.placemap import PlaceMap
from evplace.serving._report import Report


def sentences(report: Report, place_map: PlaceMap) -> str:
    """GGA and RMC of one report, each with its checksum and line end."""
    (one,) = located([report.match], place_map)
    return "".join(f"{line}\r\n" for line in pair(one, datetime.fromtimestamp(report.host_s, UTC)))
