"""Panels of precision and recall: from curves that were swept, or from the results themselves."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from evplace.evaluation import Result
from evplace_lab.report._found import Curve, Found, PaperCurve

MOST_CURVES = 8
"""Curves in a panel of results: more cannot be told apart."""
CLOSE = 0.002
"""Points nearer than this in recall and in precision look like one."""
STYLES = ("solid", "thin", "dotted", "dashdot")
"""How the curves of the first, the second ... input are drawn; those of further ones as the last."""
PAPER = "dashed"
"""How the paper's curves are drawn."""

Point = tuple[float, float, float | None]
"""Recall, precision and the value of the parameter, None where it is not known."""


@dataclass(frozen=True)
class Line:
    """One curve of a panel."""

    label: str
    points: list[Point]
    parameter: str = ""
    """What is swept."""
    average_precision: float | None = None
    spread: float | None = None
    colour: int = 0
    """Number of its colour: one a method, the paper's included."""
    style: str = STYLES[0]
    """One of STYLES for each input, or PAPER."""


@dataclass(frozen=True)
class Panel:
    """Curves that belong side by side."""

    title: str
    lines: list[Line]


def panels(found: Found) -> list[Panel]:
    """The panels of figure5.json; without it, one of the results with the highest average precision."""
    if found.curves is not None:
        curves: Sequence[Curve] = found.curves.rows
        papers: Sequence[PaperCurve] = found.curves.others
        names = dict.fromkeys([*(curve.panel for curve in curves), *(curve.panel for curve in papers)])
        return [_panel(name, curves, papers) for name in names]
    if len(found.results) < 2:
        return []
    ranked = sorted(found.results.items(), key=lambda pair: -(pair[1].figures["average_precision"] or 0))
    title = (
        "All results"
        if len(ranked) <= MOST_CURVES
        else f"The {MOST_CURVES} results of highest average precision"
    )
    lines = [result_line(name, result) for name, result in ranked[:MOST_CURVES]]
    return [Panel(title, [replace(line, colour=number) for number, line in enumerate(lines)])]


def result_line(label: str, result: Result) -> Line:
    """A result's exact curve, without points that nobody could see apart."""
    points = [(recall, precision, value) for value, precision, recall, _ in result.curve.tolist()]
    average = result.figures["average_precision"]
    return Line(f"{label}, {result.timing}", _visible(points), "threshold", average)


def _panel(name: str, curves: Sequence[Curve], papers: Sequence[PaperCurve]) -> Panel:
    chosen = [curve for curve in curves if curve.panel == name]
    theirs = [curve for curve in papers if curve.panel == name]
    methods = list(dict.fromkeys(curve.matcher for curve in chosen))
    lines = [_line(curve, chosen, methods) for curve in chosen]
    lines += [_paper_line(curve, methods) for curve in theirs]
    queries = list(dict.fromkeys(curve.query for curve in chosen if curve.query))
    return Panel(f"{name} ({', '.join(queries)})" if queries else name, lines)


def _line(curve: Curve, beside: Sequence[Curve], methods: list[str]) -> Line:
    """A curve among those `beside` it: its colour tells the method, its style the input."""
    kinds = list(dict.fromkeys((other.input, other.sensor) for other in beside))
    several = sum(name == curve.input for name, _ in kinds) > 1
    sensor = f" ({curve.sensor})" if several else ""
    return Line(
        label=f"{curve.input}{sensor}, {curve.matcher}, {curve.answers}".removeprefix(", "),
        points=_known((point[1], point[2], point[0]) for point in curve.points),
        parameter=curve.parameter,
        average_precision=curve.average_precision,
        spread=curve.spread,
        colour=methods.index(curve.matcher),
        style=STYLES[min(kinds.index((curve.input, curve.sensor)), len(STYLES) - 1)],
    )


def _paper_line(curve: PaperCurve, methods: list[str]) -> Line:
    """The paper's curve, in the colour of our method that is named like it; `methods` grows by new ones."""
    method = curve.method.partition(",")[0]
    alike = next((name for name in methods if name.lower().startswith(method.lower())), None)
    if alike is None:
        methods.append(method)
    points = _known((*point[:2], None) for point in curve.points)
    return Line(f"paper: {curve.method}", points, colour=methods.index(alike or method), style=PAPER)


def _known(points: Iterable[tuple[float | None, ...]]) -> list[Point]:
    """Points whose recall and precision are numbers."""
    return [
        (float(recall), float(precision), value)
        for recall, precision, value in points
        if recall is not None and precision is not None
    ]


def _visible(points: list[tuple[float, float, float]]) -> list[Point]:
    """Those of a curve's points that are apart from the last one kept; the last always."""
    kept: list[Point] = []
    for number, (recall, precision, value) in enumerate(points):
        if math.isnan(recall) or math.isnan(precision):
            continue
        moved = not kept or max(abs(recall - kept[-1][0]), abs(precision - kept[-1][1])) >= CLOSE
        if moved or number == len(points) - 1:
            kept.append((recall, precision, value if math.isfinite(value) else None))
    return kept
