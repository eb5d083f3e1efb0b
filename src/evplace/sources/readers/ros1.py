"""ROS 1 bags (format 2.0), read record by record from the start, so that a cut bag gives all before the cut.

Layout: ROS wiki, "Bags/Format/2.0". The index at the end says which topics there are; without it all messages
are looked at.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO

from evplace.core.errors import DamagedRecordingError
from evplace.sources.readers._ros import Bag, Message, source
from evplace.sources.readers._ros_encodings import Bytes
from evplace.sources.readers._source import Hints, Source, printable
from evplace.sources.readers._unpack import LIMIT, UnpackError, unpack

ABOUT = "ROS 1 bag with event messages"
MAGIC = b"#ROSBAG V2.0\n"
MESSAGE, BAG, CHUNK, CONNECTION = 0x02, 0x03, 0x05, 0x07
"""Kinds of records that matter; the others are indexes."""
FAULTS = (struct.error, ValueError, KeyError, IndexError, OverflowError, UnpackError)
"""What reading a damaged bag raises."""

_Fields = dict[bytes, bytes]
_Connections = dict[bytes, tuple[str, str]]


def matches(path: Path, head: bytes) -> bool:
    """Whether the file starts with the format's version line."""
    return head.startswith(MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The wanted topic with events, else the first; UnsupportedError where there is none."""
    return source(Bag(path, partial(messages, path), _topics(path), aligned=False), hints)


def _topics(path: Path) -> dict[str, str]:
    """Topic -> type, from the index; empty where it is missing or damaged."""
    connections: _Connections = {}
    try:
        with path.open("rb") as file:
            size = path.stat().st_size
            file.seek(len(MAGIC))
            fields, _ = _record(file, size)
            file.seek(struct.unpack("<Q", fields[b"index_pos"])[0])
            while file.tell() < size:
                fields, data = _record(file, size)
                if fields[b"op"][0] == CONNECTION:
                    list(_taken(CONNECTION, fields, data, connections))
    except (*FAULTS, OSError):  # a damaged index may point where no file reaches
        return {}
    return dict(connections.values())


def messages(path: Path) -> Iterator[Message]:
    """All messages in the order of the file; DamagedRecordingError where it breaks off."""
    connections: _Connections = {}
    try:
        with path.open("rb") as file:
            file.seek(len(MAGIC))
            index, size = 0, path.stat().st_size
            while file.tell() < size:
                fields, data = _record(file, size)
                kind = fields[b"op"][0]
                if kind == BAG:
                    index = struct.unpack("<Q", fields[b"index_pos"])[0]
                elif kind == CHUNK:
                    limit = min(LIMIT, struct.unpack("<I", fields[b"size"])[0])
                    chunk = unpack(data, fields[b"compression"].decode("ascii", "replace"), limit)
                    yield from _in_chunk(chunk, connections)
                else:
                    yield from _taken(kind, fields, data, connections)
    except FAULTS as error:
        raise DamagedRecordingError(f"{path} breaks off: {error}") from error
    if not 0 < index <= size:
        raise DamagedRecordingError(f"{path} was not closed or is cut off: its index is missing")


def _record(file: BinaryIO, size: int) -> tuple[_Fields, bytes]:
    """The header fields and the data of the record at the file's position."""
    parts = []
    for part in ("header", "data"):
        prefix = file.read(4)
        length = struct.unpack("<I", prefix)[0]
        if length > min(LIMIT, size - file.tell()):
            raise ValueError(f"a record's {part} at byte {file.tell()} claims {length} bytes")
        parts.append(file.read(length))
    return _fields(parts[0]), parts[1]


def _in_chunk(chunk: Bytes, connections: _Connections) -> Iterator[Message]:
    """The messages of an unpacked chunk."""
    position, view = 0, memoryview(chunk)
    while position < len(chunk):
        parts = []
        for _ in range(2):
            length = struct.unpack_from("<I", chunk, position)[0]
            parts.append(view[position + 4 : position + 4 + length])
            position += 4 + length
        if position > len(chunk):
            raise ValueError(f"a record inside a chunk ends {position - len(chunk)} bytes after it")
        fields = _fields(bytes(parts[0]))
        yield from _taken(fields[b"op"][0], fields, parts[1], connections)


def _taken(kind: int, fields: _Fields, data: Bytes, connections: _Connections) -> Iterator[Message]:
    """Remember a connection, give a message, pass over the rest."""
    if kind == CONNECTION:
        about = _fields(bytes(data))
        connections[fields[b"conn"]] = (
            printable(fields[b"topic"].decode("utf-8", "replace")),
            printable(about[b"type"].decode("ascii", "replace")),
        )
    elif kind == MESSAGE:
        yield Message(*connections[fields[b"conn"]], data)


def _fields(header: bytes) -> _Fields:
    """`name=value` fields, each with its length before it."""
    fields, position = {}, 0
    while position < len(header):
        length = struct.unpack_from("<I", header, position)[0]
        name, _, value = header[position + 4 : position + 4 + length].partition(b"=")
        fields[name] = value
        position += 4 + length
    return fields
