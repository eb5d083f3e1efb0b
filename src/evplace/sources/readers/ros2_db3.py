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
from evplace.sources.readers._ros import Message, source
from evplace.sources.readers._source import Hints, Source
from evplace.sources.readers._unpack import UnpackError, unpack

ABOUT = "ROS 2 bag (SQLite) with event messages"
MAGIC = b"SQLite format 3\0"
ZSTD = b"\x28\xb5\x2f\xfd"


def matches(path: Path, head: bytes) -> bool:
    """Whether it is an SQLite file, or a folder that holds .db3 files."""
    return head.startswith(MAGIC) or (path.is_dir() and bool(_files(path)))


def read(path: Path, hints: Hints) -> Source:
    """The first topic with events; RecordingError where there is none."""
    return source(path, partial(_messages, path), aligned=True)


def _files(path: Path) -> list[Path]:
    """The files of a bag in the order of the numbers that end their names."""
    files = path.glob("*.db3") if path.is_dir() else [path]
    return sorted(files, key=lambda file: (int((re.findall(r"(\d+)$", file.stem) or ["0"])[0]), file.name))


def _messages(path: Path) -> Iterator[Message]:
    for file in _files(path):
        try:
            with closing(sqlite3.connect(f"{file.resolve().as_uri()}?mode=ro&immutable=1", uri=True)) as base:
                yield from _in_file(base)
        except (sqlite3.Error, UnpackError, ValueError, TypeError, OverflowError) as error:
            raise DamagedRecordingError(f"{file} breaks off: {error}") from error


def _in_file(base: sqlite3.Connection) -> Iterator[Message]:
    topics = {
        number: (str(name), str(kind).replace("/msg/", "/"))
        for number, name, kind in base.execute("SELECT id, name, type FROM topics")
    }
    last = None
    for row, topic, data in base.execute("SELECT id, topic_id, data FROM messages ORDER BY id"):
        if last is not None and row <= last:
            raise ValueError(f"message {row} comes after message {last}")
        last = row
        if topic not in topics or not isinstance(data, bytes):
            raise ValueError(f"message {row} is damaged")
        yield Message(*topics[topic], unpack(data, "zstd") if data.startswith(ZSTD) else data)
