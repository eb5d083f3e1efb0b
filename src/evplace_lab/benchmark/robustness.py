"""How much is lost when a drive is worse than the clean one: `evplace bench robustness`.

The map is the day's drive along a street of the city, the query the night's. What is done to the query, or to
the map's positions, stands in the recipes of `evplace_lab.reproduction`; what came out of each level is kept
in `out/runs`, so that a call that was stopped goes on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evplace.core.errors import SettingsError
from evplace.core.settings import to_dict
from evplace.core.storage import locked, new_file, read_json, write_json
from evplace.core.workers import Workers, run_all, workers_of
from evplace.evaluation import versions
from evplace_lab.benchmark import Table
from evplace_lab.city import CitySettings, Progress, generate
from evplace_lab.demonstration import USUAL
from evplace_lab.reproduction._cases import checksum
from evplace_lab.reproduction._recipes import recipes

FORMAT = "evplace-robustness-1"
METHODS = ("best", "ncc", "paper")
"""evplace's own method, plain correlation, and the paper's network of this street with its Algorithm 1."""
RENDERED = ("lateral", "yaw", "lens")
"""Kinds that drive anew: they take longest, so they come first."""
TOWN = CitySettings(
    fps=60, sensors=("ideal",), route_length_m=USUAL.length_m, conditions=("day", "night"), paths=(1,),
    keep_events=True,
)  # fmt: skip
"""A small one: the demo's street, whose networks come with evplace."""


@dataclass(frozen=True)
class Recipe:
    """One way in which a drive can be worse."""

    order: int
    title: str
    """For people."""
    kind: str
    """A name of `_disturbances`."""
    unit: str
    """Of the levels."""
    clean: float
    """The level at which nothing is done."""
    levels: tuple[float, ...]
    about: str = ""
    """What is done, in a sentence."""


def robustness(
    out: Path,
    kinds: Sequence[str],
    workers: int | Workers | None,
    driving: Callable[[Progress], None],
    watch: Callable[[int, int, str], None],
) -> dict[str, Any]:
    """Run what is missing and write `out/robustness.json`; returns what it holds.

    `kinds` limits it to some recipes; SettingsError for an unknown one.
    """
    chosen = _chosen(kinds)
    with locked(out / "robustness"):
        generate(out / "town", TOWN, workers, driving)
        jobs = _jobs(out, chosen)
        done = [0]

        def said(_: int, line: str) -> None:
            done[0] += 1
            watch(done[0], len(jobs), line)

        at_work = workers_of(workers)
        count = min(at_work.count, len(jobs))
        shares = [{"jobs": jobs[start::count]} for start in range(count)]
        run_all("evplace_lab.benchmark._robust_worker", shares, at_work, out, said)
        document = {
            "format": FORMAT,
            "rows": [row for recipe in chosen for row in _rows(out, recipe)],
            "recipes": [to_dict(recipe) for recipe in chosen],
            "town": to_dict(TOWN),
            "versions": versions(),
        }
        with new_file(out / "robustness.json", overwrite=True) as partial:
            write_json(partial, document)
    return document


def _jobs(out: Path, chosen: Sequence[Recipe]) -> list[dict[str, Any]]:
    """What is missing, each once, the longest first."""
    jobs = {}
    for recipe in sorted(chosen, key=lambda recipe: recipe.kind not in RENDERED):
        for level in sorted(_levels(recipe), key=lambda level: level == recipe.clean):
            file = _file(out, recipe, level)
            kind = "clean" if level == recipe.clean else recipe.kind
            if not file.exists():
                jobs[file] = {"out": str(out), "kind": kind, "level": level, "file": str(file)}
    return list(jobs.values())


def _chosen(kinds: Sequence[str]) -> list[Recipe]:
    known = recipes("robustness", Recipe)
    for kind in kinds:
        if kind not in [recipe.kind for recipe in known]:
            names = ", ".join(recipe.kind for recipe in known)
            raise SettingsError(f"'{kind}' is no disturbance: known are {names}")
    return [recipe for recipe in known if not kinds or recipe.kind in kinds]


def _levels(recipe: Recipe) -> list[float]:
    return sorted({recipe.clean, *recipe.levels})


def _file(out: Path, recipe: Recipe, level: float) -> Path:
    """Where the outcome of a level is kept; the clean case is the same for all."""
    kind = "clean" if level == recipe.clean else recipe.kind
    key = checksum({"kind": kind, "level": 0 if kind == "clean" else level, "town": to_dict(TOWN)})
    return out / "runs" / f"{key}.json"


def _rows(out: Path, recipe: Recipe) -> Iterator[dict[str, Any]]:
    clean = read_json(_file(out, recipe, recipe.clean), "the outcome of a clean drive")
    for level in _levels(recipe):
        found = read_json(_file(out, recipe, level), "the outcome of a disturbed drive")
        for method in (name for name in METHODS if name in found):
            figures = found[method]
            lost = clean[method]["accuracy"] - figures["accuracy"]
            yield {"kind": recipe.kind, "level": level, "method": method, "lost": lost, **figures}


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """The accuracy of the clean case, what each level costs in points, and how much of it evplace rejects."""
    rows = {(row["kind"], row["level"], row["method"]): row for row in document["rows"]}
    lines = []
    for recipe in document["recipes"]:
        for level in sorted({recipe["clean"], *recipe["levels"]}):
            is_clean = level == recipe["clean"]
            shown = [_cell(rows.get((recipe["kind"], level, method)), is_clean) for method in METHODS]
            name = f"{recipe['title']}, {recipe['unit']}"
            rejected = f"{100 * rows[recipe['kind'], level, METHODS[0]]['rejection_rate']:.1f}"
            lines.append([name, f"{level:g}" + (" (clean)" if is_clean else ""), *shown, rejected])
    columns = ["what is worse", "level", *METHODS, f"{METHODS[0]} rejects"]
    yield Table("Accuracy in %, and points against the clean case", columns, lines)


def _cell(row: dict[str, Any] | None, is_clean: bool) -> str:
    if row is None:
        return "-"
    points = round(-100 * row["lost"], 1) + 0.0  # no -0.0
    beside = "" if is_clean else f" ({points:+.1f})"
    return f"{100 * row['accuracy']:.1f}{beside}"
