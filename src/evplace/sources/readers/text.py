"""Text with one event a line, also inside .zip or .gz: `t x y p` (as in rpg's data sets), `x y p t`
or `x y t p`, told by which numbers rise and which are signs.

Numbers are separated by blanks, tabs, commas or semicolons. A first line of two numbers is the sensor's
width and height; a line of names says which column is which, and may give the unit of time (`t_us`). Lines
that start with # are passed over.
"""

from __future__ import annotations

import gzip
import re
import zipfile
import zlib
from collections.abc import Generator, Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Size
from evplace.sources.readers import _columns
from evplace.sources.readers._source import Block, Hints, Source
from evplace.sources.readers._text_numbers import parse

ABOUT = "text, one event a line (.txt, .csv, also in .zip or .gz)"
BYTES = 1 << 20
"""Bytes parsed at a time."""
HEAD = 1 << 14
"""Bytes that hold the first lines."""
ORDERS = ((0, 1, 2, 3), (3, 0, 1, 2), (2, 0, 1, 3))
"""Columns of t, x, y and p in `t x y p`, `x y p t` and `x y t p`."""
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


class _Layout(NamedTuple):
    start: int
    """First byte of the events."""
    lines: int
    """Lines before it."""
    columns: int
    order: tuple[int, int, int, int]
    """The columns of t, x, y and p."""
    time_name: str
    size: Size | None


def matches(path: Path, head: bytes) -> bool:
    """Whether its first lines, unpacked where need be, are events as text."""
    if path.is_dir() or not (head[:2] in (b"PK", b"\x1f\x8b") or _is_text(head[:HEAD])):
        return False
    try:
        with _opened(path) as file:
            return _layout(file.read(HEAD)) is not None
    except FAULTS:
        return False


def read(path: Path, hints: Hints) -> Source:
    """Columns, sensor and unit; RecordingError where the columns or the unit of time are not clear."""
    try:
        with _opened(path) as file:
            layout = _layout(file.read(HEAD))
    except FAULTS as error:
        raise RecordingError(f"{path} cannot be unpacked: {error}") from error
    if layout is None:
        raise RecordingError(
            f"{path}: the columns t, x, y and p cannot be told apart: name them in a first line"
        )
    sample = _time_sample(path, layout)
    unit, notes = _columns.time_unit(layout.time_name, sample, hints) if len(sample) else ("us", [])
    return Source(layout.size, partial(_blocks, path, layout, unit), notes)


def _is_text(head: bytes) -> bool:
    return bool(head) and re.fullmatch(rb"[\t\n\r\x20-\x7e]*", head) is not None


@contextmanager
def _opened(path: Path) -> Generator[IO[bytes], None, None]:
    """The text as a stream, from the first .txt or .csv of an archive that holds events."""
    with path.open("rb") as file:
        magic = file.read(2)
    if magic == b"\x1f\x8b":
        with gzip.open(path) as packed:
            yield packed  # type: ignore[misc]  # a GzipFile reads like any binary file
    elif magic == b"PK":
        with zipfile.ZipFile(path) as archive, archive.open(_member(archive)) as member:
            yield member
    else:
        with path.open("rb") as file:
            yield file


def _member(archive: zipfile.ZipFile) -> str:
    for name in sorted(archive.namelist(), key=lambda name: ("event" not in name, name)):
        if name.lower().endswith((".txt", ".csv")):
            with archive.open(name) as file:
                if _layout(file.read(HEAD)) is not None:
                    return name
    raise ValueError("no file in it holds events as text")


def _layout(head: bytes) -> _Layout | None:
    """Where the events start and which column is which; None where the first lines are no events."""
    names: list[str] = []
    size, position = None, 0
    for number, line in enumerate(head.splitlines(keepends=True)):
        words = re.split(r"[\s,;]+", line.decode("ascii", "replace").strip(" \t\r\n,;"))
        if (
            len(words) == 2
            and number == 0
            and all(word.isdigit() and 0 < int(word) < 1 << 16 for word in words)
        ):
            size = int(words[0]), int(words[1])
        elif _columns.named([word.lstrip("#") for word in words if word != "#"]) is not None:
            names = [word.lstrip("#").lower() for word in words if word != "#"]
        elif words != [""] and not words[0].startswith("#"):
            order = _order(names, head[position:])
            columns = len(names) or 4
            if order is None or len(words) != columns:
                return None
            time_name = names[order[0]] if names else "t"
            return _Layout(position, number, columns, order, time_name, size)
        position += len(line)
    return None


def _order(names: list[str], head: bytes) -> tuple[int, int, int, int] | None:
    """The columns of t, x, y and p: by their names, else by which of the ends has the times."""
    if names:
        named = _columns.named(names)
        assert named is not None
        return (
            names.index(named["t"]),
            names.index(named["x"]),
            names.index(named["y"]),
            names.index(named["p"]),
        )
    whole, fraction, used, _ = parse(np.frombuffer(head[: head.rfind(b"\n") + 1] or head, np.uint8), 4, 1000)
    if used == 0 or not len(whole):
        return None
    signs = np.isin(whole, (-1, 0, 1)).all(axis=0) & (fraction == 0).all(axis=0)
    for order in ORDERS:
        rising = np.diff(whole[:, order[0]]) >= 0
        if signs[order[3]] and not fraction[:, order[1:3]].any() and rising.sum() >= 0.9 * len(rising):
            return order
    return None


def _time_sample(path: Path, layout: _Layout) -> NDArray[np.float64] | NDArray[np.int64]:
    """Times of the first events, as fractions only where they are written so."""
    with closing(_parsed(path, layout)) as parts:
        try:
            whole, fraction = next(parts)
        except (StopIteration, DamagedRecordingError):
            return np.empty(0, np.int64)
    t, rest = whole[:, layout.order[0]], fraction[:, layout.order[0]]
    return t + rest / 1e9 if rest.any() else t


def _parsed(
    path: Path, layout: _Layout
) -> Generator[tuple[NDArray[np.int64], NDArray[np.int64]], None, None]:
    """Whole parts and billionths, (N, columns) each; DamagedRecordingError at a line that is no event."""
    lines, kept = layout.lines, b""
    try:
        with _opened(path) as file:
            file.read(layout.start)
            while True:
                data = file.read(BYTES)
                text = kept + data
                text = text if data or text.endswith(b"\n") or not text else text + b"\n"
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
        raise DamagedRecordingError(f"{path} breaks off: {error}") from error


def _blocks(path: Path, layout: _Layout, unit: str) -> Iterator[Block]:
    for whole, fraction in _parsed(path, layout):
        t, x, y, p = layout.order
        block = _columns.block(whole[:, t], whole[:, x], whole[:, y], whole[:, p], unit)
        us_per_unit = int(_columns.US_PER_UNIT[unit])  # 0 for nanoseconds: their fractions do not count
        yield block._replace(t_us=block.t_us + (fraction[:, t] * us_per_unit + 500_000_000) // 1_000_000_000)
