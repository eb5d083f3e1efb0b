"""ROS 2 bags in SQLite files (.db3): a folder with its metadata.yaml, or one such file, plain or packed.

Messages are taken in the order in which they were written.
"""

from __future__ import annotations

import itertools
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.sources.readers._ros import Bag, Message, source
from evplace.sources.readers._ros2_files import BagFile, bag_files, is_bag
from evplace.sources.readers._source import Hints, Source, printable
from evplace.sources.readers._unpack import LIMIT

ABOUT = "ROS 2 bag (SQLite) with event messages"
MAGIC = b"SQLite format 3\0"
STEPS, MOST_STEPS = 1_000_000, 500
"""SQLite's own steps after which it is asked whether to go on, and how often it may be for one row."""
PAGE = 1 << 16
"""Bytes of a page of which the header says 1."""
MOST_TOPICS = 10_000
"""More than any robot has."""
FAULTS = (sqlite3.Error, ValueError, TypeError, OverflowError)
"""What reading a damaged file raises."""


def matches(path: Path, head: bytes) -> bool:
    """Whether it is an SQLite file, or a folder that holds .db3 files."""
    return is_bag(path, head, ".db3", MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The wanted topic with events, else the first; UnsupportedError where there is none."""
    files = bag_files(path, ".db3")
    return source(Bag(path, partial(_messages, files), _topics(files), aligned=True), hints)


def messages(path: Path) -> Iterator[Message]:
    """All messages of a bag, in the order of its files."""
    return _messages(bag_files(path, ".db3"))


def _topics(files: list[BagFile]) -> dict[str, str]:
    """Topic -> type of all that have messages; empty where a file is damaged."""
    found: dict[str, str] = {}
    try:
        for file in files:
            with closing(_opened(file)) as base:
                known = _named(base)
                one = "SELECT 1 FROM messages WHERE topic_id = ? LIMIT 1"
                found |= dict(name for topic, name in known.items() if any(_rows(base, one, topic)))
    except FAULTS:
        return {}
    return found


def _messages(files: list[BagFile]) -> Iterator[Message]:
    for file in files:
        try:
            with closing(_opened(file)) as base:
                yield from _in_file(base)
        except FAULTS as error:
            raise DamagedRecordingError(f"{file.path} breaks off: {error}") from error


def _opened(file: BagFile) -> sqlite3.Connection:
    base = sqlite3.connect(f"{_whole_pages(file).resolve().as_uri()}?mode=ro&immutable=1", uri=True)
    base.execute("PRAGMA writable_schema = ON")  # nothing is written; else no page of a cut file is read
    base.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, LIMIT)
    tables = base.execute("SELECT name FROM sqlite_master WHERE type = 'table' AND sql NOT LIKE '%VIRTUAL%'")
    missing = {"topics", "messages"} - {name for (name,) in tables}
    if missing:
        base.close()
        raise RecordingError(
            f"{file.path} is no ROS 2 bag: it has no table {' and no table '.join(sorted(missing))}"
        )
    return base


def _whole_pages(file: BagFile) -> Path:
    """The file, or a copy without its last page where that is cut: SQLite takes zeros for the rest."""
    place = file.place()
    with place.open("rb") as opened:
        page = int.from_bytes(opened.read(18)[16:], "big")
    size = place.stat().st_size
    rest = size % (page if page > 1 else PAGE)
    return file.upto(size - rest) if rest else place


def _rows(base: sqlite3.Connection, query: str, *values: object) -> Iterator[tuple[Any, ...]]:
    """The rows that a query gives; sqlite3.Error where one takes more steps than a scan of any table does."""
    steps = itertools.count()
    base.set_progress_handler(lambda: next(steps) >= MOST_STEPS, STEPS)
    for row in base.execute(query, values):
        yield row
        steps = itertools.count()


def _named(base: sqlite3.Connection) -> dict[int, tuple[str, str]]:
    """Number -> name and type of a topic."""
    rows = list(_rows(base, f"SELECT id, name, type FROM topics LIMIT {MOST_TOPICS + 1}"))
    if len(rows) > MOST_TOPICS:
        raise ValueError(f"it has more than {MOST_TOPICS:,} topics")
    return {
        number: (printable(str(name)), printable(str(kind)).replace("/msg/", "/"))
        for number, name, kind in rows
    }


def _in_file(base: sqlite3.Connection) -> Iterator[Message]:
    topics = _named(base)
    last = None
    for row, topic, data in _rows(base, "SELECT id, topic_id, data FROM messages ORDER BY rowid"):
        if last is not None and row <= last:
            raise ValueError(f"message {row} comes after message {last}")
        last = row
        if topic not in topics or not isinstance(data, bytes):
            raise ValueError(f"message {row} is damaged")
        yield Message(*topics[topic], data)
