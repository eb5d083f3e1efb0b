"""NMEA 0183: a GGA and an RMC sentence a match, so that whatever reads a GPS receiver can read them.

Quality 6 (estimated) and mode E say that it is no satellite fix, quality 0 and status V that there is no
position. Times are UTC; those of a camera that counts from zero have no date.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime, timedelta

from evplace.exports import Located

ABOUT = "NMEA 0183, GGA and RMC sentences"
SUFFIX = ".nmea"
NEEDS = "degrees"
TALKER = "GP"
"""Programs that know but one talker know this one."""
METRES_PER_HDOP = 5.0
"""Usual size of a receiver's error that its dilution of precision multiplies."""
FIRST_YEAR = 1980
"""Of GPS: two digits of a year mean none before it."""
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def lines(found: Iterable[Located]) -> Iterator[str]:
    """Two sentences a match."""
    for one in found:
        yield from pair(one, EPOCH + timedelta(microseconds=one.match.t_us))


def pair(one: Located, when: datetime) -> tuple[str, str]:
    """GGA and RMC of one match at the time `when`, without their line ends."""
    match = one.match
    time = when.strftime("%H%M%S.") + f"{when.microsecond // 10_000:02d}"
    date = when.strftime("%d%m%y") if when.year >= FIRST_YEAR else ""
    place = _place(one)
    hdop = (
        "" if math.isnan(match.uncertainty_m) else f"{min(match.uncertainty_m / METRES_PER_HDOP, 99.9):.1f}"
    )
    heading = "" if match.heading_deg is None or not place else f"{match.heading_deg % 360:.1f}"
    at = place or ",,,"
    quality, status, mode = ("6", "A", "E") if place else ("0", "V", "N")
    gga = f"{TALKER}GGA,{time},{at},{quality},00,{hdop if place else ''},,M,,M,,"
    rmc = f"{TALKER}RMC,{time},{status},{at},,{heading},{date},,,{mode}"
    return sentence(gga), sentence(rmc)


def sentence(body: str) -> str:
    """A sentence with its start and checksum."""
    return f"${body}*{checksum(body):02X}"


def checksum(body: str) -> int:
    """The exclusive or of all between the dollar and the star."""
    return functools.reduce(lambda total, sign: total ^ sign, body.encode("ascii"), 0)


def _place(one: Located) -> str:
    """`ddmm.mmmmm,N,dddmm.mmmmm,E`; empty where the position is unknown or not stood by."""
    if math.isnan(one.latitude) or not one.is_sure:
        return ""
    north, east = "N" if one.latitude >= 0 else "S", "E" if one.longitude >= 0 else "W"
    return f"{_angle(one.latitude, 2)},{north},{_angle(one.longitude, 3)},{east}"


def _angle(degrees: float, digits: int) -> str:
    """Whole degrees and minutes; minutes never round up to 60."""
    minutes = round(abs(degrees) * 60, 5)
    whole = int(minutes // 60)
    return f"{whole:0{digits}d}{minutes - 60 * whole:08.5f}"
