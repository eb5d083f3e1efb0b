"""AEDAT 3.0 and 3.1 (cAER): packets of one kind of events each; those of change events are read.

A camera is a source; it goes by its name in the header, or by its number.
Layout: iniVation, "AEDAT 3.1 file format". A time is 31 bits of microseconds, with the number of times that
they wrapped in the packet's header.
"""

from __future__ import annotations

import contextlib
import itertools
import re
import struct
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.sources.readers._source import Block, Hints, Source, gathered, numbered
from evplace.sources.readers._unpack import LIMIT
from evplace.sources.readers.aedat2 import CAMERAS

ABOUT = "AEDAT 3.0 or 3.1 file of cAER"
MAGIC = re.compile(rb"#!AER-DAT3\.[01]\r\n")
END = b"#!END-HEADER\r\n"
POLARITY = 1
"""The number of the kind of packets that holds change events."""
PACKET = struct.Struct("<hhiiiiii")
"""Kind, source, bytes an event, place of the time in it, wraps, room for events, events, valid events."""


def matches(path: Path, head: bytes) -> bool:
    """Whether the file starts with the format's version line."""
    return MAGIC.match(head) is not None


def read(path: Path, hints: Hints) -> Source:
    """The header; RecordingError where it does not end, UnsupportedError where the packets are packed."""
    with path.open("rb") as file:
        head = file.read(1 << 20)
    end = head.find(END)
    if end < 0:
        raise RecordingError(f"{path}: the AEDAT 3 header does not end: no event can be read")
    coding = re.search(rb"#Format: (\S+)", head[:end])
    if coding is not None and coding.group(1) != b"RAW":
        found = coding.group(1).decode("ascii", "replace")
        raise UnsupportedError(f"{path} is packed as {found}: AEDAT 3 can be read as RAW only")
    start = end + len(END)
    known = {int(n): name.decode("ascii") for n, name in re.findall(rb"#Source (\d{1,4}): (\w+)", head[:end])}
    number, streams = numbered(
        path, {n: known.get(n, "") for n in _senders(path, start, known)}, hints.stream
    )
    camera = known.get(number, next(iter(known.values()), "")).upper()
    size = next((CAMERAS[name] for name in CAMERAS if camera.startswith(name)), None)
    return Source(size, partial(_blocks, path, start, number), streams=streams)


def _senders(path: Path, start: int, known: dict[int, str]) -> list[int]:
    """The numbers of the sources that send change events; where none does, those of the header.

    Where the header names one only, it is the first that sends.
    """
    found: dict[int, None] = {}
    with path.open("rb") as file, contextlib.suppress(DamagedRecordingError):
        for packet in itertools.islice(_packets(path, file, start), 1 if len(known) == 1 else None):
            found[packet.source] = None
    return list(found or known or (0,))


def _blocks(path: Path, start: int, number: int) -> Iterator[Block]:
    return gathered(_of_source(path, start, number))


def _of_source(path: Path, start: int, number: int) -> Iterator[Block]:
    with path.open("rb") as file:
        for packet in _packets(path, file, start):
            if packet.source == number:
                yield _block(file.read(packet.length), packet.events, packet.wraps)


class _Packet(NamedTuple):
    source: int
    length: int
    """Bytes of its events, at which the file stands."""
    events: int
    wraps: int


def _packets(path: Path, file: BinaryIO, start: int) -> Iterator[_Packet]:
    """The packets of change events; DamagedRecordingError where the file breaks off."""
    position, size = start, path.stat().st_size
    while position < size:
        file.seek(position)
        head = file.read(PACKET.size)
        if len(head) < PACKET.size:
            raise DamagedRecordingError(f"{path} is cut off inside the packet at byte {position}")
        kind, source, width, time_at, wraps, room, count, _ = PACKET.unpack(head)
        length = width * room
        if width < 1 or room < 0 or not 0 <= count <= room or length > min(LIMIT, size - file.tell()):
            raise DamagedRecordingError(f"{path} breaks off inside the packet at byte {position}")
        if kind == POLARITY:
            if width != 8 or time_at != 4 or wraps < 0:
                raise DamagedRecordingError(f"{path}: the packet at byte {position} is no packet of events")
            yield _Packet(source, length, count, wraps)
        position += PACKET.size + length


def _block(data: bytes, count: int, wraps: int) -> Block:
    """The valid ones of `count` events: x, y, polarity and validity in one word, the time in the next."""
    words = np.frombuffer(data, "<u4", 2 * count)
    t_us, x, y = np.empty(count, np.int64), np.empty(count, np.uint16), np.empty(count, np.uint16)
    p = np.empty(count, np.bool_)
    valid = _split(words, wraps << 31, t_us, x, y, p)
    return Block(t_us[:valid], x[:valid], y[:valid], p[:valid])


@njit(cache=True)
def _split(
    words: NDArray[np.uint32],
    start_us: int,
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
) -> int:
    """Fill the arrays with the valid events; return how many they are."""
    count = 0
    for i in range(0, len(words), 2):
        pixel = words[i]
        t_us[count] = start_us + np.int64(words[i + 1])
        x[count], y[count], p[count] = pixel >> 17, pixel >> 2 & 0x7FFF, pixel >> 1 & 1 == 1
        count += pixel & 1
    return count
