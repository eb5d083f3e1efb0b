"""Graph-based matching: the cheapest path through queries x references, expanded lazily, one query at a time.

After Vysotska and Stachniss, "Lazy data association for image sequences matching under substantial
appearance changes" (RA-L 2016), and their programs online_place_recognition (opr), vpr_relocalization
and image_sequence_localizer (isl), whose answers it gives.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import ScoresError, SettingsError
from evplace.matchers import Answer, Matching, Path, Row, Rows, Sweep
from evplace.matchers import _graph_search as search
from evplace.matchers._rows import RowCheck

_WAYS = {"none": search.NONE, "all": search.ALL, "window": search.WINDOW, "high": search.OFFERED}


@dataclass(frozen=True)
class Graph:
    """The graph matcher, its parameters under the originals' short names.

    Costs are 1/similarity (a similarity below 1e-9 never matches), or distances. Among equally cheap children
    the lowest reference wins; ties between branches are broken in a fixed way.
    """

    K: int = 5
    """Fan-out: from one query to the next the match moves by at most K references, either way.isl: 5."""
    alpha: float = 0.3
    """Expansion rate: how readily a branch is given up for the best path, from near 0 (search nearly the
    whole matrix) to 1 (greedy). isl: 0.3, opr: 0.7; paper: 0.1, as 0.7 did badly."""
    m: float | None = None
    """Non-matching cost: a node of the path that costs more is hidden, that is not accepted; five in a row
    mean lost. In units of 1/similarity, or of the distance. Default: 3.7 for similarities (isl, for cosines
    of network features), none for distances: nothing is hidden."""
    relocalise: Literal["all", "window", "high", "none"] = "all"
    """Where to look when lost, which is also how to start: at "all" references, in the "window" of K about
    the query's own number (isl; it takes both drives to be aligned), at those with "high" scores
    (the upper 30 % of the row's range), or start with all and never look again, "none" (opr)."""
    memory: int = 1000
    """Score rows kept, for branches that lag behind the best path; older ones are given up. 0 keeps all: for
    drives, not for days."""

    def __post_init__(self) -> None:
        """Raise SettingsError for values out of range."""
        if self.K < 1:
            raise SettingsError(f"K = {self.K} leaves no reference to move to: take at least 1")
        if not 0 <= self.alpha <= 1:
            raise SettingsError(f"alpha = {self.alpha} is out of range: it goes from 0 to 1")
        if self.memory < 0 or self.memory == 1:
            raise SettingsError(f"memory = {self.memory} rows cannot work: take at least 2, or 0 for all")

    presets: ClassVar[Mapping[str, Graph]]
    causal: ClassVar[bool] = False
    of_similarities: ClassVar[bool] = True
    """Costs are 1/similarity: scores above 0, where they are no distances."""

    def start(self, distances: bool = False) -> Matching:
        """See Matcher."""
        return _LazySearch(self, distances)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher."""
        judges = self.relocalise == "none" and parameter in (None, "m")  # else m also says when it is lost
        return Sweep(parameter or "m", self, _costs_at_most if judges else None, _costs)


Graph.presets = {
    "opr": Graph(alpha=0.7, m=6.0, relocalise="none", memory=0),
    "isl": Graph(alpha=0.3, m=3.7, relocalise="all", memory=0),
}


class _LazySearch:
    """Remembers the searched part of the graph, live that of the last `memory` rows, and these rows.

    `step` answers with the end of the best path so far, `path` with the whole of it, which may differ from
    what `step` said. The score is the node's cost, negated.
    """

    def __init__(self, settings: Graph, distances: bool = False) -> None:
        self._check, self._distances, self._memory = RowCheck(), distances, settings.memory
        m = np.inf if settings.m is None and distances else 3.7 if settings.m is None else settings.m
        self._rules = (settings.K, settings.alpha, m, _WAYS[settings.relocalise], distances)
        self._m = m
        self._nodes, self._heap = np.empty(1 << 12, search.NODE), np.empty(1 << 12, search.ENTRY)
        self._state = search.start(self._nodes)
        self._scores: NDArray[np.floating[Any]] = np.empty((0, 0))
        self._grid = np.empty((0, 0), np.int32)

    @property
    def evaluated(self) -> int:
        """How many cells of the matrix were looked at; the originals' measure of work."""
        return int(self._state[search.EVALUATED])

    def step(self, row: Row) -> Answer:
        """Where this query is, by the best path so far; `row` (items,)."""
        self._take(row[None], live=True)
        node = self._nodes[self._state[search.BEST]]
        return Answer(
            int(node["query"]), int(node["item"]), -float(node["own"]), bool(node["own"] <= self._m)
        )

    def extend(self, rows: Rows) -> None:
        """Take the next queries; `rows` (queries, items)."""
        self._take(rows, live=False)

    def _take(self, rows: Rows, live: bool) -> None:
        table = self._check(rows)
        if self._distances and (table > 0).any():
            raise ScoresError("a distance is negative: the graph takes distances from 0, or similarities")
        offered = np.empty(0, np.int64)
        done = 0
        while done < len(table):
            self._make_room(table[done:], live)
            done += search.advance(
                table[done:],
                offered,
                self._scores,
                self._grid,
                self._nodes,
                self._heap,
                self._state,
                *self._rules,
            )
            if done < len(table) and self._state[search.WANTED]:
                offered = high_scores(table[done])

    def path(self) -> Path:
        """The best path so far, one reference a query; not accepted are those that cost more than m."""
        item, own = search.trace(self._nodes, int(self._state[search.BEST]))
        return Path(item, -own, own <= self._m)

    def _make_room(self, rows: NDArray[np.floating[Any]], live: bool) -> None:
        """Rings for `memory` rows, or for all; nodes for at least one more query."""
        queries, items = int(self._state[search.QUERIES]), rows.shape[1]
        wanted = self._memory or queries + len(rows)
        if queries == 0 or wanted > len(self._scores):
            length = wanted if queries == 0 else max(wanted, 2 * len(self._scores))
            scores, grid = np.empty((length, items), rows.dtype), np.zeros((length, items), np.int32)
            if queries:
                scores[:queries], grid[:queries] = self._scores[:queries], self._grid[:queries]
            self._scores, self._grid = scores, grid
        more = items + 2 * self._rules[0] + 1
        needed = int(self._state[search.NODES]) + more
        if needed > len(self._nodes) and live and self._memory:
            search.forget(queries - self._memory, self._grid, self._nodes, self._heap, self._state)
            needed = 2 * (int(self._state[search.NODES]) + more)  # or it would soon be full again
        if needed > len(self._nodes):
            self._nodes = _grown(self._nodes, max(needed, 2 * len(self._nodes)))
            self._heap = _grown(self._heap, len(self._nodes))


def _costs_at_most(score: NDArray[np.float64], value: float) -> NDArray[np.bool_]:
    return -score <= value


def _costs(best: NDArray[np.float64], distances: bool) -> NDArray[np.float64]:
    return -best if distances else 1 / np.maximum(best, 1e-9)


def high_scores(row: Row) -> NDArray[np.int64]:
    """The references in the upper 30 % of the row's range: the cut that the originals put to hash votes."""
    least, most = row.min(), row.max()
    return np.flatnonzero(row >= least + 0.7 * (most - least))


def _grown(table: NDArray[Any], length: int) -> NDArray[Any]:
    """`table` with room for `length` entries."""
    larger = np.empty(length, table.dtype)
    larger[: len(table)] = table
    return larger
