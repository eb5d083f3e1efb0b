"""What the paper leaves open, or its author did otherwise: one change at a time.

Compared with is the paper's training and matching as printed, on the city's images of 1/30 s. The effect is
the mean over the seeds of the change in accuracy with the same seed, in points. It is called so where it
is larger than the seed-to-seed spread of both accuracies; with one seed nothing is called so.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evplace_lab.reproduction import Choice, Drives, Table
from evplace_lab.reproduction._cases import Case, Values
from evplace_lab.reproduction._figures import deviation
from evplace_lab.reproduction._recipes import inputs, methods, recipes
from evplace_lab.reproduction._runs import Runs

TITLE = "Ablations: one change at a time against the paper's training and matching"
NEEDS = "city"
INPUTS: tuple[str, ...] = ()
METHODS: tuple[str, ...] = ()
FORMAT = "evplace-ablations-1"
DATABASE, INPUT = "day-1", "events"
NO_EFFECT = "no effect seen"


@dataclass(frozen=True)
class Recipe:
    """One change."""

    order: int
    """Its place in the list."""
    question: str
    """What is open."""
    change: str
    """What is done otherwise."""
    method: str
    """The method that is changed."""
    queries: tuple[str, ...]
    """The drives that are looked for."""
    train: Values = field(default_factory=dict)
    """Settings of the training over those of the paper."""
    windows: Values | None = None
    images: Values | None = None
    """Settings of windows and images: these are made anew from the drives' events."""
    matcher_settings: Values = field(default_factory=dict)
    """Settings of the matcher over the method's."""
    scorer: str | None = None
    scorer_settings: Values = field(default_factory=dict)
    """The scorer in place of the method's, with its settings."""
    origin: tuple[float, float] = (0.0, 0.0)
    """Corner of the grid of places, metres."""


def cases(_: Drives, choice: Choice) -> list[Case]:
    """Every change, and what it is compared with."""
    return [case for _, _, pair in _pairs(choice) for group in pair for case in group]


def collect(_: Drives, runs: Runs, choice: Choice) -> dict[str, Any]:
    """One row a change and query, the largest effect first."""
    rows: list[dict[str, Any]] = []
    for recipe, query, (plain, changed) in _pairs(choice):
        before, after = (_accuracies(runs, group) for group in (plain, changed))
        effect = float(np.mean(after - before))
        spreads = [deviation(values.tolist()) for values in (before, after)]
        spread = max(np.inf if one is None else one for one in spreads)
        verdict = NO_EFFECT if not abs(effect) > spread else "better" if effect > 0 else "worse"
        rows.append(
            {
                "name": recipe.question,
                "change": recipe.change,
                "method": recipe.method,
                "query": query,
                "before": float(np.mean(before)),
                "before_spread": deviation(before.tolist()),
                "mean": float(np.mean(after)),
                "spread": deviation(after.tolist()),
                "effect": effect,
                "effect_spread": deviation((after - before).tolist()),
                "verdict": verdict,
                "seeds": len(after),
            }
        )
    rows.sort(key=lambda row: -abs(row["effect"]))
    baseline = {"database": DATABASE, "input": INPUT, "training": "paper", "matcher": "paper"}
    return {"format": FORMAT, "title": TITLE, "baseline": baseline, "rows": rows}


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """One table, sorted by effect."""
    lines = [
        [row["name"], row["change"], row["method"], row["query"], f"{row['before']:.1f}",
         _spread(f"{row['mean']:.1f}", row["spread"]), _spread(f"{row['effect']:+.1f}", row["effect_spread"]),
         row["verdict"]]
        for row in document["rows"]
    ]  # fmt: skip
    columns = ["open", "changed to", "method", "query", "as printed", "changed", "effect", "verdict"]
    yield Table("Accuracy in % by the paper's rule; effects in points, the largest first", columns, lines)


def _spread(mean: str, spread: float | None) -> str:
    return mean if spread is None else f"{mean} ± {spread:.1f}"


def _pairs(choice: Choice) -> Iterator[tuple[Recipe, str, tuple[list[Case], list[Case]]]]:
    """Each change and query with its cases, one a seed: as printed, and changed."""
    for recipe in recipes("ablations", Recipe):
        for query in recipe.queries:
            how = methods()[recipe.method]
            plain = Case.of(DATABASE, query, inputs()[INPUT], how, choice.train)
            yield recipe, query, (plain.with_seeds(choice.seeds), _changed(recipe, query, choice))


def _changed(recipe: Recipe, query: str, choice: Choice) -> list[Case]:
    seen = dataclasses.replace(inputs()[INPUT], windows=recipe.windows, images=recipe.images)
    given = methods()[recipe.method]
    how = dataclasses.replace(
        given,
        scorer=recipe.scorer or given.scorer,
        scorer_settings=recipe.scorer_settings,
        settings={**given.settings, **recipe.matcher_settings},
    )
    case = Case.of(DATABASE, query, seen, how, {**choice.train, **recipe.train})
    return dataclasses.replace(case, origin=recipe.origin).with_seeds(choice.seeds)


def _accuracies(runs: Runs, group: list[Case]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """(seeds,) in %."""
    found = [runs.found(case)[_timing(case)]["places"]["figures"]["accuracy"] for case in group]
    return 100 * np.array(found)


def _timing(case: Case) -> str:
    """Live, but for a network that normalises by the statistics of all queries at once."""
    return "hindsight" if case.scorer_settings.get("batch_statistics") else "live"
