"""Text with one event a line, also inside .zip or .gz: `t x y p`, `x y p t`, or columns in another order.

The order is told by a line of names, by the values, or by the caller (see `_order`). Numbers are separated by
blanks, tabs, commas or semicolons, and may stand in quotes; a polarity may be a word. A first line of two
numbers is the sensor's width and height; remarks (`#`, `%`) and names (`x@320`) may state it too. A name may
give the unit of time (`t_us`).
"""

from __future__ import annotations

import re
import zipfile
import zlib
from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.core.events import Size
from evplace.sources.readers import _columns, _order
from evplace.sources.readers._order import Order
from evplace.sources.readers._source import Block, Hints, Source, ordered, printable
from evplace.sources.readers._text_numbers import parse
from evplace.sources.readers._text_stream import HEAD, is_text, opened
from evplace.sources.readers._zip import members

ABOUT = "text, one event a line (.txt, .csv, also in .zip or .gz)"
TABLE = True
BYTES = 1 << 20
"""Bytes parsed at a time, and looked at for the order of the columns."""
SAMPLE, FEW = 1 << 15, 1 << 11
"""Rows from which the order of the columns is told, and from which it is only asked whether they have one."""
FAULTS = (
    zipfile.BadZipFile,
    zlib.error,
    OSError,
    EOFError,
    LookupError,
    NotImplementedError,
    RuntimeError,
    ValueError,
)
"""What unpacking a damaged archive raises."""
MOST_COLUMNS = 64
"""A line of more numbers than this is no event."""
SIZE = re.compile(r"(?:geometry|resolution|sensor|size)\D{0,3}(\d{1,5})\s*[x, ]\s*(\d{1,5})\b", re.IGNORECASE)
"""A remark that states width and height."""


class _Top(NamedTuple):
    """What stands before the events."""

    start: int
    """First byte of the events."""
    lines: int
    """Lines before it."""
    first: str
    """The first line of an event."""
    names: list[str]
    """Of the columns; empty where no line gives them."""
    size: Size | None


class _Layout(NamedTuple):
    member: str | None
    """The file's name in an archive."""
    start: int
    lines: int
    columns: int
    order: Order
    time_name: str
    size: Size | None
    notes: list[str]


def matches(path: Path, head: bytes) -> bool:
    """Whether its first lines, unpacked where need be, are events as text."""
    if path.is_dir() or not (head[:2] in (b"PK", b"\x1f\x8b") or is_text(head[:HEAD])):
        return False
    try:
        return any(_is_table(path, member) for member in _members(path))
    except FAULTS:
        return False


def read(path: Path, hints: Hints) -> Source:
    """Columns, sensor and unit; RecordingError where the columns or the unit of time are not clear."""
    try:
        held = _members(path)
        streams = [name for name in held if name is not None and _is_table(path, name)]
        streams = ordered(path, streams, hints.stream) if streams else []
        layout = _layout(path, streams[0] if streams else held[0] if held else None, hints)
    except FAULTS as error:
        raise RecordingError(f"{path} cannot be unpacked: {printable(str(error))}") from error
    if layout is None:
        raise RecordingError(f"{path}: no line holds t, x, y and p: give `columns=t,x,y,p` in their order")
    sample = _time_sample(path, layout)
    unit, notes = _columns.time_unit(layout.time_name, sample, hints) if len(sample) else ("us", [])
    return Source(layout.size, partial(_blocks, path, layout, unit), [*layout.notes, *notes], streams=streams)


def _members(path: Path) -> list[str | None]:
    """The texts in a zip archive, those of events first; for any other file None, the file itself."""
    with path.open("rb") as file:
        if file.read(2) != b"PK":
            return [None]
    return [*sorted(members(path, ".txt", ".csv"), key=lambda name: ("event" not in name, name))]


def _is_table(path: Path, member: str | None) -> bool:
    """Whether a text holds events, be the order of their columns clear or not."""
    try:
        return _layout(path, member, Hints(), FEW) is not None
    except RecordingError:
        return True


def _layout(path: Path, member: str | None, hints: Hints, rows: int = SAMPLE) -> _Layout | None:
    """Where the events start and which column is which; None where the first lines are no events.

    RecordingError, with the first line, where it could be more than one.
    """
    with opened(path, member) as file:
        head = file.read(BYTES)
    try:
        top = _top(head) if is_text(head[:HEAD]) else None
    except _order.UnclearError as error:
        raise RecordingError(f"{path}: {error}") from error
    if top is None:
        return None
    columns = len(_cells(top.first))
    where = f"{path}: line {top.lines + 1} ('{printable(top.first[:60])}')"
    if _has_decimal_commas(top.first):
        raise UnsupportedError(f"{where} has decimal commas, which are not read: write numbers with points")
    names = [""] * (columns - len(top.names)) + top.names if 0 <= columns - len(top.names) <= 1 else []
    size = hints.size or top.size
    try:
        order, notes = _which(names, columns, partial(_rows, head[top.start :], columns, rows), hints, size)
    except _order.UnclearError as error:
        raise RecordingError(f"{where}: {error}: give `columns=t,x,y,p` in their order") from error
    if order is None:
        return None
    time_name = "t_s" if order.part is not None else names[order.t] if names and not hints.columns else "t"
    return _Layout(member, top.start, top.lines, columns, order, time_name, top.size, notes)


def _top(head: bytes) -> _Top | None:
    """What stands before the first line of four numbers or more; None where there is no such line.

    UnclearError where names of all four are followed by a line that holds numbers, but not only.
    """
    names: list[str] = []
    size, position = None, 0
    for number, raw in enumerate(head.split(b"\n")):
        line = raw.decode("utf-8", "replace").strip(" \t\r")
        words = _cells(line)
        remark = re.match(r"[#%]+", line)
        if remark is None and 4 <= len(words) <= MOST_COLUMNS and all(map(_is_number, words)):
            return _Top(position, number, line, names, size or _size_of_names(names))
        stated = SIZE.search(line) if remark else re.fullmatch(r"(\d{1,5})[\s,;]+(\d{1,5})", line)
        if stated is not None and (remark is not None or number == 0):
            size = _possible(int(stated.group(1)), int(stated.group(2)))
        elif remark is None and any(map(_is_number, words)) and _are_complete(names):
            odd = next((f": '{printable(word[:30])}'" for word in words if not _is_number(word)), "")
            raise _order.UnclearError(f"line {number + 1} ('{printable(line[:60])}') is no event{odd}")
        elif words and len(said := _named_cells(line[remark.end() :] if remark else line)) >= 4:
            if remark is None or _are_complete(said):
                names = said
        elif words and remark is None:
            return None
        position += len(raw) + 1
    return None


def _are_complete(names: list[str]) -> bool:
    return _order.complete(_order.named([name.partition("@")[0] for name in names])) is not None


def _cells(line: str) -> list[str]:
    """The words of a line of numbers."""
    return [word for word in re.split(r"[\s,;\"']+", line) if word]


def _has_decimal_commas(line: str) -> bool:
    """Whether commas stand within numbers, not between them."""
    words = [word for word in re.split(r"[\s;\"']+", line) if word]
    return len(words) >= 4 and any(re.fullmatch(r"[+-]?\d+,\d+(e[+-]?\d+)?", word) for word in words)


def _named_cells(line: str) -> list[str]:
    """The names in a line, in which commas keep an empty one's place."""
    mark = next((mark for mark in ",;\t" if mark in line), None)
    return [word.strip(" \t\r\"'") for word in (line.split(mark) if mark else line.split())]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return word.lower() in ("true", "false", "on", "off")
    return "_" not in word


def _size_of_names(names: list[str]) -> Size | None:
    """The sensor in names such as x@320 and y@240."""
    sides = {name[:1].lower(): re.search(r"@(\d{1,5})$", name) for name in names}
    width, height = sides.get("x"), sides.get("y")
    return None if width is None or height is None else _possible(int(width.group(1)), int(height.group(1)))


def _possible(width: int, height: int) -> Size | None:
    return (width, height) if 0 < width <= 1 << 16 and 0 < height <= 1 << 16 else None


def _rows(text: bytes, columns: int, rows: int) -> NDArray[np.float64]:
    """The first rows, (n, columns)."""
    run = np.frombuffer(text[: text.rfind(b"\n") + 1] or text + b"\n", np.uint8)
    whole, fraction, _, _ = parse(run, columns, rows)
    return np.asarray(whole + fraction / 1e9, np.float64)


def _which(
    names: list[str],
    columns: int,
    sample: Callable[[], NDArray[np.float64]],
    hints: Hints,
    size: Size | None,
) -> tuple[Order | None, list[str]]:
    """The order of the columns, and a note where it is told by their values."""
    if hints.columns is not None:
        if len(hints.columns) != columns:
            raise _order.UnclearError(f"it has {columns} columns, not the {len(hints.columns)} of `columns`")
        return _order.said(hints.columns), []
    found = _order.named([name.partition("@")[0] for name in names])
    order = _order.complete(found)
    if order is not None or (names and not found and columns != 4):
        return order, []
    rows = sample()
    order = _order.by_values(rows, found, size) if len(rows) else None
    return order, [] if order is None else [order.note(columns)]


def _time_sample(path: Path, layout: _Layout) -> NDArray[np.float64] | NDArray[np.int64]:
    """Times of the first events, as fractions only where they are written so."""
    with closing(_parsed(path, layout)) as parts:
        try:
            whole, fraction = next(parts)
        except (StopIteration, DamagedRecordingError):
            return np.empty(0, np.int64)
    t, rest = whole[:, layout.order.t], _billionths(whole, fraction, layout.order)
    return t + rest / 1e9 if rest.any() else t


def _billionths(whole: NDArray[np.int64], fraction: NDArray[np.int64], order: Order) -> NDArray[np.int64]:
    """The billionths of the times, which may stand in a column of their own."""
    return fraction[:, order.t] if order.part is None else whole[:, order.part] * order.part_ns


def _parsed(
    path: Path, layout: _Layout
) -> Generator[tuple[NDArray[np.int64], NDArray[np.int64]], None, None]:
    """Whole parts and billionths, (N, columns) each; DamagedRecordingError at a line that is no event."""
    lines, kept, before = layout.lines, b"", layout.start
    try:
        with opened(path, layout.member) as file:
            while True:
                data = file.read(BYTES)
                text = kept + data
                text = text if data or text.endswith(b"\n") or not text else text + b"\n"
                text, before = text[before:], max(0, before - len(text))
                end = text.rfind(b"\n") + 1
                run = np.frombuffer(text, np.uint8, end)
                whole, fraction, used, seen = parse(run, layout.columns, len(run) // (2 * layout.columns) + 1)
                if len(whole):
                    yield whole, fraction
                if used < end or end == 0 < len(data) or len(text) - end > BYTES:
                    raise DamagedRecordingError(
                        f"{path}: line {lines + seen + 1} is no event of {layout.columns} numbers"
                    )
                if not data:
                    return
                lines, kept = lines + seen, text[end:]
    except FAULTS as error:
        raise DamagedRecordingError(f"{path} breaks off: {printable(str(error))}") from error


def _blocks(path: Path, layout: _Layout, unit: str) -> Iterator[Block]:
    order = layout.order
    us_per_unit = int(_columns.US_PER_UNIT[unit])  # 0 for nanoseconds: their fractions do not count
    for whole, fraction in _parsed(path, layout):
        block = _columns.block(
            whole[:, order.t], whole[:, order.x], whole[:, order.y], whole[:, order.p], unit
        )
        rest = _billionths(whole, fraction, order)
        yield block._replace(t_us=block.t_us + (rest * us_per_unit + 500_000_000) // 1_000_000_000)
