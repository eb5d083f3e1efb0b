"""What is kept of a drive: all of it where it was given in blocks; of a live one, the last stretch.

So `step` needs no more memory after a day than after an hour. No later step needs what it forgets; `path`
says -1 of queries so far back. Blocks beyond what memory should hold are written to a file without a name.
"""

from __future__ import annotations

import math
import tempfile
import weakref
from collections import deque
from collections.abc import Iterator
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError
from evplace.core.tables import empty_rows
from evplace.matchers import Path

LIVE_BYTES = 1 << 26
"""What a live drive keeps of its rows: half a minute at 30 Hz and 6 bytes for each of 10,000 items."""
MEMORY_BYTES = 1 << 28
"""What each of a drive's tables holds in memory; the rest of it is written to a file."""
LIVE_ANSWERS = 1 << 14
"""How many answers a live drive keeps: nine minutes at 30 Hz."""


def live_rows(bytes_a_row: int) -> int:
    """How many rows a live drive keeps."""
    return max(LIVE_BYTES // bytes_a_row, 1)


class _Written(NamedTuple):
    """A block in the file."""

    start: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def __len__(self) -> int:
        return self.shape[0]


class Kept:
    """Blocks (queries, ...) one behind the other."""

    def __init__(self) -> None:
        self._blocks: deque[NDArray[Any] | _Written] = deque()
        self._file: IO[bytes] | None = None
        self._held = self._queries = 0
        self.first = 0
        """The first query whose row is still here."""

    def __len__(self) -> int:
        """Queries so far, forgotten ones too."""
        return self._queries

    def append(self, block: NDArray[Any]) -> None:
        """The rows of the next queries; InputError where neither memory nor disk should hold them."""
        fits = self._held + block.nbytes <= MEMORY_BYTES
        self._blocks.append(block if fits else self._written(block))
        self._held += block.nbytes if fits else 0
        self._queries += len(block)

    def _written(self, block: NDArray[Any]) -> _Written:
        try:
            if self._file is None:
                self._file = tempfile.TemporaryFile()  # noqa: SIM115 - closed when these rows are no more
                weakref.finalize(self, self._file.close)
            start = self._file.seek(0, 2)
            self._file.write(np.ascontiguousarray(block).data)
            self._file.flush()
        except OSError as error:
            raise InputError(
                f"what a path through {self._queries} queries needs does not fit into "
                f"{tempfile.gettempdir()} ({error.strerror}): set TMPDIR to a folder with more room, or ask "
                "for live answers"
            ) from error
        return _Written(start, block.shape, block.dtype)

    def _read(self, block: NDArray[Any] | _Written) -> NDArray[Any]:
        if not isinstance(block, _Written):
            return block
        assert self._file is not None
        self._file.seek(block.start)
        many = math.prod(block.shape)
        return np.frombuffer(self._file.read(many * block.dtype.itemsize), block.dtype).reshape(block.shape)

    def forget_but(self, many: int) -> None:
        """Forget all but the last `many` queries, and those in one block with them."""
        while self._blocks and self._queries - self.first - len(self._blocks[0]) >= many:
            block = self._blocks.popleft()
            self.first += len(block)
            self._held -= 0 if isinstance(block, _Written) else block.nbytes

    @property
    def last(self) -> NDArray[Any]:
        """The row of the last query."""
        row: NDArray[Any] = self._read(self._blocks[-1])[-1]
        return row

    def rows(self) -> Iterator[NDArray[Any]]:
        """The rows that are still here, one after another."""
        return (row for block in self._blocks for row in self._read(block))

    def backwards(self) -> Iterator[NDArray[Any]]:
        """The same from the last to the first."""
        return (row for block in reversed(self._blocks) for row in self._read(block)[::-1])

    def table(self) -> NDArray[Any]:
        """All rows (queries, items) that are still here as one array, which may lie in a file."""
        first = self._blocks[0]
        found = empty_rows(self._queries - self.first, first.shape[1], first.dtype)
        at = 0
        for block in self._blocks:
            found[at : at + len(block)] = self._read(block)
            at += len(block)
        return found


def after(forgotten: int, path: Path) -> Path:
    """A path with so many queries before it of which nothing is known any more."""
    if not forgotten:
        return path
    nothing = Path(np.full(forgotten, -1), np.full(forgotten, np.nan), np.zeros(forgotten, np.bool_))
    return Path(*(np.concatenate(columns) for columns in zip(nothing, path, strict=True)))
