"""The paper's Figure 5: precision against recall, day to night and day to rain, on events and on colour.

Swept are tau1, mu and m, as in the paper (5.2), at every value that changes an answer. Recall is of the
queries whose place the map has. tau1 touches only queries that fail the local test, so its curve need not
reach a recall of zero: where it begins is told. Average precision is the sum of precision times the gain in
recall, from zero on; a curve that begins later is given its first precision up to there.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace_lab.reproduction import Choice, Drives, Table
from evplace_lab.reproduction._cases import Case
from evplace_lab.reproduction._figures import deviation, label_of
from evplace_lab.reproduction._recipes import inputs, methods, recipes
from evplace_lab.reproduction._runs import TIMINGS, Runs

TITLE = "Figure 5: precision against recall of live answers, and of hindsight where it is said"
NEEDS = "city"
INPUTS = ("events", "events, from 8 bit", "colour")
METHODS = tuple(methods())
FORMAT = "evplace-curves-1"


@dataclass(frozen=True)
class Recipe:
    """A panel of the figure."""

    order: int
    """Its place in the figure."""
    panel: str
    """Its name."""
    database: str
    """The drive that is learned."""
    query: str
    """The drive that is looked for."""
    inputs: tuple[str, ...]
    """What the methods see."""
    methods: tuple[str, ...]
    """How places are found."""
    paper: tuple[Any, ...] = field(default=())
    """Curves of the paper: method, and points (recall, precision)."""


def cases(_: Drives, choice: Choice) -> list[Case]:
    """All curves, one a seed."""
    return [case for _, _, _, group in _curves(choice) for case in group]


def collect(_: Drives, runs: Runs, choice: Choice) -> dict[str, Any]:
    """The curves of the first seed, with the average precision over all."""
    curves = []
    for recipe, name, method, group in _curves(choice):
        outcomes = [runs.found(case) for case in group]
        about = {"panel": recipe.panel, "query": recipe.query, "input": name, "sensor": inputs()[name].sensor}
        about |= {"matcher": method, "parameter": group[0].matcher_part.sweep().parameter}
        live, late = (_curve_of(outcomes, timing) for timing in TIMINGS)
        found = [live] if live == {**late, "answers": "live"} else [live, late]
        curves += [{**about, **curve} for curve in found]
    paper = [{"panel": recipe.panel, **curve} for recipe in _chosen() for curve in recipe.paper]
    return {"format": FORMAT, "title": TITLE, "curves": curves, "paper": paper}


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """For each panel average precision over the seeds, and where the first seed's curve begins and ends."""
    for panel in dict.fromkeys(curve["panel"] for curve in document["curves"]):
        lines = []
        for curve in (curve for curve in document["curves"] if curve["panel"] == panel):
            spread = f" ± {curve['spread']:.3f}" if curve["spread"] is not None else ""
            ends = [f"{point[1]:.2f}, {point[2]:.2f}" for point in (curve["points"] or [[0, 0, 0]])]
            average = f"{curve['average_precision']:.3f}{spread}"
            points = str(len(curve["points"]))
            lines.append(
                [curve["input"], label_of(curve), curve["parameter"], average, ends[0], ends[-1], points]
            )
        columns = ["input", "method", "swept", "average precision", "from recall, precision", "to", "points"]
        yield Table(f"Precision against recall, {panel}", columns, lines)


def average_precision(curve: NDArray[np.float64]) -> float:
    """Of points (n, 3) value, recall and precision in the order of recall."""
    return float(np.sum(np.diff(curve[:, 1], prepend=0.0) * curve[:, 2]))


def _curve_of(outcomes: list[dict[str, Any]], timing: str) -> dict[str, Any]:
    points = [np.array(outcome[timing]["places"]["curve"]).reshape(-1, 3) for outcome in outcomes]
    average = [average_precision(curve) for curve in points]
    return {
        "answers": timing,
        "points": [[float(f"{value:.5g}") for value in point] for point in _corners(points[0]).tolist()],
        "average_precision": float(np.mean(average)),
        "spread": deviation(average),
        "seeds": len(average),
    }


def _curves(choice: Choice) -> Iterator[tuple[Recipe, str, str, list[Case]]]:
    """Each panel, input and method with its cases: one a seed, or one where nothing is trained."""
    for recipe in _chosen():
        for name in recipe.inputs:
            if choice.inputs and name not in choice.inputs:
                continue
            for method in (*recipe.methods, *choice.methods):
                how = (methods() | choice.methods)[method]
                first = Case.of(recipe.database, recipe.query, inputs()[name], how, choice.train)
                yield (
                    recipe,
                    name,
                    method,
                    [dataclasses.replace(case, swept=True) for case in first.with_seeds(choice.seeds)],
                )


def _chosen() -> list[Recipe]:
    return recipes("figure5", Recipe)


def _corners(curve: NDArray[np.float64]) -> NDArray[np.float64]:
    """The points without those on a straight line between their neighbours in recall: equal precision."""
    if len(curve) < 3:
        return curve
    same = (curve[1:-1, 2] == curve[:-2, 2]) & (curve[1:-1, 2] == curve[2:, 2])
    same |= (curve[1:-1, 1:] == curve[:-2, 1:]).all(axis=1)
    kept: NDArray[np.float64] = curve[np.concatenate([[True], ~same, [True]])]
    return kept
