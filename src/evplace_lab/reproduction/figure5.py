"""The paper's Figure 5: precision against recall in four panels, on events and on colour.

Two are of the city, day to night and day to rain. Oxford and the campus are real sets, drawn by their
adapters where their data are there; else the panel says what it needs.

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
from evplace_lab.reproduction._panels import Panels
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
    folder: str = ""
    """Of a real set: its folder below that of the data; empty for the city's drives."""
    dataset: str = ""
    """Its name, as `evplace list datasets` has it."""
    needs: str = ""
    """What must lie there, for people."""
    command: str = ""
    """What draws the panel then."""

    def drive(self, name: str) -> str:
        """A drive's name as `Panels` takes it."""
        return f"{self.folder}: {self.dataset}: {name}" if self.folder else name


def cases(drives: Drives, choice: Choice) -> list[Case]:
    """All curves, one a seed."""
    return [case for _, _, _, group in _curves(drives, choice) for case in group]


def collect(drives: Drives, runs: Runs, choice: Choice) -> dict[str, Any]:
    """The curves of the first seed, with the average precision over all; and what lacks its data."""
    curves = []
    for recipe, name, method, group in _curves(drives, choice):
        outcomes = [runs.found(case) for case in group]
        about = {"panel": recipe.panel, "query": recipe.query, "input": name, "sensor": inputs()[name].sensor}
        about |= {"matcher": method, "parameter": group[0].matcher_part.sweep().parameter}
        live, late = (_curve_of(outcomes, timing) for timing in TIMINGS)
        found = [live] if live == {**late, "answers": "live"} else [live, late]
        curves += [{**about, **curve} for curve in found]
    paper = [{"panel": recipe.panel, **curve} for recipe in _chosen() for curve in recipe.paper]
    lacking = [
        {"panel": recipe.panel, "needs": recipe.needs, "command": recipe.command}
        for recipe in _chosen()
        if not _is_there(recipe, drives)
    ]
    return {"format": FORMAT, "title": TITLE, "curves": curves, "paper": paper, "lacking": lacking}


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
    if document["lacking"]:
        lines = [[one["panel"], one["needs"], one["command"]] for one in document["lacking"]]
        yield Table("Needs data", ["panel", "what", "then"], lines)


def _is_there(recipe: Recipe, drives: Drives) -> bool:
    """Whether a panel can be drawn: the city is made where it is lacking, a real set is not."""
    if not recipe.folder:
        return True
    wanted = (recipe.database, recipe.query)
    return isinstance(drives, Panels) and drives.has(recipe.folder, recipe.dataset, wanted)


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


def _curves(drives: Drives, choice: Choice) -> Iterator[tuple[Recipe, str, str, list[Case]]]:
    """Each panel, input and method with its cases: one a seed, or one where nothing is trained."""
    for recipe in (recipe for recipe in _chosen() if _is_there(recipe, drives)):
        for name in recipe.inputs:
            if choice.inputs and name not in choice.inputs:
                continue
            for method in (*recipe.methods, *choice.methods):
                how = (methods() | choice.methods)[method]
                drives_of = (recipe.drive(recipe.database), recipe.drive(recipe.query))
                first = Case.of(*drives_of, inputs()[name], how, choice.train)
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
