"""What every matcher asks of score rows, and where it keeps its answers."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import ScoresError
from evplace.matchers import Path, Rows
from evplace.matchers._kept import LIVE_ANSWERS, after


class Columns:
    """A table that grows by rows: a few numbers a query, so that a day's drive fits anywhere."""

    def __init__(self, codes: str) -> None:
        self._columns = [array(code) for code in codes]
        self.first = 0
        """The first query whose values are still here."""

    def __len__(self) -> int:
        """Queries so far, forgotten ones too."""
        return self.first + len(self._columns[0])

    def extend(self, *values: NDArray[Any]) -> None:
        """Add to each column the values of the next queries, an array (queries,) each."""
        for column, value in zip(self._columns, values, strict=True):
            column.frombytes(value.astype(np.dtype(column.typecode), copy=False).tobytes())

    def forget_old(self) -> None:
        """For a live drive: forget all but the last queries, so that the table does not grow."""
        old = len(self._columns[0]) - LIVE_ANSWERS
        if old >= LIVE_ANSWERS:
            for column in self._columns:
                del column[:old]
            self.first += old

    def arrays(self) -> list[NDArray[Any]]:
        """The columns, copied, from the query `first`."""
        return [np.array(column, np.dtype(column.typecode)) for column in self._columns]


class Answers(Columns):
    """What was said of the queries so far, by a matcher that never takes back an answer."""

    def __init__(self) -> None:
        super().__init__("qdb")

    def path(self) -> Path:
        """All answers, copied; -1 for those that are forgotten."""
        item, score, accepted = self.arrays()
        return after(self.first, Path(item, score, accepted.astype(np.bool_)))


class RowCheck:
    """Score rows as every kernel takes them; all rows of one matcher must have one length."""

    def __init__(self) -> None:
        self.items = 0
        """Map items a row, 0 before the first."""
        self.queries = 0
        """Rows seen so far."""

    def __call__(self, rows: Rows) -> NDArray[np.floating[Any]]:
        """(queries, items) contiguous float32, or float64 where they came so.

        Raises ScoresError for rows that are no table of numbers, have another length than those before,
        or hold NaN or infinity.
        """
        table = as_table(rows)
        if self.items and table.shape[1] != self.items:
            raise ScoresError(
                f"query {self.queries} has {table.shape[1]} scores, those before it {self.items}: "
                "give every query one score for each map item"
            )
        refuse_not_finite(table, self.queries)
        self.items = table.shape[1]
        self.queries += len(table)
        return table


def above(score: NDArray[np.float64], value: float) -> NDArray[np.bool_]:
    """A Judge: accepted is what scores above the value."""
    return score > value


def costs_below(score: NDArray[np.float64], value: float) -> NDArray[np.bool_]:
    """A Judge: accepted is what costs less than the value, where a score is a cost, negated."""
    return -score < value


def as_table(rows: object) -> NDArray[np.floating[Any]]:
    """`rows` as (queries, items) contiguous floats; ScoresError where they are no such table."""
    table = np.asarray(rows)
    if table.dtype.kind not in "fiub":
        raise ScoresError(f"scores are real numbers, but these are of type {table.dtype}")
    if table.ndim != 2:
        raise ScoresError(f"scores have the shape (queries, map items), but these have {table.shape}")
    if table.shape[1] == 0:
        raise ScoresError("the score rows are empty: the map has no item to match")
    dtype = np.float64 if table.dtype.kind != "f" or table.dtype.itemsize > 4 else np.float32
    return np.ascontiguousarray(table, dtype)


def refuse_not_finite(table: NDArray[np.floating[Any]], first: int = 0) -> None:
    """ScoresError where a score is not finite, naming query and item; the first row is query `first`."""
    finite = np.isfinite(table)
    if not finite.all():
        query, item = np.argwhere(~finite)[0]
        raise ScoresError(
            f"the score of query {first + query} and item {item} is {table[query, item]}: "
            "scores must be finite, leave out queries that have none"
        )
