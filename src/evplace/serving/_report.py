"""Report: one answer with all that is known of it, as the page, JSON lines and the other outputs say it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from evplace.localizer import SURE, Match
from evplace.placemap import PlaceMap
from evplace.serving._feed import Counters

RUNNERS_UP = 5


@dataclass(frozen=True)
class Report:
    """A match, when and how late it was known, and what had happened to the events by then."""

    match: Match
    host_s: float
    """When it was known, in seconds since 1970 by the host's clock."""
    latency_s: float
    """Seconds from the arrival of the events that ended the window; NaN where time ended it."""
    rate: float
    """Events a second that came lately."""
    silent_s: float
    """Seconds since the last events."""
    counters: Counters


class Describer:
    """Writes reports of one map's matches."""

    def __init__(self, place_map: PlaceMap, sha256: str) -> None:
        self._map, self._sha256 = place_map, sha256
        self._last: dict[str, Any] | None = None

    def values(self, report: Report) -> dict[str, Any]:
        """The report as JSON has it; null where something is unknown."""
        match = report.match
        self._last = self._stood_by(match) or self._last
        return {
            "t_us": match.t_us,
            "host_s": round(report.host_s, 6),
            "state": match.state,
            "place": _known(match.place),
            "item": _known(match.item),
            **self._position(match.position),
            "heading_deg": _number(match.heading_deg, 1),
            "uncertainty_m": _number(match.uncertainty_m, 2),
            "probability": _number(match.probability, 4),
            "score": _number(match.score, 6),
            "last": self._last,
            "others": [self._other(item) for item in match.others[:RUNNERS_UP]],
            "map_sha256": self._sha256,
            "latency_ms": _number(1000 * report.latency_s, 2),
            "rate": round(report.rate),
            "silent_s": round(report.silent_s, 2),
            **counted(report.counters),
        }

    def text(self, values: dict[str, Any]) -> str:
        """Values as one line of JSON."""
        return json.dumps(values, allow_nan=False)

    def _stood_by(self, match: Match) -> dict[str, Any] | None:
        """Where the camera was, if that is stood by: it holds while nothing else is known."""
        if match.state not in SURE:
            return None
        return {"t_us": match.t_us, "place": _known(match.place), **self._position(match.position)}

    def _position(self, position: tuple[float, float] | None) -> dict[str, Any]:
        """Easting and northing with their EPSG code, and latitude and longitude where the map has a zone."""
        found = None if position is None else self._map.geodetic(position)
        easting, northing = position or (None, None)
        latitude, longitude = found or (None, None)
        return {
            "easting": _number(easting, 2),
            "northing": _number(northing, 2),
            "epsg": epsg(self._map),
            "latitude": _number(latitude, 8),
            "longitude": _number(longitude, 8),
        }

    def _other(self, item: int) -> dict[str, Any]:
        easting, northing = self._map.items.position[item]
        return {
            "item": int(item),
            "place": _known(int(self._map.items.place[item])),
            "easting": _number(float(easting), 2),
            "northing": _number(float(northing), 2),
        }


def counted(counters: Counters) -> dict[str, Any]:
    """The counters as JSON has them."""
    return {
        "backlog": counters.backlog,
        "skipped": counters.skipped,
        "overflows": counters.overflows,
        "recorded": counters.recorded,
    }


def epsg(place_map: PlaceMap) -> int | None:
    """The EPSG code of the map's UTM zone on WGS 84; None for a map without one."""
    if place_map.zone is None or not place_map.zone[0]:
        return None
    zone, northern = place_map.zone
    return (32600 if northern else 32700) + zone


def _known(index: int) -> int | None:
    return None if index < 0 else index


def _number(value: float | None, digits: int) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, digits)
