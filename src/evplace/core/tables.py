"""Tables of score rows that may be larger than memory: these lie in a file without a name."""

from __future__ import annotations

import math
import tempfile
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError

Rows = NDArray[np.float32]
"""(queries, items)."""
MEMORY_BYTES = 1 << 28
"""The largest table that is held in memory."""
CHUNK = 1 << 24
"""Bytes written at once."""


def empty_rows(queries: int, items: int, kind: np.dtype[Any] | type[np.float32] = np.float32) -> Rows:
    """(queries, items) zeros, of float32 or another `kind`.

    InputError where neither memory nor disk should hold them. Of a table in a file, the system holds in
    memory what it has room for.
    """
    size = queries * items * np.dtype(kind).itemsize
    if size <= MEMORY_BYTES:
        return np.zeros((queries, items), kind)
    try:
        with tempfile.TemporaryFile() as file:
            _fill(file, size)
            return np.memmap(file, kind, "r+", shape=(queries, items))
    except OSError as error:
        raise InputError(
            f"{queries} x {items} scores, {1e-9 * size:.1f} GB, do not fit into "
            f"{tempfile.gettempdir()} ({error.strerror}): set TMPDIR to a folder with more room"
        ) from error


def rows_of(rows: Rows, chosen: NDArray[np.int64]) -> Rows:
    """The chosen rows, in their order; the table itself where these are all."""
    if len(chosen) == len(rows):
        return rows
    some = empty_rows(len(chosen), rows.shape[1])
    for at, query in enumerate(chosen):
        some[at] = rows[query]
    return some


def _fill(file: IO[bytes], length: int) -> None:
    """Zeros are written, so that a full disk is told now: later the system would kill the process."""
    zeros = bytes(CHUNK)
    for _ in range(math.ceil(length / CHUNK)):
        file.write(zeros)
    file.flush()
