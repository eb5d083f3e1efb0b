"""The paper's comparison on the benchmark city: recipes in, a document and a cache of runs out.

One file a table or figure; its name is what users ask for. Each holds `cases(choice)` (all that must be run),
`collect(runs, choice)` (the document, as plain values) and `tables(document)` (the same for people). What was
run is kept by its settings in the output folder, so that a second call, another table or a killed call runs
only what is missing.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from evplace import plugs
from evplace.city import generate
from evplace.errors import SettingsError
from evplace.evaluation import versions
from evplace.reproduction._cases import Case
from evplace.reproduction._drives import Cities
from evplace.reproduction._recipes import inputs
from evplace.reproduction._runs import Runs
from evplace.storage import locked, new_file, write_json
from evplace.workers import run_all

Progress = Callable[[int, int, str], None]
"""Called with (cases done, cases in all, what is being done)."""


@dataclass(frozen=True)
class Choice:
    """How much of a table is made."""

    seeds: int = 3
    """Trainings of each network, each from other first weights; 0 is the first seed."""
    train: dict[str, Any] = field(default_factory=dict)
    """Settings of all trainings over those of the recipes: for a quick look."""
    inputs: tuple[str, ...] = ()
    """Only these inputs; empty for all."""

    def __post_init__(self) -> None:
        if self.seeds < 1:
            raise SettingsError(f"{self.seeds} seeds make no table: take at least 1")
        for name in self.inputs:
            if name not in inputs():
                raise SettingsError(f"unknown input '{name}': known are {', '.join(inputs())}")


class Table(NamedTuple):
    """Something to print."""

    title: str
    columns: list[str]
    rows: list[list[str]]


def reproduce(
    name: str,
    out: str | Path,
    city: str | Path | None = None,
    choice: Choice | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make a table or figure and write `out/NAME.json`; returns what it holds.

    `city` is a folder of `evplace city`; without one, the benchmark is made in `out/city`. `workers`
    processes are used (None: one a core); they do not change the result. Raises SettingsError for an
    unknown name, InputError where the city lacks a drive, OutputError where another process writes `out`.
    """
    folder, chosen = Path(out), choice or Choice()
    family = plugs.load("reproduction", name)
    count = workers or os.cpu_count() or 1
    began = time.monotonic()
    with locked(folder / name):
        if city is None:
            generate(folder / "city", workers=count)
        cities = Cities(Path(city) if city is not None else folder / "city", folder)
        runs = Runs(folder, cities.settings)
        cases = family.cases(chosen)
        _answer([case for case in cases if not runs.done(case)], len(cases), cities, runs, count, progress)
        document: dict[str, Any] = family.collect(runs, chosen)
        document |= {
            "settings": {"city": cities.settings, "seeds": chosen.seeds, "train": chosen.train},
            "versions": versions(),
            "took_s": round(time.monotonic() - began, 1),
        }
        with new_file(folder / f"{name}.json", overwrite=True) as partial:
            write_json(partial, document)
    return document


def _answer(
    cases: list[Case], total: int, cities: Cities, runs: Runs, workers: int, progress: Progress | None
) -> None:
    """Run all `cases`, those that share a map in one process."""
    done = total - len(cases)
    if not cases:
        return
    cities.prepare(cases, workers)
    groups: dict[str, list[Case]] = {}
    for case in cases:
        groups.setdefault(case.map_key(runs.city), []).append(case)
    # What is trained comes first: the longest jobs last would leave a core idle.
    ordered = sorted(groups.values(), key=lambda group: group[0].train is None)
    count = min(workers, len(ordered))
    jobs = [
        {
            "city": str(cities.city), "beside": str(cities.beside), "out": str(runs.out),
            "threads": max(1, (os.cpu_count() or 1) // count),
            "cases": [case.to_dict() for case in sorted(group, key=_shared)],
        }
        for group in ordered
    ]  # fmt: skip
    finished = [done]

    def said(index: int, _: str) -> None:
        finished[0] += 1
        if progress is not None:
            progress(finished[0], total, f"{ordered[index][0].query} {ordered[index][0].part}")

    run_all("evplace.reproduction._worker", jobs, count, said)


def _shared(case: Case) -> tuple[str, str, str]:
    """Cases of one query and scorer stand together, so that rows are scored once."""
    return case.query, case.scorer, str(case.scorer_settings)
