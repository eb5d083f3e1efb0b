"""Matches as ROS 2 topics: what the messages hold, and their way over zenoh without a ROS installation.

Three topics: NAME/fix (sensor_msgs/NavSatFix), NAME/pose (geometry_msgs/PoseWithCovarianceStamped, in the
map's UTM metres) and /diagnostics (diagnostic_msgs/DiagnosticArray), as rmw_zenoh names and writes them.
"""

from __future__ import annotations

import itertools
import math
import os
import struct
import time
from typing import Any, NamedTuple

from evplace.localizer import SURE, Match
from evplace.placemap import PlaceMap
from evplace.serving._report import Report, epsg
from evplace.sources.live.zenoh import GID, attachment, leave, session

UNKNOWN_M = 1000.0
"""Uncertainty that stands for one that is not known."""
SIGMAS = 1.515
"""Standard deviations of each coordinate within which a round normal distribution has 68 % of its weight."""
TURN_RAD2 = math.radians(20.0) ** 2
"""Variance of the heading: a view that looks alike may be turned by so much."""
DIAGNOSE_S = 1.0
"""Seconds between two diagnostics."""
NO_FIX, FIX = -1, 0
OK, WARN, ERROR = 0, 1, 2


class Fix(NamedTuple):
    """What a NavSatFix holds."""

    status: int
    latitude: float
    longitude: float
    altitude: float
    covariance: list[float]
    """(9,) square metres, by rows: east, north, up."""
    covariance_type: int
    """0 unknown, 1 approximated."""


class Pose(NamedTuple):
    """What a PoseWithCovarianceStamped holds, in the map's metres."""

    frame: str
    position: tuple[float, float, float]
    orientation: tuple[float, float, float, float]
    """x, y, z, w; turned from east towards north, as ROS counts."""
    covariance: list[float]
    """(36,) by rows: x, y, z, and the turns about them."""


class Diagnosis(NamedTuple):
    """What a DiagnosticStatus holds."""

    level: int
    message: str
    values: dict[str, str]


def fix_of(match: Match, place_map: PlaceMap) -> Fix:
    """A match as NavSatFix; one that is not stood by is no fix."""
    found = None if match.position is None else place_map.geodetic(match.position)
    variance = _variance(match)
    covariance = [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, UNKNOWN_M**2]
    if found is None or match.state not in SURE:
        return Fix(NO_FIX, math.nan, math.nan, math.nan, covariance, 0)
    return Fix(FIX, *found, math.nan, covariance, 1)


def pose_of(match: Match, place_map: PlaceMap) -> Pose | None:
    """A match as a pose; None where it has no position or is not stood by."""
    if match.position is None or match.state not in SURE:
        return None
    turn = math.radians(90.0 - (match.heading_deg or 0.0))
    variances = [_variance(match)] * 2 + [UNKNOWN_M**2, UNKNOWN_M, UNKNOWN_M, TURN_RAD2]
    if match.heading_deg is None:
        variances[5] = math.pi**2
    covariance = [0.0] * 36
    for at, variance in enumerate(variances):
        covariance[7 * at] = variance
    orientation = (0.0, 0.0, math.sin(turn / 2), math.cos(turn / 2))
    return Pose(frame_of(place_map), (*match.position, 0.0), orientation, covariance)


def frame_of(place_map: PlaceMap) -> str:
    """The frame of the map's metres: utm_10n, or map where these are of a plane of their own."""
    code = epsg(place_map)
    return "map" if code is None else f"utm_{code % 100}{'n' if code < 32700 else 's'}"


def diagnosis_of(report: Report) -> Diagnosis:
    """How the localizer is doing: a warning where it has no place or events are lost."""
    match, counters = report.match, report.counters
    level = OK if match.state in SURE else WARN
    values = {
        "state": match.state,
        "probability": f"{match.probability:.3f}",
        "latency_ms": f"{1000 * report.latency_s:.1f}",
        "event_rate": f"{report.rate:.0f}",
        "silent_s": f"{report.silent_s:.2f}",
        "backlog": str(counters.backlog),
        "skipped": str(counters.skipped),
        "overflows": str(counters.overflows),
        "recorded": str(counters.recorded),
    }
    return Diagnosis(level, match.state, values)


def _variance(match: Match) -> float:
    known = match.uncertainty_m if math.isfinite(match.uncertainty_m) else UNKNOWN_M
    return (known / SIGMAS) ** 2


class Cdr:
    """A message as ROS 2 serialises it: CDR, low byte first, each number aligned to its own width."""

    def __init__(self) -> None:
        self._data = bytearray()

    def put(self, kind: str, *values: float) -> Cdr:
        """Numbers of one struct type."""
        width = struct.calcsize(kind)
        for value in values:
            self._data += bytes(-len(self._data) % width) + struct.pack("<" + kind, value)
        return self

    def text(self, text: str) -> Cdr:
        """A string: its length with the zero byte that ends it."""
        data = text.encode() + b"\0"
        self.put("I", len(data))
        self._data += data
        return self

    def header(self, stamp_ns: int, frame: str) -> Cdr:
        """A std_msgs/Header."""
        return self.put("i", stamp_ns // 1_000_000_000).put("I", stamp_ns % 1_000_000_000).text(frame)

    def message(self) -> bytes:
        """The whole message."""
        return b"\0\1\0\0" + bytes(self._data)


def fix_message(fix: Fix, stamp_ns: int, frame: str) -> bytes:
    """A sensor_msgs/NavSatFix."""
    cdr = Cdr().header(stamp_ns, frame).put("b", fix.status).put("H", 0)
    cdr.put("d", fix.latitude, fix.longitude, fix.altitude, *fix.covariance).put("B", fix.covariance_type)
    return cdr.message()


def pose_message(pose: Pose, stamp_ns: int) -> bytes:
    """A geometry_msgs/PoseWithCovarianceStamped."""
    cdr = Cdr().header(stamp_ns, pose.frame)
    return cdr.put("d", *pose.position, *pose.orientation, *pose.covariance).message()


def diagnostics_message(diagnosis: Diagnosis, stamp_ns: int, name: str) -> bytes:
    """A diagnostic_msgs/DiagnosticArray of one status."""
    cdr = Cdr().header(stamp_ns, "").put("I", 1).put("B", diagnosis.level)
    cdr.text(name).text(diagnosis.message).text("evplace").put("I", len(diagnosis.values))
    for key, value in diagnosis.values.items():
        cdr.text(key).text(value)
    return cdr.message()


TYPES = {
    "NavSatFix": ("sensor_msgs", "62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"),
    "PoseWithCovarianceStamped": (
        "geometry_msgs",
        "26432f9803e43727d3c8f668d1fdb3c630f548af631e2f4e31382371bfea3b6e",
    ),
    "DiagnosticArray": (
        "diagnostic_msgs",
        "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    ),
}
"""Message -> its package and its type hash (REP 2016), the same from Humble to Kilted."""


class Topics:
    """Publishes reports as topics over zenoh."""

    def __init__(self, name: str, place_map: PlaceMap, router: str = "", mode: str = "client") -> None:
        """RecordingError where no router is there."""
        self._map, self._name = place_map, name.strip("/") or "evplace"
        self._session = session(router, mode)
        self._tokens: list[Any] = []  # a token lives as long as it is held
        self._fix = self._declared(f"{self._name}/fix", "NavSatFix", 1)
        self._pose = self._declared(f"{self._name}/pose", "PoseWithCovarianceStamped", 2)
        self._diagnostics = self._declared("diagnostics", "DiagnosticArray", 3)
        self._numbers = itertools.count(1)
        self._publisher = os.urandom(GID)
        self._diagnosed_s = -DIAGNOSE_S

    def publish(self, report: Report) -> None:
        """All topics of one report."""
        stamp_ns = round(report.host_s * 1e9)
        fix = fix_of(report.match, self._map)
        self._put(self._fix, fix_message(fix, stamp_ns, "event_camera"), stamp_ns)
        pose = pose_of(report.match, self._map)
        if pose is not None:
            self._put(self._pose, pose_message(pose, stamp_ns), stamp_ns)
        if time.monotonic() >= self._diagnosed_s + DIAGNOSE_S:
            self._diagnosed_s = time.monotonic()
            status = diagnostics_message(diagnosis_of(report), stamp_ns, f"{self._name}: localizer")
            self._put(self._diagnostics, status, stamp_ns)

    def close(self) -> None:
        """Leave."""
        leave(self._session)

    def _put(self, publisher: Any, data: bytes, stamp_ns: int) -> None:
        publisher.put(data, attachment=attachment(next(self._numbers), stamp_ns, self._publisher))

    def _declared(self, topic: str, kind: str, entity: int) -> Any:
        """A publisher, and the token by which ROS nodes find it."""
        package, digest = TYPES[kind]
        named = f"{package}::msg::dds_::{kind}_/RIHS01_{digest}"
        token = (
            f"@ros2_lv/0/{self._session.info.zid()}/0/{entity}/MP/%/%/{self._name.replace('/', '_')}/"
            f"%{topic.replace('/', '%')}/{named}/::,10:,:,:,,"
        )
        self._tokens.append(self._session.liveliness().declare_token(token))
        return self._session.declare_publisher(f"0/{topic}/{named}")
