"""ROS 2 bags in SQLite files (.db3): a folder with its metadata.yaml, or one such file.

Messages are taken in the order in which they were written. Packed messages (zstd) are unpacked one by one.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path

from evplace.core.errors import DamagedRecordingError
from evplace.sources.readers._ros import Bag, Message, source
from evplace.sources.readers._source import Hints, Source, printable
from evplace.sources.readers._unpack import UnpackError, unpack

ABOUT = "ROS 2 bag (SQLite) with event messages"
MAGIC = b"SQLite format 3\0"
ZSTD = b"\x28\xb5\x2f\xfd"
FAULTS = (sqlite3.Error, UnpackError, ValueError, TypeError, OverflowError)
"""What reading a damaged file raises."""


def matches(path: Path, head: bytes) -> bool:
    """Whether it is an SQLite file, or a folder that holds .db3 files."""
    return head.startswith(MAGIC) or (path.is_dir() and bool(_files(path)))


def read(path: Path, hints: Hints) -> Source:
    """The wanted topic with events, else the first; UnsupportedError where there is none."""
    return source(Bag(path, partial(_messages, path), _topics(path), aligned=True), hints)


def _topics(path: Path) -> dict[str, str]:
    """Topic -> type of all that have messages; empty where a file is damaged."""
    found: dict[str, str] = {}
    try:
        for file in _files(path):
            with closing(_opened(file)) as base:
                known = _named(base)
                one = "SELECT 1 FROM messages WHERE topic_id = ? LIMIT 1"
                found |= dict(name for topic, name in known.items() if base.execute(one, (topic,)).fetchone())
    except FAULTS:
        return {}
    return found


def _files(path: Path) -> list[Path]:
    """The files of a bag in the order of the numbers that end their names."""
    files = path.glob("*.db3") if path.is_dir() else [path]
    return sorted(files, key=lambda file: (int((re.findall(r"(\d+)$", file.stem) or ["0"])[0]), file.name))


def _messages(path: Path) -> Iterator[Message]:
    for file in _files(path):
        try:
            with closing(_opened(file)) as base:
                yield from _in_file(base)
        except FAULTS as error:
            raise DamagedRecordingError(f"{file} breaks off: {error}") from error


def _opened(file: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)


def _named(base: sqlite3.Connection) -> dict[int, tuple[str, str]]:
    """Number -> name and type of a topic."""
    return {
        number: (printable(str(name)), printable(str(kind)).replace("/msg/", "/"))
        for number, name, kind in base.execute("SELECT id, name, type FROM topics")
    }


def _in_file(base: sqlite3.Connection) -> Iterator[Message]:
    topics = _named(base)
    last = None
    for row, topic, data in base.execute("SELECT id, topic_id, data FROM messages ORDER BY id"):
        if last is not None and row <= last:
            raise ValueError(f"message {row} comes after message {last}")
        last = row
        if topic not in topics or not isinstance(data, bytes):
            raise ValueError(f"message {row} is damaged")
        yield Message(*topics[topic], unpack(data, "zstd") if data.startswith(ZSTD) else data)
