"""Global-max: each query goes to the map item with the largest score, whatever came before (paper, 4.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evplace.matchers import Answer, Matcher, Path, Row, Rows
from evplace.matchers._rows import Answers, RowCheck


@dataclass(frozen=True)
class Settings:
    """What global-max can be told."""

    threshold: float | None = None
    """Stand by an item only where its score is above this, in units of the score. Default: stand by all,
    as the paper's Global-Max does."""


PRESETS: dict[str, Settings] = {"paper": Settings()}


def matcher(settings: Settings, distances: bool = False) -> Matcher:  # noqa: ARG001 - a distance is the score -d
    """A fresh global-max matcher; among equal scores the lowest item wins."""
    return Best(settings)


class Best:
    """Remembers nothing but its answers."""

    def __init__(self, settings: Settings) -> None:
        self._threshold = -np.inf if settings.threshold is None else settings.threshold
        self._check, self._answers = RowCheck(), Answers()

    def step(self, row: Row) -> Answer:
        """The best item of this query; `row` (items,)."""
        item, score, accepted = self._match(row[None])
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
