"""The PNG plots beside a page."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from evplace.core.drawing import check_drawing
from evplace.evaluation import charts
from evplace_lab.report._found import Found, TableRow
from evplace_lab.report._panels import Panel, panels, result_line


def plots(found: Found, page: Path) -> dict[Path, Callable[[Path], None]]:
    """File -> what draws it: beside `page`, named after it; the route and the items are the first result's.

    Raises MissingExtraError without matplotlib.
    """
    check_drawing()
    made: dict[Path, Callable[[Path], None]] = {}

    def add(what: str, draw: Callable[[Path], None]) -> None:
        ends = itertools.chain([""], (f"-{n}" for n in itertools.count(2)))  # of panels named alike
        files = (page.with_name(f"{page.stem}-{what}{end}.png") for end in ends)
        made[next(file for file in files if file not in made)] = draw

    if found.table is not None and found.table.rows:
        add("accuracy", partial(charts.bars_chart, _bars(found.table.rows)))
    drawn = panels(found)
    for panel in drawn:
        what = f"curves-{_slug(panel.title)}" if found.curves is not None else "curves"
        add(what, partial(charts.curves_chart, panel.title, _curves(panel)))
    if found.results:
        name, result = next(iter(found.results.items()))
        if not drawn:
            add("curves", partial(charts.curves_chart, "", _curves(Panel("", [result_line(name, result)]))))
        add("items", partial(charts.confusion_chart, result))
        if result.query_xy is not None:
            add("route", partial(charts.route_chart, result))
    return made


def _bars(rows: tuple[TableRow, ...]) -> dict[str, list[dict[str, object]]]:
    """Matcher -> bars of the first rule."""
    groups: dict[str, list[dict[str, object]]] = {}
    chosen = [row for row in rows if row.rule == rows[0].rule]
    for row in chosen:
        several = len({other.sensor for other in chosen if other.input == row.input}) > 1
        label = f"{row.input}, {row.sensor}" if several else row.input
        bar = {"query": row.query, "label": label, "mean": row.mean, "spread": row.spread, "paper": row.paper}
        groups.setdefault(f"{row.matcher}, {row.answers}", []).append(bar)
    return groups


def _curves(panel: Panel) -> list[charts.Curve]:
    curves = []
    for line in panel.lines:
        area = "" if line.average_precision is None else f" (AP {line.average_precision:.3f})"
        points = np.array([point[:2] for point in line.points], np.float64).reshape(-1, 2)
        curves.append((line.label + area, points, line.colour, line.style))
    return curves


def _slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") or "all"
