"""One straight drive, and logs of it in every format: what several tests write and read."""

from __future__ import annotations

import datetime
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

START_S = 1_587_452_582
"""2020-04-21 07:03:02 UTC."""
LATITUDE, LONGITUDE = -27.5, 152.95
DEGREES = 1 / 111_195.0
"""Of latitude, in a metre."""
MPS = 10.0


@dataclass
class Log:
    """A drive north at 10 m/s, one fix a second; a fault is made by changing a column."""

    seconds: int = 200
    t_s: Floats = field(init=False)
    latitude: Floats = field(init=False)
    longitude: Floats = field(init=False)
    mps: Floats = field(init=False)
    course: Floats = field(init=False)

    def __post_init__(self) -> None:
        since = np.arange(self.seconds, dtype=np.float64)
        self.t_s = START_S + since
        self.latitude = LATITUDE + MPS * since * DEGREES
        self.longitude = np.full(self.seconds, LONGITUDE)
        self.mps = np.full(self.seconds, MPS)
        self.course = np.zeros(self.seconds)

    def rows(self) -> Iterable[tuple[float, float, float, float, float]]:
        """Time in s, latitude, longitude, speed in m/s and course."""
        columns = (self.t_s, self.latitude, self.longitude, self.mps, self.course)
        return zip(*(column.tolist() for column in columns), strict=True)


def sentence(body: str, checked: bool = True) -> str:
    """An NMEA sentence with its checksum."""
    checksum = reduce(lambda a, b: a ^ b, body.encode())
    return f"${body}*{checksum:02X}" if checked else f"${body}"


def angle(degrees: float, wide: int, sides: str) -> str:
    """ddmm.mmmmmm,N"""
    whole, minutes = divmod(round(abs(degrees) * 60, 6), 60)
    return f"{int(whole):0{wide}}{minutes:09.6f},{sides[degrees < 0]}"


def rmc_body(t_s: float, latitude: float, longitude: float, mps: float, course: float) -> str:
    """A valid RMC."""
    when = datetime.datetime.fromtimestamp(t_s, datetime.UTC)
    position = f"{angle(latitude, 2, 'NS')},{angle(longitude, 3, 'EW')}"
    return f"GPRMC,{when:%H%M%S.%f},A,{position},{mps * 3600 / 1852:.3f},{course:.1f},{when:%d%m%y},,,A"


def gga_body(t_s: float, latitude: float, longitude: float) -> str:
    """A valid GGA: it has no date."""
    when = datetime.datetime.fromtimestamp(t_s, datetime.UTC)
    position = f"{angle(latitude, 2, 'NS')},{angle(longitude, 3, 'EW')}"
    return f"GNGGA,{when:%H%M%S.%f},{position},1,08,1.0,50.0,M,35.0,M,,"


def rmc_log(log: Log, checked: bool = True) -> str:
    """RMC sentences."""
    return "".join(sentence(rmc_body(*row), checked) + "\r\n" for row in log.rows())


def gga_log(log: Log) -> str:
    """GGA sentences, without dates and speeds."""
    return "".join(sentence(gga_body(*row[:3])) + "\r\n" for row in log.rows())


def csv_log(log: Log) -> str:
    """The default columns, without the log's own speed."""
    lines = [f"{round(t * 1e6)},{lat:.8f},{lon:.8f}" for t, lat, lon, _, _ in log.rows()]
    return "\n".join(["timestamp,latitude,longitude", *lines]) + "\n"


def gpx_log(log: Log) -> str:
    """One segment."""
    points = "".join(
        f'<trkpt lat="{lat:.8f}" lon="{lon:.8f}"><time>{iso(t)}</time></trkpt>\n'
        for t, lat, lon, _, _ in log.rows()
    )
    return f'<gpx version="1.1" creator="x"><trk><trkseg>\n{points}</trkseg></trk></gpx>'


def iso(t_s: float) -> str:
    """2020-04-21T07:03:02Z, or 2020-04-21T07:03:02.200000Z"""
    return datetime.datetime.fromtimestamp(t_s, datetime.UTC).replace(tzinfo=None).isoformat() + "Z"


def written(folder: Path, text: str | bytes, name: str = "log.txt") -> Path:
    """The text as a file."""
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path
