"""Global-max: each query goes to the map item with the largest score, whatever came before (paper, 4.2)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evplace.matchers import Answer, Matching, Path, Row, Rows, Sweep
from evplace.matchers._rows import Answers, RowCheck, above


@dataclass(frozen=True)
class Best:
    """Global-max; among equal scores the lowest item wins."""

    threshold: float | None = None
    """Stand by an item only where its score is above this, in units of the score. Default: stand by all,
    as the paper's Global-Max does."""

    presets: ClassVar[Mapping[str, Best]]
    causal: ClassVar[bool] = True

    def start(self, distances: bool = False) -> Matching:  # noqa: ARG002 - a distance is the score -d
        """See Matcher."""
        return _BestMatching(self)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher."""
        return Sweep(parameter or "threshold", self, above if parameter in (None, "threshold") else None)


Best.presets = {"paper": Best()}


class _BestMatching:
    """Remembers nothing but its answers."""

    def __init__(self, settings: Best) -> None:
        self._threshold = -np.inf if settings.threshold is None else settings.threshold
        self._check, self._answers = RowCheck(), Answers()

    def step(self, row: Row) -> Answer:
        """The best item of this query; `row` (items,)."""
        item, score, accepted = self._match(row[None])
        self._answers.forget_old()
        return Answer(len(self._answers) - 1, int(item[0]), float(score[0]), bool(accepted[0]))

    def extend(self, rows: Rows) -> None:
        """Take the next queries; `rows` (queries, items)."""
        self._match(rows)

    def path(self) -> Path:
        """The answers of all queries so far."""
        return self._answers.path()

    def _match(self, rows: Rows) -> Path:
        table = self._check(rows)
        item = table.argmax(1)
        score = table[np.arange(len(table)), item].astype(np.float64)
        answer = Path(item, score, score > self._threshold)
        self._answers.extend(*answer)
        return answer
