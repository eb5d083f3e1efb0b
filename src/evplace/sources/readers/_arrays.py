"""Arrays under names, as HDF5 and numpy files hold them: which of them hold events, and how.

Events are four rows under usual names; one table whose fields have names; one table of numbers, (N, 4) or
(4, N), whose columns are told by their values; or rows in which x and y stand side by side, (N, 2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import RecordingError
from evplace.core.events import Size
from evplace.sources.readers import _order
from evplace.sources.readers._source import Hints

SAMPLE = 1 << 16
"""Rows from which the columns of a table are told."""
SLICE_BYTES = 1 << 25
"""Bytes of an array that are read at a time, at most."""
MOST_COLUMNS = 8
"""A table of events has four columns or a few more."""
MOST_BYTES = 1 << 12
"""An event takes no more than this, whatever else stands beside it."""
PAIRS = {"xy", "coordinates", "coords"}
"""Words for arrays of x and y side by side."""


class Kind(NamedTuple):
    """What an array is."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]


class Field(NamedTuple):
    """Where the values of a field lie."""

    array: str
    name: str | None = None
    """The field's name in a table whose fields have names."""
    column: int | None = None
    """The column of a table of numbers; of (k, N), the row."""


class Layout(NamedTuple):
    """Where events lie."""

    fields: dict[str, Field]
    """t, x, y and p, and perhaps `part`."""
    time_name: str
    part_ns: int = 1
    notes: tuple[str, ...] = ()


Sample = Callable[[str, int], NDArray[Any]]
"""(name of a table, rows) -> its first rows, (n, k)."""


def layouts(
    kinds: Mapping[str, Kind], sample: Sample, hints: Hints, size: Size | None
) -> dict[str, Layout | str]:
    """Name of a table, or an empty one for rows under names -> its layout, or why it is not clear."""
    found: dict[str, Layout | str] = {}
    for name, kind in kinds.items():
        layout = (
            _of_fields(name, kind, hints) if kind.dtype.names else _of_table(name, kind, sample, hints, size)
        )
        if layout is not None:
            found[name] = layout
    try:
        rows: Layout | str | None = _of_rows(kinds) if hints.columns is None else None
    except _order.UnclearError as error:
        rows = str(error)
    return found | ({"": rows} if rows is not None else {})


def is_upright(kind: Kind) -> bool:
    """Whether a table is (N, k), not (k, N)."""
    return kind.shape[1] <= MOST_COLUMNS


def _of_fields(name: str, kind: Kind, hints: Hints) -> Layout | None:
    names = kind.dtype.names or ()
    if len(kind.shape) != 1:
        return None
    if hints.columns is not None:
        order = _order.said(hints.columns) if len(hints.columns) == len(names) else None
    else:
        order = _order.complete(_order.named(names))
    return None if order is None else _laid_out(order, [Field(name, field) for field in names], list(names))


def _of_table(name: str, kind: Kind, sample: Sample, hints: Hints, size: Size | None) -> Layout | str | None:
    """Of a table of numbers; text that says why its columns are not clear."""
    if kind.dtype.kind not in "biuf" or len(kind.shape) != 2 or not 4 <= min(kind.shape) <= MOST_COLUMNS:
        return None
    count = kind.shape[1] if is_upright(kind) else kind.shape[0]
    if hints.columns is not None:
        order = _order.said(hints.columns) if len(hints.columns) == count else None
        return None if order is None else _laid_out(order, _columns(name, count), ["t"] * count)
    try:
        order = _order.by_values(sample(name, SAMPLE), {}, size)
    except _order.UnclearError as error:
        return f"{error}: give `columns=t,x,y,p` in their order"
    if order is None:
        return None
    note = f"columns are taken as {order.words(count)} by their values; where wrong, give `columns=NAMES`"
    return _laid_out(order, _columns(name, count), ["t"] * count)._replace(notes=(note,))


def _columns(name: str, count: int) -> list[Field]:
    return [Field(name, column=column) for column in range(count)]


def _of_rows(kinds: Mapping[str, Kind]) -> Layout | None:
    """Of arrays under usual names."""
    places, names = [], []
    for name, kind in kinds.items():
        if len(kind.shape) == 2 and min(kind.shape) == 2 and PAIRS & set(_order.words_of(name)):
            places += [Field(name, column=0), Field(name, column=1)]
            names += ["x", "y"]
        else:
            places.append(Field(name))
            names.append(name)
    order = _order.complete(_order.named(names))
    return None if order is None else _laid_out(order, places, names)


def _laid_out(order: _order.Order, places: list[Field], names: list[str]) -> Layout:
    fields = {field: places[getattr(order, field)] for field in ("t", "x", "y", "p")}
    if order.part is not None:
        fields["part"] = places[order.part]
    return Layout(fields, "t_s" if order.part is not None else names[order.t], order.part_ns)


def checked(where: str, layout: Layout, kinds: Mapping[str, Kind]) -> int:
    """Events in all; RecordingError where the fields are no numbers or of several lengths."""
    lengths, dtypes = set(), set()
    for field in layout.fields.values():
        kind = kinds[field.array]
        if len(kind.shape) != (1 if field.column is None else 2):
            lengths |= {-1, 0}  # which fit nothing
        flat = field.column is None or is_upright(kind)
        lengths.add(kind.shape[0] if kind.shape and flat else kind.shape[-1] if kind.shape else 0)
        dtypes.add((kind.dtype if field.name is None else kind.dtype[field.name]).kind)
        if kind.dtype.itemsize > MOST_BYTES:
            raise RecordingError(f"{where}: rows of {kind.dtype.itemsize:,} bytes are no events")
    if not dtypes <= set("biuf") or len(lengths) != 1:
        held = sorted({kinds[field.array].shape for field in layout.fields.values()})
        raise RecordingError(f"{where}: t, x, y and p must be rows of numbers of one length, not {held}")
    return int(lengths.pop())


def per_slice(layout: Layout, kinds: Mapping[str, Kind], most: int) -> int:
    """How many events are read at a time: `most`, or fewer where one takes many bytes."""
    widest = max(kinds[field.array].dtype.itemsize for field in layout.fields.values())
    return min(most, SLICE_BYTES // max(widest, 1))
