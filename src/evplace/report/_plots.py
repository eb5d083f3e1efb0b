"""The PNG plots beside a page."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from evplace import charts
from evplace.report._found import Found, TableRow
from evplace.report._panels import Panel, panels, result_line


def plots(found: Found, page: Path) -> list[Path]:
    """Draw what is there beside `page`, named after it; the route and the items of the first result.

    Raises MissingExtraError without matplotlib.
    """
    made = []

    def named(what: str) -> Path:
        made.append(page.with_name(f"{page.stem}-{what}.png"))
        return made[-1]

    if found.table is not None and found.table.rows:
        charts.bars_chart(_bars(found.table.rows), named("accuracy"))
    drawn = panels(found)
    for panel in drawn:
        what = f"curves-{_slug(panel.title)}" if found.curves is not None else "curves"
        charts.curves_chart(panel.title, _curves(panel), named(what))
    if found.results:
        name, result = next(iter(found.results.items()))
        if not drawn:
            charts.curves_chart("", _curves(Panel("", [result_line(name, result)])), named("curves"))
        charts.confusion_chart(result, named("items"))
        if result.query_xy is not None:
            charts.route_chart(result, named("route"))
    return made


def _bars(rows: tuple[TableRow, ...]) -> dict[str, list[dict[str, object]]]:
    """Matcher -> bars of the first rule."""
    groups: dict[str, list[dict[str, object]]] = {}
    chosen = [row for row in rows if row.rule == rows[0].rule]
    for row in chosen:
        several = len({other.sensor for other in chosen if other.input == row.input}) > 1
        label = f"{row.input}, {row.sensor}" if several else row.input
        bar = {"query": row.query, "label": label, "mean": row.mean, "spread": row.spread, "paper": row.paper}
        groups.setdefault(row.matcher, []).append(bar)
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
