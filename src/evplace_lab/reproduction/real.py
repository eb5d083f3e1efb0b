"""Real sets: how often the best item is right, by each set's own truth.

They have no positions; each image of the drive that is learned is a place. The network is trained as the
paper says. An answer that a method does not stand by is wrong: there is nothing unseen in these drives.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from evplace_lab.reproduction import Choice, Drives, Table
from evplace_lab.reproduction._cases import Case, Input
from evplace_lab.reproduction._figures import label_of, rows_of, shown
from evplace_lab.reproduction._real_sets import RealSet, RealSets
from evplace_lab.reproduction._recipes import real_methods
from evplace_lab.reproduction._runs import Runs

TITLE = "Real drives: accuracy in % of live answers, and of hindsight where it is said"
NEEDS = "data"
INPUTS: tuple[str, ...] = ()
METHODS = tuple(real_methods())
FORMAT = "evplace-table-1"


def cases(drives: Drives, choice: Choice) -> list[Case]:
    """All cells of the table, of the sets that are there."""
    return [case for _, _, group in _cells(drives, choice) for case in group]


def collect(drives: Drives, runs: Runs, choice: Choice) -> dict[str, Any]:
    """The table as plain values: a row for each set, method and rule."""
    rows = []
    for real, method, group in _cells(drives, choice):
        outcomes = [runs.found(case) for case in group]
        about = {"database": real.reference, "query": real.title, "input": "images", "sensor": real.title}
        for rule in real.rules:
            found = rows_of(outcomes, rule)
            rows += [{**about, "matcher": method, **row, "paper": None} for row in found]
    return {"format": FORMAT, "title": TITLE, "rows": rows}


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """One table a set."""
    rows = document["rows"]
    for query in dict.fromkeys(row["query"] for row in rows):
        of_set = [row for row in rows if row["query"] == query]
        rules = list(dict.fromkeys(row["rule"] for row in of_set))
        cells = {(label_of(row), row["rule"]): row for row in of_set}
        chance = [
            "chance",
            *(f"{next(r['chance'] for r in of_set if r['rule'] == rule):.1f}" for rule in rules),
        ]
        lines = [
            [matcher, *(shown(cells[matcher, rule]) if (matcher, rule) in cells else "" for rule in rules)]
            for matcher in dict.fromkeys(map(label_of, of_set))
        ]
        yield Table(f"{query}: accuracy in %", ["method", *rules], [chance, *lines])


def _cells(drives: Drives, choice: Choice) -> Iterator[tuple[RealSet, str, list[Case]]]:
    assert isinstance(drives, RealSets)
    seen = Input(sensor="real", part="images")
    for real in drives.present:
        database, query = (f"{real.title}: {drive}" for drive in (real.reference, real.query))
        for method in (*real.methods, *choice.methods):
            how = (real_methods() | choice.methods)[method]
            case = Case.of(database, query, seen, how, choice.train)
            yield real, method, case.with_seeds(choice.seeds)
