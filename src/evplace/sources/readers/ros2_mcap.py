"""ROS 2 bags in MCAP files: a folder with its metadata.yaml, or one .mcap file, plain or packed with zstd.
Checksums are verified.

Layout: the MCAP specification (mcap.dev). Records are read from the start, so that a cut file gives all
before the cut; the summary at the end says which topics there are, and without it all messages are looked at.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO

import zstandard

from evplace.core.errors import DamagedRecordingError
from evplace.sources.readers._ros import Bag, Message, source
from evplace.sources.readers._ros2_files import BagFile, bag_files, is_bag
from evplace.sources.readers._ros_encodings import Bytes
from evplace.sources.readers._source import Hints, Source, printable
from evplace.sources.readers._unpack import LIMIT, UnpackError, unpack

ABOUT = "ROS 2 bag (MCAP) with event messages"
MAGIC = b"\x89MCAP0\r\n"
FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS = 0x02, 0x03, 0x04, 0x05, 0x06, 0x0B
"""Kinds of records that matter; the others are indexes and attachments."""
TAIL = struct.Struct("<BQQQI8s")
"""The end of a file: the footer with the place of the summary, and MAGIC."""
FAULTS = (struct.error, ValueError, KeyError, OverflowError, UnpackError, zstandard.ZstdError)
"""What reading a damaged file raises."""


class _Names:
    """What schemas and channels said so far."""

    def __init__(self) -> None:
        self.kinds: dict[int, str] = {}
        """Schema -> message type."""
        self.channels: dict[int, tuple[str, str]] = {}
        """Channel -> topic and message type."""


def matches(path: Path, head: bytes) -> bool:
    """Whether it is an MCAP file, or a folder that holds some."""
    return is_bag(path, head, ".mcap", MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The wanted topic with events, else the first; UnsupportedError where there is none."""
    files = bag_files(path, ".mcap")
    return source(Bag(path, partial(_messages, files), _topics(files), aligned=True), hints)


def messages(path: Path) -> Iterator[Message]:
    """All messages of a bag, in the order of its files."""
    return _messages(bag_files(path, ".mcap"))


def _topics(files: list[BagFile]) -> dict[str, str]:
    """Topic -> type of all that have messages, from the summaries; empty where one is missing or damaged."""
    found: dict[str, str] = {}
    try:
        for file in files:
            with file.path.open("rb") as opened:
                found |= _summary(opened, file.most)
    except (*FAULTS, OSError):
        return {}
    return found


def _summary(file: BinaryIO, size: int) -> dict[str, str]:
    file.seek(size - TAIL.size)
    kind, _, start, _, _, magic = TAIL.unpack(file.read(TAIL.size))
    if kind != FOOTER or magic != MAGIC or not 0 < start < size:
        raise ValueError("it has no summary")
    names, counts = _Names(), b""
    file.seek(start)
    while (kind := (head := struct.unpack("<BQ", file.read(9)))[0]) != FOOTER:
        data = file.read(min(head[1], size))
        if kind == STATISTICS:
            counts = data[46:]
        elif kind in (SCHEMA, CHANNEL):
            list(_taken(kind, data, names))
    used = {number for number, count in struct.iter_unpack("<HQ", counts[: len(counts) // 10 * 10]) if count}
    return dict(channel for number, channel in names.channels.items() if number in used)


def _messages(files: list[BagFile]) -> Iterator[Message]:
    for file in files:
        try:
            with file.stream() as opened:
                yield from _in_file(opened, file.most)
        except FAULTS as error:
            raise DamagedRecordingError(f"{file.path} breaks off: {error}") from error


def _in_file(file: BinaryIO, size: int) -> Iterator[Message]:
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError("it is no MCAP file")
    names = _Names()
    while True:
        kind, length = struct.unpack("<BQ", file.read(9))
        if length > size - file.tell():
            raise ValueError(f"a record at byte {file.tell()} claims {length} bytes")
        if kind == FOOTER:
            return
        if kind not in (SCHEMA, CHANNEL, MESSAGE, CHUNK):
            _pass_over(file, length)
            continue
        if length > LIMIT:
            raise ValueError(f"a record at byte {file.tell()} claims {length} bytes")
        data = file.read(length)
        yield from _in_chunk(data, names) if kind == CHUNK else _taken(kind, data, names)


def _pass_over(file: BinaryIO, length: int) -> None:
    """As `seek`, which what is being unpacked cannot."""
    while length > 0 and (part := file.read(min(length, 1 << 20))):
        length -= len(part)


def _in_chunk(data: bytes, names: _Names) -> Iterator[Message]:
    """The messages of a chunk, once it is unpacked and its checksum is right."""
    _, _, size, checksum = struct.unpack_from("<QQQI", data)
    method, position = _text(data, 28)
    length = struct.unpack_from("<Q", data, position)[0]
    records = unpack(data[position + 8 : position + 8 + length], method or "none", min(size, LIMIT))
    if len(records) != size or (checksum and zlib.crc32(records) != checksum):
        raise ValueError("the checksum of a chunk is wrong")
    position, view = 0, memoryview(records)
    while position < len(records):
        kind, length = struct.unpack_from("<BQ", records, position)
        yield from _taken(kind, view[position + 9 : position + 9 + length], names)
        position += 9 + length


def _taken(kind: int, data: Bytes, names: _Names) -> Iterator[Message]:
    """Remember a schema or a channel, give a message."""
    if kind == SCHEMA:
        names.kinds[struct.unpack_from("<H", data)[0]] = _text(data, 2)[0].replace("/msg/", "/")
    elif kind == CHANNEL:
        number, schema = struct.unpack_from("<HH", data)
        topic, position = _text(data, 4)
        coding, _ = _text(data, position)
        kind_name = names.kinds.get(schema, "unknown")
        names.channels[number] = topic, kind_name if coding == "cdr" else f"{kind_name} as {coding}"
    elif kind == MESSAGE:
        yield Message(*names.channels[struct.unpack_from("<H", data)[0]], data[22:])


def _text(data: Bytes, position: int) -> tuple[str, int]:
    """A counted text and the byte after it."""
    length = struct.unpack_from("<I", data, position)[0]
    text = bytes(data[position + 4 : position + 4 + length]).decode("utf-8", "replace")
    return printable(text), position + 4 + length
