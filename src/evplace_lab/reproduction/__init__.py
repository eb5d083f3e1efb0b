"""The paper's comparison on the benchmark city and on real sets: from recipes to documents.

One file a table or figure; its name is what users ask for. Each holds NEEDS (city, data or nothing), INPUTS
(those that it can be limited to; empty for none), METHODS (those beside which further ones can stand; empty
where none can), `cases(drives, choice)` (all that must be run), `collect(drives, runs, choice)` (the
document, as plain values), and `tables(document)` (the same for people). What was run is kept by its settings
in the output folder, so that a second call, another table or a killed call runs only what is missing. One
that needs nothing holds `document(out, choice, workers, progress)` in place of `cases` and `collect`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from evplace.core import families
from evplace.core.errors import InputError, SettingsError
from evplace.core.settings import to_dict
from evplace.core.storage import locked, new_file, write_json
from evplace.core.workers import Workers, run_all, workers_of
from evplace.evaluation import versions
from evplace.scorers import require
from evplace_lab.city import Progress as CityProgress
from evplace_lab.city import generate
from evplace_lab.reproduction._cases import Case, Method
from evplace_lab.reproduction._cities import Cities
from evplace_lab.reproduction._panels import Panels
from evplace_lab.reproduction._real_sets import RealSets
from evplace_lab.reproduction._runs import Runs

Drives = Cities | RealSets
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
    methods: dict[str, Method] = field(default_factory=dict)
    """Further methods beside those of the recipes, by names of their own: see `read_methods`."""

    def __post_init__(self) -> None:
        if self.seeds < 1:
            raise SettingsError(f"{self.seeds} seeds make no table: take at least 1")
        for key in ("seed", "augment"):
            if key in self.train:
                raise SettingsError(f"'{key}' cannot be set for all trainings: the recipes need their own")


class Table(NamedTuple):
    """Something to print."""

    title: str
    columns: list[str]
    rows: list[list[str]]


def reproduce(
    name: str,
    out: str | Path,
    city: str | Path | None = None,
    data: str | Path | None = None,
    choice: Choice | None = None,
    workers: int | Workers | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Make a table or figure and write `out/NAME.json`; returns what it holds.

    `city` is a folder of `evplace city`; without one, the benchmark is made in `out/city`. `data` is a folder
    of real sets, which the table `real` is made of. `workers` is how many processes are used (None: one a
    core), or where; they do not change the result. Raises SettingsError for an unknown name, InputError where
    a drive is lacking, OutputError where another process writes `out`.
    """
    folder, chosen = Path(out), choice or Choice()
    family = families.load("reproduction", name)
    used = workers_of(workers)
    _check(name, family, chosen)
    began = time.monotonic()
    if family.NEEDS == "nothing":
        with locked(folder / "reproduce"):
            return _kept(folder / f"{name}.json", family.document(folder, chosen, used, progress), began)
    drives = _real_sets(data) if family.NEEDS == "data" else _city(city, folder, data)
    cases = family.cases(drives, chosen)
    for case in cases:
        if case.train is not None:
            require(case.scorer_part)  # before the city is made, which takes a quarter of an hour
    if city is not None or isinstance(drives, RealSets):
        drives.check(cases)
    with locked(folder / "reproduce"):
        if city is None and isinstance(drives, Cities):
            generate(drives.city, workers=used, progress=_of_city(progress))
        runs = Runs(folder, drives.source)
        cases = runs.distinct(cases)
        _answer([case for case in cases if not runs.done(case)], len(cases), drives, runs, used, progress)
        document: dict[str, Any] = family.collect(drives, runs, chosen)
        document |= {
            "settings": {"drives": drives.settings, "seeds": chosen.seeds, "train": chosen.train}
            | ({"methods": to_dict(chosen)["methods"]} if chosen.methods else {}),
            "cpu_s": round(runs.cpu_s(cases), 1),
        }
        return _kept(folder / f"{name}.json", document, began)


def _kept(file: Path, document: dict[str, Any], began: float) -> dict[str, Any]:
    """The document with what it was made by and how long it took, which is what the file now holds."""
    document = document | {"versions": versions(), "took_s": round(time.monotonic() - began, 1)}
    with new_file(file, overwrite=True) as partial:
        write_json(partial, document)
    return document


def _check(name: str, family: ModuleType, choice: Choice) -> None:
    """SettingsError for a choice that this table cannot make."""
    if choice.methods and not family.METHODS:
        raise SettingsError(f"{name} changes the paper's own methods: no others can stand in it")
    for one in choice.methods:
        if one in family.METHODS:
            raise SettingsError(f"the method '{one}' is the recipes' own: give yours another name")
    for one in choice.inputs:
        if one not in family.INPUTS:
            known = ", ".join(family.INPUTS) or "none: it is made of all that it needs"
            raise SettingsError(f"'{one}' is no input that {name} can be limited to: known are {known}")


def _of_city(progress: Progress | None) -> Callable[[CityProgress], None] | None:
    """The city's own progress as ours, in thousandths."""
    if progress is None:
        return None
    return lambda at: progress(round(at.share * 1000), 1000, f"driving {at.drive}")


def _city(city: str | Path | None, folder: Path, data: str | Path | None) -> Panels:
    """The city's drives, by default those in `folder`, and beside them real sets."""
    return Panels(Path(city or folder / "city"), folder, None if data is None else Path(data))


def _real_sets(data: str | Path | None) -> RealSets:
    """The sets in a folder of data; InputError where none is there."""
    if data is None:
        raise InputError("real sets are not made but read: give the folder that holds them with `data`")
    found = RealSets(Path(data))
    if not found.present:
        raise InputError(f"{data} holds none of the real sets that there are recipes for")
    return found


def _answer(
    cases: list[Case], total: int, drives: Drives, runs: Runs, workers: Workers, progress: Progress | None
) -> None:
    """Run all `cases` in processes; those that share a map stand together."""
    if not cases:
        return
    drives.prepare(cases, workers)
    groups: dict[str, list[Case]] = {}
    for case in cases:
        groups.setdefault(runs.map_key(case), []).append(case)
    # What is trained comes first: the longest work last would leave a core idle. Each process gets its share
    # at once, for starting one takes seconds.
    ordered = sorted(groups.values(), key=lambda group: group[0].train is None)
    count = min(workers.count, len(ordered))
    shares = [[sorted(group, key=_shared) for group in ordered[start::count]] for start in range(count)]
    jobs = [
        {
            "kind": type(drives).__name__, "drives": drives.to_dict(), "out": str(runs.out),
            "groups": [[case.to_dict() for case in group] for group in share],
        }
        for share in shares
    ]  # fmt: skip
    finished = [total - len(cases)]

    def said(_: int, line: str) -> None:
        finished[0] += 1
        if progress is not None:
            progress(finished[0], total, line)

    run_all("evplace_lab.reproduction._worker", jobs, workers, runs.out, said)


def _shared(case: Case) -> tuple[str, str, str]:
    """Cases of one query and scorer stand together, so that rows are scored once."""
    return case.query, case.scorer, str(case.scorer_settings)
