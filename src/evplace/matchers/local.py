"""Algorithm 1 of the paper: look near the last match first, then everywhere, else say "not seen before"."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import SettingsError
from evplace.matchers import Answer, Matching, Path, Row, Rows, Sweep
from evplace.matchers._rows import Answers, RowCheck


@dataclass(frozen=True)
class Local:
    """Algorithm 1; scores are probabilities for the paper's thresholds, any score for your own.

    Neighbours are items with neighbouring indices. Among equal scores the lowest item wins. Where the paper
    can be read in two ways, there is a choice.
    """

    K: int = 5
    """Items to either side of the last match that the local test looks at. The paper gives none;
    5 is the fan-out of the graph matcher that it builds on."""
    tau1: float = 0.99
    """Global threshold: a match anywhere must score above it. Paper: 0.99."""
    tau2: float = 0.01
    """Local threshold: a match in the window must score above it. Paper: 0.01."""
    first: Literal["test", "argmax"] = "test"
    """The first query: "test" it against tau1 like any lost one, or take its "argmax" whatever it scores
    (the paper's first line; a wrong start is then held by the low tau2)."""
    lost: Literal["global", "keep_last"] = "global"
    """After a query that matched nothing: only the "global" test, or "keep_last" accepted match as the
    centre of the local one (more recall, less precision)."""
    window: Literal["inclusive", "half_open"] = "inclusive"
    """[last - K, last + K], or "half_open" [last - K, last + K) as the paper's notation has it in Python,
    which with K = 1 can never move forward."""
    wrap: bool = False
    """Whether the last item neighbours the first, as on a closed route; else the window ends with the map."""
    last_item: bool = True
    """Whether the map's last item can win the local test. False is an off-by-one of the author's notebook."""

    def __post_init__(self) -> None:
        """Raise SettingsError for a window that cannot hold an item."""
        least = 1 if self.window == "half_open" else 0
        if least > self.K:
            raise SettingsError(f"K = {self.K} leaves the window empty: take at least {least}")

    presets: ClassVar[Mapping[str, Local]]
    causal: ClassVar[bool] = True

    def start(self, distances: bool = False) -> Matching:  # noqa: ARG002 - a distance is the score -d
        """See Matcher."""
        return _LocalMatching(self)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher."""
        return Sweep(parameter or "tau1", self)


Local.presets = {"paper": Local(first="argmax"), "notebook": Local(K=1, tau2=1e-5, last_item=False)}


class _LocalMatching:
    """Remembers the last match."""

    def __init__(self, settings: Local) -> None:
        self._check, self._answers = RowCheck(), Answers()
        self._rules = rules(settings)
        self._state = np.array([-1, 0], np.int64)

    def step(self, row: Row) -> Answer:
        """The match of this query, or item -1 and the best score that was too low; `row` (items,)."""
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
        item, score = follow(self._check(rows), self._state, *self._rules)
        answer = Path(item, score, item >= 0)
        self._answers.extend(*answer)
        return answer


def rules(settings: Local) -> tuple[float, float, int, int, bool, bool, bool, bool]:
    """The settings as `follow` takes them."""
    ahead = settings.K if settings.window == "inclusive" else settings.K - 1
    always_first, keep = settings.first == "argmax", settings.lost == "keep_last"
    last_item = settings.last_item
    return settings.tau1, settings.tau2, settings.K, ahead, settings.wrap, last_item, always_first, keep


@njit(cache=True)
def follow(
    rows: NDArray[np.floating[Any]],
    state: NDArray[np.int64],
    tau1: float,
    tau2: float,
    behind: int,
    ahead: int,
    wrap: bool,
    last_item: bool,
    always_first: bool,
    keep: bool,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Algorithm 1 over (queries, items) rows -> items (queries,), -1 for unseen, and their scores.

    `state` is (2,): centre of the next window or -1, queries seen; it is updated.
    """
    queries = rows.shape[0]
    item, score = np.empty(queries, np.int64), np.empty(queries, np.float64)
    for i in range(queries):
        best = -1
        if state[0] >= 0:
            best = _local_max(rows[i], state[0], behind, ahead, wrap, last_item)
        if best < 0 or not rows[i, best] > tau2:
            best = _argmax(rows[i])
            accepted = rows[i, best] > tau1 or (always_first and state[1] == 0)
        else:
            accepted = True
        item[i], score[i] = best if accepted else -1, rows[i, best]
        if accepted or not keep:
            state[0] = item[i]
        state[1] += 1
    return item, score


@njit(cache=True)
def _local_max(
    row: NDArray[np.floating[Any]], centre: int, behind: int, ahead: int, wrap: bool, last_item: bool
) -> int:
    """The best item of the window, the lowest among equals, -1 where the window holds none."""
    items = row.shape[0]
    best = -1
    for j in range(centre - behind, centre + ahead + 1):
        if not wrap and (j < 0 or j >= items):
            continue
        k = j % items
        if k == items - 1 and not last_item:
            continue
        if best < 0 or row[k] > row[best] or (row[k] == row[best] and k < best):
            best = k
    return best


@njit(cache=True)
def _argmax(row: NDArray[np.floating[Any]]) -> int:
    best = 0
    for i in range(1, row.shape[0]):
        if row[i] > row[best]:
            best = i
    return best
