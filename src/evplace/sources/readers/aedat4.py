"""AEDAT 4.0 (iniVation DV): compressed FlatBuffer packets of several streams.

A stream of events goes by the name of its camera, or by its number.

Layout: iniVation, "AEDAT 4.0 file format", and its FlatBuffer schemas IOHeader and EventPacket.
"""

from __future__ import annotations

import struct
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.core.events import Size
from evplace.sources.readers._source import Block, Hints, Source, gathered, numbered, printable
from evplace.sources.readers._unpack import LIMIT, UnpackError, unpack

ABOUT = "AEDAT 4.0 file of iniVation DV"
MAGIC = b"#!AER-DAT4.0\r\n"
COMPRESSIONS = ("none", "lz4", "lz4", "zstd", "zstd")
"""By the number in the file header; the second of each pair is the same method with more effort."""
EVENT_BYTES = 16


class _Stream(NamedTuple):
    size: Size | None
    camera: str


class _Header(NamedTuple):
    compression: str
    start: int
    """First byte of the packets."""
    end: int | None
    """First byte after the packets, where the table of all packets stands; None where there is none."""
    streams: dict[int, _Stream]


def matches(path: Path, head: bytes) -> bool:
    """Whether the file starts with the format's version line."""
    return head.startswith(MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The file header; RecordingError where it is damaged, UnsupportedError without a stream of events."""
    try:
        header = _header(path)
    except (struct.error, ValueError, LookupError, ElementTree.ParseError) as error:
        raise RecordingError(
            f"{path}: the AEDAT 4 header is damaged ({error}): no event can be read"
        ) from error
    cameras = {number: stream.camera for number, stream in header.streams.items()}
    number, streams = numbered(path, cameras, hints.stream)
    return Source(header.streams[number].size, partial(_blocks, path, header, number), streams=streams)


def _header(path: Path) -> _Header:
    with path.open("rb") as file:
        file.seek(len(MAGIC))
        length = struct.unpack("<I", file.read(4))[0]
        table = file.read(min(length, 1 << 24))
        start = file.tell()
    if len(table) < length:
        raise ValueError("the file ends inside it")
    root = struct.unpack_from("<I", table)[0]
    compression = _field(table, root, 0, "<i", 0)
    end = _field(table, root, 1, "<q", -1)
    text_offset = _field(table, root, 2, "<I", 0)
    if text_offset == 0:
        raise ValueError("no description of streams")
    text_start = _field_place(table, root, 2) + text_offset
    text = table[text_start + 4 : text_start + 4 + struct.unpack_from("<I", table, text_start)[0]]
    streams = _event_streams(path, ElementTree.fromstring(text.rstrip(b"\0")))
    if not 0 <= compression < len(COMPRESSIONS):
        raise UnsupportedError(f"{path} is packed by method {compression} of AEDAT 4, which is not read")
    return _Header(COMPRESSIONS[compression], start, end if end > 0 else None, streams)


def _event_streams(path: Path, description: ElementTree.Element) -> dict[int, _Stream]:
    """The streams of events by their numbers."""
    nodes = description.findall("./node[@name='outInfo']/node")
    kinds = [node.findtext("./attr[@key='typeIdentifier']") or "?" for node in nodes]
    if "EVTS" not in kinds:
        held = printable(", ".join(kinds)) or "nothing"
        raise UnsupportedError(
            f"{path} is an AEDAT 4 file without a stream of events (EVTS): it holds {held}"
        )
    return {
        int(node.attrib["name"]): _stream(node)
        for node, kind in zip(nodes, kinds, strict=True)
        if kind == "EVTS"
    }


def _stream(node: ElementTree.Element) -> _Stream:
    """Sensor and camera of a stream."""
    width = node.findtext("./node[@name='info']/attr[@key='sizeX']")
    height = node.findtext("./node[@name='info']/attr[@key='sizeY']")
    size = None if width is None or height is None else (int(width), int(height))
    if size is not None and not (0 < size[0] <= 1 << 15 and 0 < size[1] <= 1 << 15):
        raise ValueError(f"a sensor of {width}x{height} pixels")
    return _Stream(size, printable(node.findtext("./node[@name='info']/attr[@key='source']") or ""))


def _blocks(path: Path, header: _Header, number: int) -> Iterator[Block]:
    return gathered(_packets(path, header, number))


def _packets(path: Path, header: _Header, number: int) -> Iterator[Block]:
    end = path.stat().st_size
    if header.end is not None and header.end < end:
        end = header.end
    with path.open("rb") as file:
        file.seek(header.start)
        while (position := file.tell()) < end:
            prefix = file.read(8)
            stream, length = struct.unpack("<ii", prefix) if len(prefix) == 8 else (0, -1)
            if not 0 <= length <= end - position - 8:
                raise DamagedRecordingError(f"{path} breaks off inside the packet at byte {position}")
            if stream != number:
                file.seek(length, 1)
                continue
            try:
                yield _packet(unpack(file.read(length), header.compression))
            except (UnpackError, struct.error, ValueError) as error:
                raise DamagedRecordingError(f"{path}: the packet at byte {position}: {error}") from error
    if header.end is not None and header.end > end:
        raise DamagedRecordingError(
            f"{path} is cut off: its table of packets should stand at byte {header.end}"
        )


def _packet(data: bytes | bytearray) -> Block:
    """The events of one EventPacket; ValueError or struct.error where it is damaged."""
    root = 4 + struct.unpack_from("<I", data, 4)[0]
    offset = _field(data, root, 0, "<I", 0)
    if offset == 0:
        return Block(
            np.empty(0, np.int64), np.empty(0, np.uint16), np.empty(0, np.uint16), np.empty(0, np.bool_)
        )
    vector = _field_place(data, root, 0) + offset
    count = struct.unpack_from("<I", data, vector)[0]
    if count * EVENT_BYTES > min(len(data), LIMIT):
        raise ValueError(f"it claims {count} events")
    words = np.frombuffer(data, "<u8", 2 * count, vector + 4)
    t_us, x, y = np.empty(count, np.int64), np.empty(count, np.uint16), np.empty(count, np.uint16)
    p = np.empty(count, np.bool_)
    _split(words, t_us, x, y, p)
    return Block(t_us, x, y, p)


@njit(cache=True)
def _split(
    words: NDArray[np.uint64],
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
) -> None:
    """Fill the arrays from 16 bytes an event: 64 bits of time, 16 of x, 16 of y, 8 of polarity, 24 unused.

    A negative column or row becomes one beyond any sensor, and is dropped as such.
    """
    for i in range(len(t_us)):
        t_us[i] = np.int64(words[2 * i])
        rest = words[2 * i + 1]
        x[i], y[i] = rest & np.uint64(0xFFFF), rest >> np.uint64(16) & np.uint64(0xFFFF)
        p[i] = rest >> np.uint64(32) & np.uint64(0xFF) != 0


def _field_place(table: bytes | bytearray, root: int, number: int) -> int:
    """The byte where a FlatBuffer table keeps field `number`; 0 where it has none."""
    fields = root - struct.unpack_from("<i", table, root)[0]
    if fields < 0:
        raise ValueError("a table that starts before its packet")
    slot = 4 + 2 * number
    length = struct.unpack_from("<H", table, fields)[0]
    offset = struct.unpack_from("<H", table, fields + slot)[0] if slot < length else 0
    return root + offset if offset else 0


def _field(table: bytes | bytearray, root: int, number: int, kind: str, default: int) -> int:
    """The value of a FlatBuffer field, `default` where the table leaves it out."""
    place = _field_place(table, root, number)
    return int(struct.unpack_from(kind, table, place)[0]) if place else default
