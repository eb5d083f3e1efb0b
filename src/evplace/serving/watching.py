"""The same as the page, line by line in a terminal."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.serving._report import Report
from evplace.serving.service import Service
from evplace.sources.live import Live

EVERY_S = 0.5
"""Seconds between two lines that say the same state and place."""

Print = Callable[[str], object]


class Lines:
    """Prints a line for each new state and place, and every EVERY_S in between."""

    def __init__(self, place_map: PlaceMap, say: Print) -> None:
        self._map, self._say = place_map, say
        self._said: tuple[str, int] | None = None
        self._said_s = -math.inf

    def publish(self, report: Report) -> None:
        """A report; called on the drive's thread."""
        match = report.match
        if (match.state, match.place) == self._said and report.host_s < self._said_s + EVERY_S:
            return
        self._said, self._said_s = (match.state, match.place), report.host_s
        self._say(line(report, self._map))


def line(report: Report, place_map: PlaceMap) -> str:
    """One report as a line of fixed columns, so that changes meet the eye."""
    match, counters = report.match, report.counters
    where = None if match.position is None else place_map.geodetic(match.position)
    columns = (
        f"{match.t_us / 1e6:9.2f} s",
        f"{match.state:<10}",
        f"place {match.place:<5}" if match.place >= 0 else " " * 11,
        _known(100 * match.probability, "{:3.0f} %", 5),
        _known(match.uncertainty_m, "± {:.1f} m", 10),
        "" if where is None else f"{where[0]:.6f}, {where[1]:.6f}",
        _known(math.nan if match.heading_deg is None else match.heading_deg, "{:3.0f}°", 4),
        _known(1000 * report.latency_s, "{:.1f} ms", 9),
        f"{report.rate / 1e6:6.2f} Mev/s",
        f"skipped {counters.skipped:,}" if counters.skipped else "",
    )
    return "  ".join(columns).rstrip()


def watch(where: Localizer, source: Live, path: Path, name: str) -> str | None:
    """Localise a source until it ends, a line now and then; returns what ended it, if not well."""
    lines = Lines(where.map, lambda text: print(text, flush=True))
    service = Service(where, source, path, name, outputs=[lines.publish])
    service.start()
    try:
        while not service.drive.ended.wait(0.2):
            pass
    finally:
        service.close()
    return service.drive.fault


def _known(value: float, form: str, width: int) -> str:
    return f"{form.format(value) if math.isfinite(value) else '':>{width}}"
