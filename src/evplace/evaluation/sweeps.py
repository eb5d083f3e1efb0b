"""One parameter over many values, for precision-recall curves, with the least work that gives exact answers.

A parameter that only judges what was found needs one run; one that steers the search needs a run a value.
Which is which each matcher says itself: see `Matcher.sweep`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from evplace.core import settings
from evplace.localizer._drive import BLOCK, Answers
from evplace.matchers import Judge, Matcher, Path, Rows, stepped


def sweep(
    matcher: Matcher,
    scores: Rows,
    values: Sequence[float] | None = None,
    parameter: str | None = None,
    distances: bool = False,
    answers: Answers = "live",
) -> Iterator[tuple[float, Path]]:
    """Each value of the parameter with the answers that `matcher` gives at it; `scores` (queries, items).

    The parameter is the matcher's usual one unless named. Without `values`: every value at which something
    changes, where one run serves all; else 101 quantiles of what the parameter is compared with. The answers
    are live ones, or those of hindsight. Raises SettingsError and ScoresError as the matcher does.
    """
    found = matcher.sweep(parameter)
    if found.judge is None:
        if values is None:
            best = np.quantile(scores.max(1).astype(np.float64), np.linspace(1, 0, 101))
            values = [float(value) for value in np.unique(found.values(best, distances))]
        for value in values:
            changed = settings.make(type(matcher), {found.parameter: float(value)}, found.matcher)
            yield value, _run(changed, scores, distances, answers)
        return
    path = _run(found.matcher, scores, distances, answers)
    for value in _levels(path, found.judge) if values is None else values:
        yield value, path._replace(accepted=found.judge(path.score, value))


def _run(matcher: Matcher, scores: Rows, distances: bool, answers: Answers) -> Path:
    matching = matcher.start(distances)
    if answers == "live" and not matcher.causal:
        return stepped(matching.step, scores)[0]
    for start in range(0, len(scores), BLOCK):
        matching.extend(scores[start : start + BLOCK])
    return matching.path()


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
