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

from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.sources.readers import _columns, _order
from evplace.sources.readers._source import Block, Hints, Source, printable

EVENTS = 1 << 18
"""Events read at a time."""
THREADS = 4
"""One a column: each takes memory of its own, whatever the machine has."""
BUFFER = 1 << 20
"""Bytes of a column read ahead; without it, a group of rows is read whole."""
FAULTS = (pyarrow.ArrowException, OSError, ValueError, KeyError, TypeError)
"""What reading a damaged file raises."""


def open_here(path: Path, hints: Hints) -> Source:
    """The columns and the unit of time; RecordingError where they are missing or not clear."""
    try:
        pyarrow.set_cpu_count(THREADS)
        pyarrow.set_io_thread_count(1)
        with pyarrow.parquet.ParquetFile(path) as file:
            names = list(file.schema_arrow.names)
            order = _order_of(path, names, hints)
            stated = file.schema_arrow.field(order.t).type
        columns = {"t": names[order.t], "x": names[order.x], "y": names[order.y], "p": names[order.p]}
        if order.part is not None:
            columns["part"] = names[order.part]
        unit, notes = _unit(path, columns, stated, hints) if order.part is None else ("s", [])
    except pyarrow.ArrowNotImplementedError as error:
        raise UnsupportedError(f"{path} is not read: {' '.join(str(error).split())}") from error
    except FAULTS as error:
        raise RecordingError(f"{path} is a damaged Parquet file: {' '.join(str(error).split())}") from error
    return Source(None, partial(_blocks, path, columns, unit, order.part_ns), notes)


def _order_of(path: Path, names: list[str], hints: Hints) -> _order.Order:
    """The columns as the caller says, else by their names."""
    if hints.columns is not None and len(hints.columns) == len(names):
        return _order.said(hints.columns)
    try:
        order = _order.complete(_order.named(names))
    except _order.UnclearError as error:
        raise RecordingError(f"{path}: {error}: give each column a name of its own") from error
    if order is None or hints.columns is not None:
        held = printable(", ".join(names))
        raise RecordingError(f"{path}: columns t, x, y and p are needed; it holds {held}")
    return order


def _unit(path: Path, columns: dict[str, str], stated: Any, hints: Hints) -> tuple[str, list[str]]:
    """The unit that a column of Parquet's own time type states, else what `_columns` makes of the numbers."""
    if hints.time_unit is None and (pyarrow.types.is_timestamp(stated) or pyarrow.types.is_duration(stated)):
        return str(stated.unit), []
    sample = next(_slices(path, columns), {"t": np.empty(0, np.int64)})["t"]
    return _columns.time_unit(columns["t"], sample, hints) if len(sample) else ("us", [])


def _slices(path: Path, columns: dict[str, str]) -> Iterator[dict[str, NDArray[Any]]]:
    with pyarrow.parquet.ParquetFile(path, buffer_size=BUFFER, pre_buffer=False) as file:
        for batch in file.iter_batches(EVENTS, columns=list(columns.values())):
            yield {field: _numbers(batch.column(name), field == "t") for field, name in columns.items()}


def _numbers(column: Any, time: bool) -> NDArray[Any]:
    """A column as numbers, NaN where it has none; TypeError where it holds something else."""
    kind = column.type
    if time and (pyarrow.types.is_timestamp(kind) or pyarrow.types.is_duration(kind)):
        column = column.cast(pyarrow.int64())
    values: NDArray[Any] = column.to_numpy(zero_copy_only=False)
    if values.dtype.kind == "O" and pyarrow.types.is_boolean(kind):  # one without nulls is of numbers
        values = column.cast(pyarrow.int8()).to_numpy(zero_copy_only=False)
    if values.dtype.kind not in "biuf":
        raise TypeError(f"t, x, y and p must be numbers, not {kind}")
    return values


def _blocks(path: Path, columns: dict[str, str], unit: str, part_ns: int) -> Iterator[Block]:
    try:
        for rows in _slices(path, columns):
            yield _columns.of_rows(rows, unit, part_ns)
    except pyarrow.ArrowNotImplementedError as error:
        raise UnsupportedError(f"{path} is not read: {' '.join(str(error).split())}") from error
    except FAULTS as error:
        raise DamagedRecordingError(f"{path} breaks off: {' '.join(str(error).split())}") from error
