"""What every matcher asks of score rows, and where it keeps its answers."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.errors import ScoresError
from evplace.matchers import Path, Rows


class Answers:
    """Answers of the queries so far: 17 bytes a query, so that a day's drive fits anywhere."""

    def __init__(self) -> None:
        self._item, self._score, self._accepted = array("q"), array("d"), array("b")

    def __len__(self) -> int:
        return len(self._item)

    def extend(
        self, item: NDArray[np.int64], score: NDArray[np.float64], accepted: NDArray[np.bool_]
    ) -> None:
        """Add the answers of the next queries, three arrays (queries,)."""
        self._item.frombytes(item.astype(np.int64, copy=False).tobytes())
        self._score.frombytes(score.astype(np.float64, copy=False).tobytes())
        self._accepted.frombytes(accepted.astype(np.int8).tobytes())

    def path(self) -> Path:
        """All answers, copied."""
        return Path(
            np.array(self._item, np.int64),
            np.array(self._score, np.float64),
            np.array(self._accepted, np.int8).astype(np.bool_),
        )


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
