"""Matches as NMEA 0183: a GGA and an RMC sentence each, so that whatever reads a GPS receiver can read them.

The time is the host's. Quality 6 (estimated) and mode E say that it is no satellite fix, quality 0 and status
V say that there is no position.
"""

from __future__ import annotations

import functools
import math
from datetime import UTC, datetime

from evplace.localizer import Match
from evplace.placemap import PlaceMap
from evplace.serving._report import SURE, Report

TALKER = "GP"
"""Programs that know but one talker know this one."""
METRES_PER_HDOP = 5.0
"""Usual size of a receiver's error that its dilution of precision multiplies."""


def sentences(report: Report, place_map: PlaceMap) -> str:
    """GGA and RMC of one report, each with its checksum and line end."""
    match, when = report.match, datetime.fromtimestamp(report.host_s, UTC)
    time, date = when.strftime("%H%M%S.") + f"{when.microsecond // 10_000:02d}", when.strftime("%d%m%y")
    place = _place(match, place_map)
    hdop = (
        "" if math.isnan(match.uncertainty_m) else f"{min(match.uncertainty_m / METRES_PER_HDOP, 99.9):.1f}"
    )
    heading = "" if match.heading_deg is None or not place else f"{match.heading_deg % 360:.1f}"
    at = place or ",,,"
    quality, status, mode = ("6", "A", "E") if place else ("0", "V", "N")
    gga = f"{TALKER}GGA,{time},{at},{quality},00,{hdop if place else ''},,M,,M,,"
    rmc = f"{TALKER}RMC,{time},{status},{at},,{heading},{date},,,{mode}"
    return sentence(gga) + sentence(rmc)


def sentence(body: str) -> str:
    """A sentence with its start, checksum and end."""
    return f"${body}*{checksum(body):02X}\r\n"


def checksum(body: str) -> int:
    """The exclusive or of all between the dollar and the star."""
    return functools.reduce(lambda total, sign: total ^ sign, body.encode("ascii"), 0)


def _place(match: Match, place_map: PlaceMap) -> str:
    """`ddmm.mmmmm,N,dddmm.mmmmm,E`; empty where the position is unknown or not stood by."""
    found = None if match.position is None else place_map.geodetic(match.position)
    if found is None or match.state not in SURE:
        return ""
    latitude, longitude = found
    north, east = "N" if latitude >= 0 else "S", "E" if longitude >= 0 else "W"
    return f"{_angle(latitude, 2)},{north},{_angle(longitude, 3)},{east}"


def _angle(degrees: float, digits: int) -> str:
    """Whole degrees and minutes; minutes never round up to 60."""
    minutes = round(abs(degrees) * 60, 5)
    whole = int(minutes // 60)
    return f"{whole:0{digits}d}{minutes - 60 * whole:08.5f}"
