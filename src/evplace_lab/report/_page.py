"""The page: parts put together into one HTML file that needs nothing beside it."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace import __version__
from evplace.evaluation import OUTCOMES, Result, flat
from evplace_lab.report import _tables
from evplace_lab.report._found import Found, Sheet
from evplace_lab.report._html import Html, join, tag
from evplace_lab.report._panels import Line, Panel, panels, result_line
from evplace_lab.report._pictures import Shown, sample_images, similarity_image
from evplace_lab.report._reliability import drawings

SCRIPTS = ("plots.js", "page.js")
"""In the order in which they stand in the page."""


def page(found: Found, remark: str | None = None) -> str:
    """The whole page as text; `remark` stands at its top."""
    style, script = _file("page.css"), "".join(map(_file, SCRIPTS))
    drawn = panels(found)
    parts = {
        "title": join(found.name),
        "subtitle": tag("p", _tables.subtitle(found), class_="subtitle"),
        "remark": tag("p", remark, class_="remark") if remark else "",
        "headline": _tables.headline(found),
        "sections": _sections(found, drawn),
        "data": _inline_json(_data(found, drawn)),
        "version": __version__,
        "style": style,
        "script": script,
        "style_hash": _hash(style),
        "script_hash": _hash(script),
    }
    return Template(_file("page.html")).substitute(parts)


def _sections(found: Found, drawn: list[Panel]) -> Html:
    table, changes, results = found.table, found.ablations, found.results
    reliable = drawings(results)
    return join(
        _accuracies("table", table, "Accuracy") if table else None,
        _accuracies("real", found.real, "Accuracy on real sets") if found.real else None,
        _section("curves", "Precision and recall", tag("div", id="panels"), _tables.lacking(found))
        if drawn
        else None,
        _section("reliability", "Reliability", reliable) if reliable else None,
        _section("ablations", "Ablations", _tables.ablations(changes.rows)) if changes else None,
        _section("look", "A closer look", tag("div", id="look-at")) if results else None,
        _section("results", "All results, in %", _tables.overview(results)) if len(results) > 1 else None,
        _section("making", "How this was made", *_making(found))
        if table or found.real or found.curves or changes
        else None,
    )


def _accuracies(name: str, sheet: Sheet, otherwise: str) -> Html:
    title = str(sheet.rest.get("title") or otherwise)
    return _section(name, title, _tables.accuracies(sheet.rows))


def _section(name: str, title: str, *inside: str) -> Html:
    return tag(
        "section", tag("h2", title, id=f"{name}-title"), *inside, id=name, aria_labelledby=f"{name}-title"
    )


def _making(found: Found) -> list[Html]:
    sheets = {
        "Table": found.table,
        "Real sets": found.real,
        "Curves": found.curves,
        "Ablations": found.ablations,
    }
    return [_details(name, sheet) for name, sheet in sheets.items() if sheet is not None]


def _details(name: str, sheet: Sheet) -> Html:
    took = sheet.rest.get("took_s")
    words = f"{name}: settings and versions" + (f", {took:,.0f} s" if isinstance(took, int | float) else "")
    return tag("details", tag("summary", words), _tables.facts(sheet.rest))


def _data(found: Found, drawn: list[Panel]) -> dict[str, Any]:
    """All that the scripts draw."""
    shown = sample_images(found.results)
    positions = _Positions(found.results)
    results = [
        _result(name, result, positions, shown.get(name, [])) for name, result in found.results.items()
    ]
    return {
        "panels": [{"title": one.title, "lines": [_line(line) for line in one.lines]} for one in drawn],
        "outcomes": OUTCOMES,
        "best": _tables.best_of(found.results),
        "results": results,
        "positions": positions.kept,
    }


def _result(name: str, result: Result, positions: _Positions, shown: Shown) -> dict[str, Any]:
    return {
        "name": name,
        "answers": _tables.TIMINGS.get(result.timing, result.timing),
        "figures": {key: _rounded(value) for key, value in result.figures.items()},
        "settings": flat(result.settings),
        "versions": result.versions,
        "took_s": result.took_s,
        "curve": _line(result_line(name, result)),
        "item": result.answers.item.tolist(),
        "true": None if result.true_item is None else result.true_item.tolist(),
        "outcome": result.outcome.tolist(),
        "query_xy": positions.add(result.query_xy),
        "item_xy": positions.add(result.item_xy),
        "samples": shown,
        "similarity": similarity_image(result),
    }


class _Positions:
    """Positions as they stand in the page: metres from one corner, each array once however many share it."""

    def __init__(self, results: Mapping[str, Result]) -> None:
        """All results of a page have the same corner."""
        arrays = [xy for one in results.values() for xy in (one.query_xy, one.item_xy) if xy is not None]
        self._corner = np.min([np.nanmin(xy, axis=0) for xy in arrays], axis=0) if arrays else np.zeros(2)
        self._numbers: dict[bytes, int] = {}
        self.kept: list[list[list[float | None]]] = []
        """[[x, y] ...] each, null where unknown."""

    def add(self, xy: NDArray[np.float64] | None) -> int | None:
        """The number of these positions (n, 2) in `kept`."""
        if xy is None:
            return None
        key = xy.tobytes()
        if key not in self._numbers:
            self._numbers[key] = len(self.kept)
            here = np.round(xy - self._corner, 1).tolist()
            self.kept.append([[None if value != value else value for value in pair] for pair in here])
        return self._numbers[key]


def _line(line: Line) -> dict[str, Any]:
    return {
        "label": line.label,
        "points": [[_rounded(number) for number in point] for point in line.points],
        "parameter": line.parameter,
        "ap": _rounded(line.average_precision),
        "spread": _rounded(line.spread),
        "colour": line.colour,
        "style": line.style,
    }


def _rounded(value: Any) -> Any:
    """Floats to five figures: more cannot be seen."""
    return float(f"{value:.5g}") if isinstance(value, float) else value


def _inline_json(value: object) -> str:
    """JSON that cannot end the script element it stands in, nor open a comment in it."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def _hash(text: str) -> str:
    """What the page's own policy lets run: this text and nothing else."""
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")


def _file(name: str) -> str:
    return (Path(__file__).parent / name).read_text("utf-8")
