"""One parameter over many values, for precision-recall curves, with the least work that gives exact answers.

A parameter that only judges what was found needs one run; one that steers the search needs a run a value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import families as plugs
from evplace.core import settings
from evplace.core.errors import SettingsError
from evplace.matchers import Path, Rows, open_matcher

Judge = Callable[[NDArray[np.float64], float], NDArray[np.bool_]]
"""(queries,) scores and a value of the parameter -> (queries,) accepted."""

SWEPT = {
    "best": "threshold",
    "local": "tau1",
    "seqslam": "mu",
    "graph": "m",
    "dp": "m",
    "hmm": "threshold",
}
"""The parameter that each matcher's curve is drawn over; tau1, mu and m are the paper's (5.2)."""

_JUDGES: dict[tuple[str, str], Judge] = {
    ("best", "threshold"): lambda score, value: score > value,
    ("seqslam", "mu"): lambda score, value: score > value,
    ("seqslam", "threshold"): lambda score, value: -score < value,
    ("graph", "m"): lambda score, value: -score <= value,
    ("dp", "m"): lambda score, value: -score < value,
    ("hmm", "threshold"): lambda score, value: score > value,
}
"""What is accepted at a value of a parameter that changes nothing else."""


def sweep(
    name: str,
    scores: Rows,
    values: Sequence[float] | None = None,
    parameter: str | None = None,
    preset: str | None = None,
    distances: bool = False,
    **others: object,
) -> Iterator[tuple[float, Path]]:
    """Each value of the parameter with the answers that the matcher gives at it; `scores` (queries, items).

    The parameter is that of SWEPT unless named. Without `values`: every value at which something changes,
    where one run serves all; else 101 quantiles of what the parameter is compared with. Raises
    SettingsError and ScoresError as the matcher does.
    """
    module = plugs.load("matchers", name)
    parameter = parameter or SWEPT.get(name)
    if parameter is None:
        raise SettingsError(f"the matcher '{name}' has no usual parameter to sweep: name one")
    if name == "seqslam":
        others = {"selection": "threshold" if parameter == "threshold" else "window", **others}
    base = settings.preset_of(f"the matcher '{name}'", module.PRESETS, preset)
    resolved = settings.make(module.Settings, others, base)
    # The graph's m also says when it is lost, unless it never looks again.
    steers = name == "graph" and resolved.relocalise != "none"
    judge = None if steers else _JUDGES.get((name, parameter))
    if judge is None:
        if values is None:
            values = _quantiles(name, scores, parameter, distances)
        for value in values:
            yield value, _run(name, scores, preset, distances, {**others, parameter: float(value)})
        return
    found = _run(name, scores, preset, distances, others)
    if values is None:
        values = _levels(found, judge)
    for value in values:
        yield value, found._replace(accepted=judge(found.score, value))


def _run(name: str, scores: Rows, preset: str | None, distances: bool, values: dict[str, Any]) -> Path:
    matcher = open_matcher(name, preset, distances, **values)
    matcher.extend(scores)
    return matcher.path()


def _levels(found: Path, judge: Judge) -> list[float]:
    """All values at which the accepted change, from none accepted to all."""
    scores = np.unique(found.score[np.isfinite(found.score)])
    if not len(scores):
        return []
    largest_wins = bool(judge(scores[-1:], -np.inf)[0])
    levels = (
        np.concatenate([scores[::-1], [-np.inf]])
        if largest_wins
        else np.concatenate([-scores[::-1], [np.inf]])
    )
    return [float(level) for level in levels]


def _quantiles(name: str, scores: Rows, parameter: str, distances: bool) -> list[float]:
    """101 values spread as the best scores of the rows, or as their costs."""
    best = np.quantile(scores.max(1).astype(np.float64), np.linspace(1, 0, 101))
    if name == "graph" and parameter == "m":
        best = -best if distances else 1 / np.maximum(best, 1e-9)
    return [float(value) for value in np.unique(best)]
