"""How good the answers are: figures, the exact precision-recall curve, and the folder that keeps them.

Of a judged query, `accepted` says that the matcher stands by its item, `right` that the truth takes this
item, `seen` that the truth takes any item. TP: accepted and right; FP: accepted otherwise; FN: not accepted
though seen; TN: not accepted and unseen. "Not seen before" on an unseen query counts as right in the
accuracy, as it does by all evidence in the paper; the accuracy on seen queries stands beside it.
"""

from __future__ import annotations

import dataclasses
import functools
import platform
import sys
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evplace import __version__
from evplace.core.errors import EvaluationError
from evplace.evaluation import _measures
from evplace.evaluation._measures import (
    CURVE,
    RECALLS_AT,
    Bools,
    Floats,
    average_precision,
    gallery_spacing,
    hits_at,
    precision_recall,
    reliability,
)
from evplace.evaluation._result import MARK, OUTCOMES, Result
from evplace.evaluation._samples import ItemImages, Samples, choose, pictures
from evplace.evaluation._similarity import similarities
from evplace.evaluation.truth import Truth
from evplace.matchers import Path as Answers

__all__ = [
    "CURVE",
    "MARK",
    "OUTCOMES",
    "RECALLS_AT",
    "ItemImages",
    "Result",
    "Samples",
    "average_precision",
    "compare",
    "flat",
    "gallery_spacing",
    "hits_at",
    "measure",
    "precision_recall",
    "reliability",
    "sample",
    "versions",
]


def measure(
    answers: Answers,
    truth: Truth,
    scores: NDArray[np.floating[Any]] | None = None,
    positions: ArrayLike | None = None,
    t_us: ArrayLike | None = None,
    settings: Mapping[str, Any] | None = None,
    query_xy: ArrayLike | None = None,
    delay: int | None = None,
    hits: Floats | None = None,
) -> Result:
    """The figures of a matcher's `answers` (queries) by `truth`.

    `scores` (queries, items) adds recall@N, and so do their `hits` (queries, N, 3) of `hits_at` in their
    place; `positions` (items, 2) in metres adds the gallery spacing; `t_us` (queries,), `settings` and the
    positions, also `query_xy` (queries, 2), are kept with the result; so is `delay`, how many images later an
    answer was known at most. Queries that the truth knows nothing of are left out and counted. Raises
    EvaluationError where the parts do not fit or no query is judged.
    """
    _check(answers, truth, scores)
    here, there = _known(query_xy, truth.n_queries), _known(positions, truth.n_items)
    right, true_item, shares, ranked = _compare_with_truth(
        answers, truth, scores if hits is None else None, here, there
    )
    ranked = ranked if hits is None else hits
    seen = true_item >= 0
    accepted = answers.accepted & (answers.item >= 0)
    judged = truth.judged
    curve = precision_recall(answers.score[judged], right[judged], seen[judged], answers.item[judged] >= 0)
    figures = (
        {"queries": len(judged), "left_out": int(np.sum(~judged)), "items": truth.n_items}
        | _measures.at_decision(accepted[judged], right[judged], seen[judged])
        | _measures.within(
            _apart(answers, here, there)[judged], accepted[judged], right[judged], seen[judged]
        )
        | _measures.of_curve(curve)
        | {"auroc": _measures.auroc(answers.score[judged], seen[judged])}
        | _measures.chance(shares[judged], seen[judged])
        | (_measures.recalls(ranked[judged], seen[judged]) if ranked is not None else {})
        | {"gallery_spacing_m": None if positions is None else gallery_spacing(positions)}
        | {"delay_images": delay}
    )
    times = np.full(len(judged), -1) if t_us is None else np.asarray(t_us, np.int64)
    resolved = dict(settings or {}) | {"truth": truth.rule}
    return Result(
        figures, resolved, versions(), answers, times, judged, seen, right, curve, scores,
        true_item=true_item, query_xy=here, item_xy=there,
        similarity=None if scores is None else similarities(scores),
    )  # fmt: skip


def sample(result: Result, images: NDArray[np.uint8], of_items: ItemImages) -> Result:
    """The same with `Samples`: some of the query's `images` (queries, ...), and what `of_items` shows."""
    query = choose(result.outcome)
    true = np.full(len(query), -1) if result.true_item is None else result.true_item[query]
    shown = pictures(np.asarray(images[query]), result.answers.item[query], true, of_items)
    return dataclasses.replace(result, samples=Samples(query, shown))


def compare(results: Iterable[Result | str | Path]) -> list[dict[str, Any]]:
    """One row a result: its name, whether its answers are live, its figures, and settings that differ.

    Folders are read, nothing is run again. Nested settings are named as in `truth.cell_m`.
    """
    named = [_named(result, number) for number, result in enumerate(results, 1)]
    settings = [flat(result.settings) for _, result in named]
    keys = list(dict.fromkeys(key for one in settings for key in one))
    differing = [key for key in keys if any(one.get(key) != settings[0].get(key) for one in settings)]
    return [
        {"result": name, "answers": result.timing}
        | flat(result.figures)
        | {key: one.get(key) for key in differing}
        for (name, result), one in zip(named, settings, strict=True)
    ]


def _check(answers: Answers, truth: Truth, scores: NDArray[np.floating[Any]] | None) -> None:
    if not len(answers.item) == len(answers.score) == len(answers.accepted) == truth.n_queries:
        raise EvaluationError(f"{len(answers.item)} answers do not fit a truth of {truth.n_queries} queries")
    if np.any((answers.item < -1) | (answers.item >= truth.n_items)):
        raise EvaluationError(
            f"answers name items {answers.item.min()} to {answers.item.max()}, the truth has "
            f"{truth.n_items}: evaluate with the truth of the map that gave the answers"
        )
    if scores is not None and scores.shape != (truth.n_queries, truth.n_items):
        raise EvaluationError(
            f"scores of shape {scores.shape} do not fit {truth.n_queries} queries (rows) and "
            f"{truth.n_items} items"
        )
    if not truth.judged.any():
        raise EvaluationError(
            f"none of the {truth.n_queries} queries has a position or a known answer: give a track that "
            "spans the drive, or another truth"
        )


def _compare_with_truth(
    answers: Answers,
    truth: Truth,
    scores: NDArray[np.floating[Any]] | None,
    here: Floats | None,
    there: Floats | None,
) -> tuple[Bools, NDArray[np.int64], Floats, Floats | None]:
    """In one pass over the truth: (queries,) right, true item, share of right items; (queries, N, 3) hits.

    `here` (queries, 2) and `there` (items, 2) are positions; the true item is the right one nearest by.
    """
    right, true_item = np.zeros(truth.n_queries, np.bool_), np.zeros(truth.n_queries, np.int64)
    shares = np.zeros(truth.n_queries)
    hits = np.zeros((truth.n_queries, len(RECALLS_AT), 3))
    for part, block in truth.blocks():
        items = answers.item[part]
        right[part] = block[np.arange(len(block)), items] & (items >= 0)
        true_item[part] = _nearest_right(block, None if here is None else here[part], there)
        shares[part] = block.mean(axis=1)
        if scores is not None:
            hits[part] = hits_at(scores[part], block, RECALLS_AT)
    return right, true_item, shares, hits if scores is not None else None


def _nearest_right(block: Bools, here: Floats | None, there: Floats | None) -> NDArray[np.int64]:
    """(queries,) of the right items in `block` (queries, items) the nearest, -1 where none is right.

    Without positions `here` (queries, 2) and `there` (items, 2): the middle one of the right items.
    """
    if here is None or there is None:
        place = np.cumsum(block, axis=1)
        nearest = np.argmax(place > (place[:, -1:] - 1) // 2, axis=1)
    else:
        apart = np.full(block.shape, np.inf)
        query, item = np.nonzero(block)  # few: the distances to all others are not needed
        metres = np.hypot(*(here[query] - there[item]).T)
        apart[query, item] = np.where(np.isfinite(metres), metres, np.inf)
        nearest = np.argmin(apart, axis=1)
    return np.where(block.any(axis=1), nearest, -1)


def _apart(answers: Answers, here: Floats | None, there: Floats | None) -> Floats:
    """(queries,) metres from each query to its answer; NaN where unknown."""
    if here is None or there is None:
        return np.full(len(answers.item), np.nan)
    away = here - there[answers.item]
    return np.where(answers.item >= 0, np.hypot(away[:, 0], away[:, 1]), np.nan)


def _known(xy: ArrayLike | None, many: int) -> Floats | None:
    """Positions (many, 2) as they are kept: None where none is known."""
    if xy is None:
        return None
    positions = np.asarray(xy, np.float64)
    if positions.shape != (many, 2):
        raise EvaluationError(
            f"positions of shape {positions.shape} do not fit: wanted are {many} pairs of metres"
        )
    return positions if np.isfinite(positions).any() else None


def versions() -> dict[str, str]:
    """Versions of this package, python, and those packages at work here that can change a figure."""
    loaded = [name for name in ("numpy", "numba", "onnxruntime", "torch") if name in sys.modules]
    ours = {"evplace": __version__, "python": platform.python_version()}
    return ours | {name: _version_of(name) for name in loaded}


_version_of = functools.cache(metadata.version)


def _named(result: Result | str | Path, number: int) -> tuple[str, Result]:
    if isinstance(result, Result):
        return str(number), result
    return Path(result).name, Result.load(result)


def flat(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one, with dots in the names."""
    found: dict[str, Any] = {}
    for key, value in values.items():
        found |= flat(value, f"{prefix}{key}.") if isinstance(value, Mapping) else {f"{prefix}{key}": value}
    return found
