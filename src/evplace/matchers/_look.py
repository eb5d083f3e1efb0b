"""Whether a matrix is what a matcher takes it for: scores or distances, above zero, long enough."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import ScoresError
from evplace.core.settings import to_dict
from evplace.matchers import Matcher, Path, Rows

FEWEST = 10
"""Queries without which nothing is said of their order."""
NEAR = 0.02
"""A match moves on by up to this share of the references from query to query; by two, and by twice as many as
there are to a query, at least."""
MOVES, TIMES = 0.1, 2.0
"""Share of the steps that move on so, from which there is an order, and how much larger it must be than that
of the other end of the scores. Of twelve real matrices ten show theirs so, and none the other."""


class ScoreLook:
    """Sees the score rows as a matcher does, larger is better."""

    def __init__(self, distances: bool) -> None:
        """`distances` says that the scores are negated distances."""
        self._distances = distances
        self._most = -np.inf
        self._best: list[NDArray[np.int64]] = []
        self._worst: list[NDArray[np.int64]] = []
        self._shape = (0, 0)

    def see(self, rows: Rows) -> None:
        """The next rows, (queries, references)."""
        self._most = max(self._most, float(rows.max()))
        self._best.append(rows.argmax(axis=1))
        self._worst.append(rows.argmin(axis=1))
        self._shape = (self._shape[0] + len(rows), rows.shape[1])

    def remarks(self, matcher: Matcher, matches: Path) -> list[str]:
        """What may be wrong, a sentence each. Raises ScoresError where the matcher cannot answer at all."""
        name, settings = families.name_of("matchers", matcher), to_dict(matcher)
        if getattr(matcher, "of_similarities", False) and not self._distances and self._most <= 0:
            raise ScoresError(
                f"no score is above 0, and {name} takes similarities above 0: give the distances "
                "themselves with `distances=True`, or another matcher"
            )
        length = settings.get("ds", 0)
        if length > min(self._shape) and not (matches.item >= 0).any():
            raise ScoresError(
                f"no sequence of ds = {length} queries fits {self._shape[0]} queries and {self._shape[1]} "
                f"references: take a 'ds' of at most {min(self._shape)}"
            )
        remarks = [remark for remark in [self._turned()] if remark]
        if not matches.accepted.any():
            remarks.append(
                f"no match is accepted: the best score is {self._most:.3g}, do the thresholds fit? {name} "
                f"has {', '.join(f'{key}={value}' for key, value in settings.items())}"
            )
        return remarks

    def _turned(self) -> str | None:
        """Where the worst references go along with the queries, and the best ones do not."""
        best, worst = _Order.of(self._best, self._shape), _Order.of(self._worst, self._shape)
        follows = worst.moves >= max(MOVES, TIMES * best.moves) and worst.along > best.along
        if self._shape[0] < FEWEST or not follows:
            return None
        kind, flag = ("scores", "leave out") if self._distances else ("distances", "give")
        ends = ("largest", "smallest") if self._distances else ("smallest", "largest")
        return (
            f"these look like {kind}: from query to query the {ends[0]} one moves on by a few references in "
            f"{worst.moves:.0%} of the steps, the {ends[1]} in {best.moves:.0%}: {flag} `distances`"
        )


class _Order(NamedTuple):
    """How far one reference a query goes along with the queries."""

    moves: float
    """The share of steps from query to query that are short, but steps."""
    along: float
    """The correlation of the two numbers, without its sign."""

    @classmethod
    def of(cls, parts: list[NDArray[np.int64]], shape: tuple[int, int]) -> _Order:
        items = np.concatenate(parts)
        if len(items) < FEWEST or not items.std():
            return cls(0.0, 0.0)
        steps = np.abs(np.diff(items))
        near = max(2.0, NEAR * shape[1], 2 * shape[1] / shape[0])
        along = abs(float(np.corrcoef(np.arange(len(items)), items)[0, 1]))
        return cls(float(np.mean((steps > 0) & (steps <= near))), along)
