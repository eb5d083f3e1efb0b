"""What is kept of a drive: all of it where it was given in blocks; of a live one, the last stretch.

So `step` needs no more memory after a day than after an hour. No later step needs what it forgets; `path`
says -1 of queries so far back.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.matchers import Path

LIVE_BYTES = 1 << 26
"""What a live drive keeps of its rows: half a minute at 30 Hz and 6 bytes for each of 10,000 items."""
LIVE_ANSWERS = 1 << 14
"""How many answers a live drive keeps: nine minutes at 30 Hz."""


def live_rows(bytes_a_row: int) -> int:
    """How many rows a live drive keeps."""
    return max(LIVE_BYTES // bytes_a_row, 1)


class Kept:
    """Blocks (queries, ...) one behind the other."""

    def __init__(self) -> None:
        self._blocks: deque[NDArray[Any]] = deque()
        self._queries = 0
        self.first = 0
        """The first query whose row is still here."""

    def __len__(self) -> int:
        """Queries so far, forgotten ones too."""
        return self._queries

    def append(self, block: NDArray[Any]) -> None:
        """The rows of the next queries."""
        self._blocks.append(block)
        self._queries += len(block)

    def forget_but(self, many: int) -> None:
        """Forget all but the last `many` queries, and those in one block with them."""
        while self._blocks and self._queries - self.first - len(self._blocks[0]) >= many:
            self.first += len(self._blocks.popleft())

    @property
    def last(self) -> NDArray[Any]:
        """The row of the last query."""
        row: NDArray[Any] = self._blocks[-1][-1]
        return row

    def rows(self) -> Iterator[NDArray[Any]]:
        """The rows that are still here, one after another."""
        return (row for block in self._blocks for row in block)

    def backwards(self) -> Iterator[NDArray[Any]]:
        """The same from the last to the first."""
        return (row for block in reversed(self._blocks) for row in block[::-1])

    def table(self) -> NDArray[Any]:
        """All rows that are still here as one array."""
        return np.concatenate(self._blocks)


def after(forgotten: int, path: Path) -> Path:
    """A path with so many queries before it of which nothing is known any more."""
    if not forgotten:
        return path
    nothing = Path(np.full(forgotten, -1), np.full(forgotten, np.nan), np.zeros(forgotten, np.bool_))
    return Path(*(np.concatenate(columns) for columns in zip(nothing, path, strict=True)))
