"""The paper's Table 2: accuracy of every method on five queries, on events and on colour.

Beside the paper's four methods stand plain correlations, and colour under better conditions than the paper
gives it. Accuracy is by two rules: by places, the paper's, and by view (see `evplace.evaluation._evaluate`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

from evplace_lab.reproduction import Choice, Drives, Table
from evplace_lab.reproduction._cases import Case
from evplace_lab.reproduction._figures import label_of, rows_of, shown
from evplace_lab.reproduction._recipes import inputs, methods, recipes
from evplace_lab.reproduction._runs import Runs

TITLE = "Table 2: accuracy in % of live answers, and of hindsight where it is said; map: day, path 1"
NEEDS = "city"
INPUTS = tuple(inputs())
METHODS = tuple(methods())
FORMAT = "evplace-table-1"
KEPT_INPUTS = ("events", "events, from 8 bit", "colour")
KEPT_METHODS = (
    "best", "global-max", "network, tuned", "Algorithm 1", "SeqSLAM, all accepted", "graph, alpha 0.1",
    "blurred correlation, sequence",
)  # fmt: skip
"""Of these the whole result is kept, with the first seed."""
MAIN_INPUTS = ("events", "events, from 8 bit", "events, weak sensor", "colour")
RULES = {"places": "the paper's rule, -1 right where the map has no place", "view": "known only by view"}


@dataclass(frozen=True)
class Recipe:
    """A row of the paper's table."""

    order: int
    """Its place in the table."""
    database: str
    """The drive that is learned."""
    query: str
    """The drive that is looked for."""
    paper: dict[str, Any] = field(default_factory=dict)
    """Method -> events and colour -> the paper's accuracy in %."""


def cases(_: Drives, choice: Choice) -> list[Case]:
    """All cells of the table."""
    return [case for _, _, _, group in _cells(choice) for case in group]


def collect(_: Drives, runs: Runs, choice: Choice) -> dict[str, Any]:
    """The table as plain values: a row for each query, input, method and rule."""
    rows = []
    for recipe, name, method, group in _cells(choice):
        outcomes = [runs.found(case) for case in group]
        seen = inputs()[name]
        about = {"database": recipe.database, "query": recipe.query, "input": name, "sensor": seen.sensor}
        for rule in RULES:
            paper = recipe.paper.get(method, {}).get(seen.paper) if rule == "places" else None
            found = rows_of(outcomes, rule)
            rows += [{**about, "matcher": method, **row, "paper": paper} for row in found]
    return {"format": FORMAT, "title": TITLE, "rows": rows}


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """The table for people: by both rules, on the seen alone, what is rejected, and colour's fair chance."""
    rows = document["rows"]
    main = [row for row in rows if row["input"] in MAIN_INPUTS]
    fair = [row for row in rows if row["input"] not in MAIN_INPUTS or row["input"] == "colour"]
    for rule, words in RULES.items():
        yield from _table(f"Accuracy in %, {words}", [row for row in main if row["rule"] == rule], "mean")
    by_places = [row for row in main if row["rule"] == "places"]
    yield from _table("Accuracy in % on queries of places that the map has", by_places, "seen")
    yield from _table("Rejected queries in %", by_places, "rejected")
    if any(row["input"] != "colour" for row in fair):
        for rule, words in RULES.items():
            of_rule = [row for row in fair if row["rule"] == rule]
            yield from _table(f"Colour's fair chance: accuracy in %, {words}", of_rule, "mean")


def _cells(choice: Choice) -> Iterator[tuple[Recipe, str, str, list[Case]]]:
    """Each row, input and method with its cases: one a seed, or one where nothing is trained."""
    for recipe in recipes("table2", Recipe):
        for name in choice.inputs or inputs():
            for method, how in (methods() | choice.methods).items():
                first = Case.of(recipe.database, recipe.query, inputs()[name], how, choice.train)
                if inputs()[name].train and first.train is None:
                    continue  # another training is no other input to what is not trained
                if inputs()[name].sensor == "camera" and not how.for_camera:
                    continue
                group = first.with_seeds(choice.seeds)
                if name in KEPT_INPUTS and method in (*KEPT_METHODS, *choice.methods):
                    group[0] = replace(group[0], keep=f"{recipe.query}, {name}, {method}")
                yield recipe, name, method, group


def _table(title: str, rows: list[dict[str, Any]], figure: str) -> Iterator[Table]:
    """One table of a figure; none without rows."""
    if not rows:
        return
    names = list(dict.fromkeys(row["input"] for row in rows))
    matchers = list(dict.fromkeys(map(label_of, rows)))
    cells = {(row["query"], label_of(row), row["input"]): row for row in rows}
    lines = []
    for query in dict.fromkeys(row["query"] for row in rows):
        if figure == "mean":
            chances = [cells[query, matchers[0], name]["chance"] for name in names]
            lines.append([query, "chance", *(f"{chance:.1f}" for chance in chances), ""])
        for matcher in matchers:
            if not any((query, matcher, name) in cells for name in names):
                continue
            line = [cells.get((query, matcher, name)) for name in names]
            paper = _paper([cell for cell in line if cell is not None]) if figure == "mean" else ""
            lines.append(
                [query, matcher, *("-" if cell is None else shown(cell, figure) for cell in line), paper]
            )
    columns = ["query", "method", *names, "paper"]
    if not any(line[-1] for line in lines):  # only the first table has the paper's numbers
        columns, lines = columns[:-1], [line[:-1] for line in lines]
    yield Table(title, columns, lines)


def _paper(line: list[dict[str, Any]]) -> str:
    """The paper's numbers for events and for colour, beside our inputs of that name."""
    theirs = {inputs()[cell["input"]].paper: cell["paper"] for cell in line if cell["paper"] is not None}
    return ", ".join(f"{theirs[kind]:.1f}" for kind in ("events", "colour") if kind in theirs)
