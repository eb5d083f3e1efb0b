"""A table with a header line: all matches, what is unknown left empty."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator

from evplace.exports import Located

ABOUT = "a table with a line for each match"
SUFFIX = ".csv"
NEEDS = ""
COLUMNS = (
    "t_us", "place", "easting", "northing", "score", "state", "latitude", "longitude", "heading_deg",
    "probability", "uncertainty_m", "compared",
)  # fmt: skip


def lines(found: Iterable[Located]) -> Iterator[str]:
    """The columns' names, then a line a match."""
    yield _line(COLUMNS)
    yield from map(_line, map(_row, found))


def _row(one: Located) -> list[object]:
    match = one.match
    easting, northing = match.position or (math.nan, math.nan)
    heading = math.nan if match.heading_deg is None else match.heading_deg
    return [
        match.t_us, match.place, _shown(easting, ".2f"), _shown(northing, ".2f"), _shown(match.score, ".6g"),
        match.state, _shown(one.latitude, ".7f"), _shown(one.longitude, ".7f"), _shown(heading, ".1f"),
        _shown(match.probability, ".4f"), _shown(match.uncertainty_m, ".1f"),
        match.compared,
    ]  # fmt: skip


def _line(cells: Iterable[object]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="").writerow(cells)
    return text.getvalue()


def _shown(value: float, form: str) -> str:
    return "" if math.isnan(value) else f"{value:{form}}"
