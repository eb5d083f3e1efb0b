"""Events in the columns of a Parquet file, one row group after the other."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
import pyarrow.parquet
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.sources.readers import _columns
from evplace.sources.readers._source import Block, Hints, Source

EVENTS = 1 << 18
"""Events read at a time."""
FAULTS = (pyarrow.ArrowException, OSError, ValueError, KeyError, TypeError)
"""What reading a damaged file raises."""


def open_here(path: Path, hints: Hints) -> Source:
    """The columns and the unit of time; RecordingError where they are missing or not clear."""
    try:
        with pyarrow.parquet.ParquetFile(path) as file:
            names = list(file.schema_arrow.names)
            columns = _columns.named(names)
            if columns is None:
                raise RecordingError(f"{path}: columns t, x, y and p are needed; it holds {', '.join(names)}")
            stated = str(file.schema_arrow.field(columns["t"]).type)
        unit, notes = _unit(path, columns, stated, hints)
    except FAULTS as error:
        raise RecordingError(f"{path} is a damaged Parquet file: {' '.join(str(error).split())}") from error
    return Source(None, partial(_blocks, path, columns, unit), notes)


def _unit(path: Path, columns: dict[str, str], stated: str, hints: Hints) -> tuple[str, list[str]]:
    """The unit that a column of Parquet's own time type states, else what `_columns` makes of the numbers."""
    for unit in ("ns", "us", "ms", "s"):
        if hints.time_unit is None and stated.startswith((f"timestamp[{unit}", f"duration[{unit}")):
            return unit, []
    sample = next(_slices(path, columns), {"t": np.empty(0, np.int64)})["t"]
    return _columns.time_unit(columns["t"], sample, hints) if len(sample) else ("us", [])


def _slices(path: Path, columns: dict[str, str]) -> Iterator[dict[str, NDArray[Any]]]:
    with pyarrow.parquet.ParquetFile(path) as file:
        for batch in file.iter_batches(EVENTS, columns=list(columns.values())):
            yield {field: _numbers(batch.column(name)) for field, name in columns.items()}


def _numbers(column: Any) -> NDArray[Any]:
    """A column as numbers; TypeError where it holds none."""
    values: NDArray[Any] = column.to_numpy(zero_copy_only=False)
    if values.dtype.kind in "mM":
        return values.astype(np.int64)
    if values.dtype.kind not in "biuf":
        raise TypeError("t, x, y and p must be numbers")
    return values


def _blocks(path: Path, columns: dict[str, str], unit: str) -> Iterator[Block]:
    try:
        for part in _slices(path, columns):
            yield _columns.block(part["t"], part["x"], part["y"], part["p"], unit)
    except FAULTS as error:
        raise DamagedRecordingError(f"{path} breaks off: {' '.join(str(error).split())}") from error
