"""The figures: each a plain function of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

WITHIN_M = (20, 10, 5)
Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

RECALLS_AT = (1, 5, 10, 20)
"""N of recall@N."""

CURVE = ("threshold", "precision", "recall", "recall_accepted")
"""Columns of a precision-recall curve: recall is TP / seen; recall_accepted is TP / (TP + FN)."""


def precision_recall(score: ArrayLike, right: ArrayLike, seen: ArrayLike, answered: ArrayLike) -> Floats:
    """(thresholds, 4) the exact curve: every distinct score is a threshold, from the highest down.

    At a threshold, all queries `answered` (queries,) with a score of at least that much are accepted. The
    columns are CURVE; NaN where a ratio has nothing under it. Queries whose score is NaN are never accepted.
    """
    confidence = np.asarray(score, np.float64)
    known, truly = np.asarray(seen, np.bool_), np.asarray(right, np.bool_)
    ranked = np.flatnonzero(np.asarray(answered, np.bool_) & ~np.isnan(confidence))
    ranked = ranked[np.argsort(-confidence[ranked], kind="stable")]
    ordered = confidence[ranked]
    last = np.flatnonzero(np.append(ordered[1:] != ordered[:-1], True)[: len(ordered)])
    positives = np.cumsum(truly[ranked])[last].astype(np.float64)
    missed: NDArray[np.int64] = np.sum(known) - np.cumsum(known[ranked])[last]
    with np.errstate(invalid="ignore"):
        columns = (
            ordered[last], positives / (last + 1), positives / np.sum(known), positives / (positives + missed)
        )  # fmt: skip
    return np.column_stack(columns)


def average_precision(curve: Floats) -> float | None:
    """The sum of precision times the gain in recall (TP / seen) over the curve; None where it is empty."""
    if not len(curve) or np.isnan(curve[:, 2]).any():
        return None
    return float(np.sum(np.diff(curve[:, 2], prepend=0.0) * curve[:, 1]))


def hits_at(scores: NDArray[np.floating[Any]], right: Bools, n: ArrayLike) -> Floats:
    """(queries, len(n), 3) worst, expected and best chance that a right item is among the n best.

    Items of equal score have no order: the worst case puts wrong ones first, the best case right ones, the
    expected one shuffles. NaN scores never hit.
    """
    values = np.where(np.isnan(scores), -np.inf, scores)
    top = np.max(np.where(right, values, -np.inf), axis=1, initial=-np.inf)[:, None]
    above = np.sum(values > top, axis=1)  # all wrong: no right item is above the best right one
    tied = values == top
    equal, good = np.sum(tied, axis=1), np.sum(tied & right, axis=1)
    cases = [_hit(above, equal, good, int(many)) for many in np.atleast_1d(n)]
    return np.where((top > -np.inf)[:, :, None], np.stack(cases, axis=1), 0.0)


def auroc(score: ArrayLike, seen: ArrayLike) -> float | None:
    """Chance that a seen query has a higher score than an unseen one, ties counting half.

    The area under the curve of accepted seen over accepted unseen queries; NaN scores are the lowest. None
    where all queries are seen, or none.
    """
    values = np.asarray(score, np.float64)
    values = np.where(np.isnan(values), -np.inf, values)
    known = np.asarray(seen, np.bool_)
    n_seen, n_unseen = int(known.sum()), int((~known).sum())
    if not (n_seen and n_unseen):
        return None
    _, place, many = np.unique(values, return_inverse=True, return_counts=True)
    rank = (np.cumsum(many) - (many - 1) / 2)[place]
    return float((rank[known].sum() - n_seen * (n_seen + 1) / 2) / (n_seen * n_unseen))


def reliability(probability: ArrayLike, right: ArrayLike, bins: int = 10) -> Floats:
    """(bins, 3) mean probability said, share that was right, and queries, of bins of equal width.

    NaN where a bin is empty; queries without a probability are left out.
    """
    said, truly = np.asarray(probability, np.float64), np.asarray(right, np.float64)
    known = ~np.isnan(said)
    place = np.clip((said[known] * bins).astype(np.int64), 0, bins - 1)
    many = np.bincount(place, minlength=bins).astype(np.float64)
    with np.errstate(invalid="ignore"):
        means = [np.bincount(place, column[known], minlength=bins) / many for column in (said, truly)]
    return np.column_stack([*means, many])


def gallery_spacing(positions: ArrayLike) -> float | None:
    """Mean distance in metres between consecutive items (items, 2) with positions; None where none are."""
    steps = np.hypot(*np.diff(np.asarray(positions, np.float64), axis=0).T)
    known = steps[np.isfinite(steps)]
    return float(known.mean()) if len(known) else None


def at_decision(accepted: Bools, right: Bools, seen: Bools) -> dict[str, Any]:
    """The figures at the matcher's own decision."""
    tp, fp = int(np.sum(accepted & right)), int(np.sum(accepted & ~right))
    fn, tn = int(np.sum(~accepted & seen)), int(np.sum(~accepted & ~seen))
    n_seen, n_unseen = int(np.sum(seen)), int(np.sum(~seen))
    return {
        "judged": len(seen), "seen": n_seen, "unseen": n_unseen,
        "tp": tp, "fp": fp, "fn": fn, "tn": tn,
        "accuracy": _ratio(tp + tn, len(seen)),
        "accuracy_seen": _ratio(tp, n_seen),
        "rejection_rate": _ratio(fn + tn, len(seen)),
        "unseen_rejected": _ratio(tn, n_unseen),
        "false_accept_rate": _ratio(n_unseen - tn, n_unseen),
        "precision": _ratio(tp, tp + fp),
        "recall": _ratio(tp, n_seen),
        "recall_accepted": _ratio(tp, tp + fn),
    }  # fmt: skip


def within(error_m: Floats, accepted: Bools, right: Bools, seen: Bools) -> dict[str, Any]:
    """Share of the seen queries whose accepted, right answer is at most so many metres off."""
    good = accepted & right
    return {
        f"within_{metres}_m": _ratio(int(np.sum(good & (error_m <= metres))), int(np.sum(seen)))
        for metres in WITHIN_M
    }


def of_curve(curve: Floats) -> dict[str, Any]:
    perfect = curve[curve[:, 1] == 1, 2]
    recall: float | None = float(perfect.max(initial=0.0))
    return {
        "average_precision": average_precision(curve),
        "recall_at_full_precision": None if not len(curve) or np.isnan(curve[:, 2]).any() else recall,
    }


def chance(shares: Floats, seen: Bools) -> dict[str, Any]:
    """Recall@1 of a blind guess, over all judged queries and over the seen."""
    return {
        "chance": _ratio(float(shares.sum()), len(seen)),
        "chance_seen": _ratio(float(shares.sum()), int(seen.sum())),
    }


def recalls(hits: Floats, seen: Bools) -> dict[str, Any]:
    """recall@N over all judged queries and over the seen, ties shuffled; and the tie bracket at N = 1."""
    totals = hits.sum(axis=0)  # (N, 3)
    figures: dict[str, Any] = {}
    for n, (_, expected, _) in zip(RECALLS_AT, totals.tolist(), strict=True):
        figures[f"recall@{n}"] = _ratio(expected, len(seen))
        figures[f"recall@{n}_seen"] = _ratio(expected, int(seen.sum()))
    figures["recall@1_worst_ties"] = _ratio(float(totals[0, 0]), len(seen))
    figures["recall@1_best_ties"] = _ratio(float(totals[0, 2]), len(seen))
    return figures


def _hit(above: NDArray[Any], equal: NDArray[Any], good: NDArray[Any], n: int) -> Floats:
    """(queries, 3) worst, expected and best chance; `above` stand before `equal` tied ones, `good` right.

    Drawing k of the tied items, none is right with probability C(equal - good, k) / C(equal, k).
    """
    bad = equal - good
    drawn = np.clip(n - above, 0, equal)
    none = np.ones(len(equal))
    for i in range(n):
        left = np.maximum(bad - i, 0) / np.maximum(equal - i, 1)
        none *= np.where(i < drawn, left, 1.0)
    return np.column_stack([drawn > bad, 1 - none, drawn > 0]).astype(np.float64)


def _ratio(part: float, whole: int) -> float | None:
    return part / whole if whole else None
