"""Full dynamic programming: the cheapest path through the whole matrix, exact where the graph is lazy.

After Vysotska's image_sequence_matcher (ism). Cheaper than the graph where all scores are there anyway and
the graph would look at most of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.matchers import Answer, Matching, Path, Row, Rows, Sweep
from evplace.matchers._graph_search import IMPOSSIBLE
from evplace.matchers._kept import Kept, after, live_rows
from evplace.matchers._rows import RowCheck, as_table, costs_below
from evplace.matchers._viterbi import LONGEST_STEP, Viterbi, pieces


@dataclass(frozen=True)
class DP:
    """The full search, its parameters named as the graph's.

    Costs are 1/similarity (a similarity below 1e-9 costs most), or distances. Among equally cheap paths the
    one through the lower reference, seen from the end, wins.
    """

    K: int = 5
    """Fan-out: from one query to the next the match moves by at most K references, either way. ism: 5."""
    m: float | None = None
    """Non-matching cost: only what costs less is accepted. In units of 1/similarity, or of the distance.
    Default: 3.7 for similarities, as in the graph; none for distances: all is accepted."""
    window: Literal["inclusive", "half_open"] = "inclusive"
    """[r - K, r + K], or "half_open" [r - K, r + K) by a slip of ism's."""

    def __post_init__(self) -> None:
        """Raise SettingsError for a fan-out out of range."""
        if not 1 <= self.K <= LONGEST_STEP:
            raise SettingsError(f"K = {self.K} is out of range: it goes from 1 to {LONGEST_STEP}")

    presets: ClassVar[Mapping[str, DP]]
    causal: ClassVar[bool] = False
    of_similarities: ClassVar[bool] = True
    """Costs are 1/similarity: scores above 0, where they are no distances."""

    def start(self, distances: bool = False) -> Matching:
        """See Matcher."""
        return _FullSearch(self, distances)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher."""
        return Sweep(parameter or "m", self, costs_below if parameter in (None, "m") else None)


DP.presets = {"ism": DP(m=6.0, window="half_open")}


class _FullSearch:
    """Remembers the scores and a step for each cell, 6 or 10 bytes; live, those of the last rows.

    `step` answers with the end of the best path so far, `path` with all of it that is kept.
    """

    def __init__(self, settings: DP, distances: bool = False) -> None:
        self._check, self._distances = RowCheck(), distances
        self._m = np.inf if settings.m is None and distances else 3.7 if settings.m is None else settings.m
        steps = 2 * settings.K + (settings.window == "inclusive")
        self._search = Viterbi(-settings.K, np.zeros(steps))
        self._rows = Kept()

    def step(self, row: Row) -> Answer:
        """Where this query is, by the best path so far; `row` (items,)."""
        item = int(self._advance(row[None])[0])
        row = self._rows.last
        own = float(costs(row[item], self._distances))
        many = live_rows(row.nbytes + 2 * len(row))
        self._rows.forget_but(many)
        self._search.forget_but(many)
        return Answer(self._check.queries - 1, item, -own, own < self._m)

    def extend(self, rows: Rows) -> None:
        """Take the next queries; `rows` (queries, items)."""
        for piece in pieces(as_table(rows)):
            self._advance(piece)

    def path(self) -> Path:
        """The best path so far, one reference a query; not accepted are those that cost m or more."""
        item = self._search.trace()
        scores = [row[at] for row, at in zip(self._rows.rows(), item, strict=True)]
        own = costs(np.array(scores), self._distances)
        return after(self._rows.first, Path(item, -own, own < self._m))

    def _advance(self, rows: Rows) -> NDArray[np.int64]:
        table = self._check(rows)
        self._rows.append(table.copy())
        return self._search.extend(-costs(table, self._distances))


def costs(scores: Any, distances: bool) -> NDArray[np.float64]:
    """The distances, or 1/similarity, of scores of any shape."""
    values = np.asarray(scores, np.float64)
    if distances:
        return -values
    return np.divide(1, values, out=np.full(values.shape, IMPOSSIBLE), where=values >= 1e-9)
