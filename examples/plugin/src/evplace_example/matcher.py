"""Majority: a match is believed where the best items of the last queries lie close together."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evplace.core.errors import SettingsError
from evplace.matchers import Answer, Answers, Matching, Path, Row, RowCheck, Rows, Sweep


@dataclass(frozen=True)
class Majority:
    """Of the best items of the last queries, the share that lies near this query's is the score."""

    n: int = 5
    """Queries that vote: this one and those before it."""
    near: int = 3
    """Items from this query's best one that still vote for it."""
    share: float = 0.5
    """A match is accepted where more than this share votes for it."""

    presets: ClassVar[Mapping[str, Majority]]
    causal: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if self.n < 1 or self.near < 0:
            raise SettingsError("majority takes an n of 1 or more, and a near of 0 or more")

    def start(self, distances: bool = False) -> Matching:  # noqa: ARG002 - a distance is the score -d
        """See Matcher."""
        return _Voting(self)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher: the share only judges, so that one run serves all its values."""
        parameter = parameter or "share"
        return Sweep(parameter, self, np.greater if parameter == "share" else None)


Majority.presets = {"strict": Majority(n=9, near=9, share=0.8)}


class _Voting:
    """Remembers the best items of the last queries."""

    def __init__(self, settings: Majority) -> None:
        self._settings = settings
        self._check, self._answers = RowCheck(), Answers()
        self._votes: deque[int] = deque(maxlen=settings.n)

    def step(self, row: Row) -> Answer:
        """See Matching."""
        item, score, accepted = (column[0] for column in self._match(row[None]))
        return Answer(len(self._answers) - 1, int(item), float(score), bool(accepted))

    def extend(self, rows: Rows) -> None:
        """See Matching."""
        self._match(rows)

    def path(self) -> Path:
        """See Matching."""
        return self._answers.path()

    def _match(self, rows: Rows) -> Path:
        item = self._check(rows).argmax(axis=1)
        score = np.array([self._share_for(int(best)) for best in item], np.float64)
        answer = Path(item, score, score > self._settings.share)
        self._answers.extend(*answer)
        return answer

    def _share_for(self, item: int) -> float:
        self._votes.append(item)
        near = sum(abs(vote - item) <= self._settings.near for vote in self._votes)
        return near / self._settings.n
