"""Event messages of ROS 1 and ROS 2, whatever bag they stand in.

Read are event_camera_msgs/EventPacket and dvs_msgs/EventArray (also under their older names). Serialisation:
ROS 1 packs all fields; ROS 2 (CDR) aligns each to its own width and ends text with a zero byte. A message of
ROS 2 may be packed with zstd.
"""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.sources.readers._canvas import Canvas
from evplace.sources.readers._ros2_files import ZSTD
from evplace.sources.readers._ros_encodings import ENCODINGS, SINCE_EPOCH, Bytes, Encoding
from evplace.sources.readers._source import Block, Hints, Source, gathered, joined, ordered, printable
from evplace.sources.readers._unpack import UnpackError, unpack

PACKETS = ("event_camera_msgs/EventPacket", "event_array_msgs/EventArray")
ARRAYS = ("dvs_msgs/EventArray", "prophesee_event_msgs/EventArray")
PACKED = np.dtype([("x", "<u2"), ("y", "<u2"), ("s", "<u4"), ("ns", "<u4"), ("p", "u1")])
"""An event of an EventArray in ROS 1."""
ALIGNED = np.dtype(
    {"names": ["x", "y", "s", "ns", "p"], "formats": ["<u2", "<u2", "<u4", "<u4", "u1"],
     "offsets": [0, 2, 6, 10, 14], "itemsize": 15}
)  # fmt: skip
"""An event of an EventArray in ROS 2 that starts two bytes off a multiple of four; the next is STEP away."""
STEP = 16
MOVED = "times of a camera's own clock are moved: the first event has the stamp of its message"
FAULTS = (struct.error, ValueError, UnpackError)
"""What decoding a damaged message raises."""
LITTLE_ENDIAN = b"\0\1"
"""How a message of plain CDR starts whose numbers stand low byte first."""


class Message(NamedTuple):
    """One message of a bag."""

    topic: str
    kind: str
    """The type without `/msg`, for example "dvs_msgs/EventArray"."""
    data: Bytes


class Fields:
    """Takes the fields of a serialised message one after the other; struct.error where it is too short."""

    def __init__(self, data: Bytes, aligned: bool) -> None:
        self.data = data
        self.position = 4 if aligned else 0
        self._aligned = aligned
        if aligned and data[:2] != LITTLE_ENDIAN:
            raise UnsupportedError(
                f"messages serialised as {bytes(data[:2]).hex()} are not read: 0001 is (CDR)"
            )

    def take(self, kind: str) -> int:
        """One number of the struct type `kind`."""
        width = struct.calcsize(kind)
        if self._aligned:
            self.position += -(self.position - 4) % width
        value: int = struct.unpack_from("<" + kind, self.data, self.position)[0]
        self.position += width
        return value

    def raw(self) -> Bytes:
        """A counted run of bytes."""
        length = self.take("I")
        start = self.position
        if start + length > len(self.data):
            raise ValueError(f"it claims {length} bytes")
        self.position += length
        return self.data[start : start + length]

    def header(self) -> int:
        """The std_msgs/Header; returns its stamp in nanoseconds."""
        if not self._aligned:
            self.take("I")
        seconds, nanoseconds = self.take("I"), self.take("I")
        self.raw()
        return seconds * 1_000_000_000 + nanoseconds


class Bag(NamedTuple):
    """A bag of any kind."""

    path: Path
    messages: Callable[[], Iterator[Message]]
    """All messages in the order of the file; DamagedRecordingError where it breaks off."""
    topics: dict[str, str]
    """Topic -> type of its messages, as an index says it; empty where the bag has none."""
    aligned: bool
    """Whether it is of ROS 2."""


def source(bag: Bag, hints: Hints) -> Source:
    """The wanted topic with events, else the first; UnsupportedError in a bag without one."""
    topics = bag.topics or _topics(bag)
    found = [topic for topic, kind in topics.items() if kind in PACKETS + ARRAYS]
    wanted = ordered(bag.path, found, hints.stream)[0] if hints.stream is not None and found else None
    first = _first(bag, wanted)
    others = [topic for topic in found if topic != first.topic]
    return _opened(bag, first, [first.topic, *others])


def _topics(bag: Bag) -> dict[str, str]:
    """The topics of all messages up to where the bag breaks off."""
    found: dict[str, str] = {}
    with contextlib.suppress(DamagedRecordingError):
        for message in bag.messages():
            found[message.topic] = message.kind
    return found


def _first(bag: Bag, wanted: str | None) -> Message:
    """The first message with events, of the wanted topic; the error says what there is instead."""
    others: set[str] = set()
    try:
        for message in bag.messages():
            if message.kind in PACKETS + ARRAYS and wanted in (None, message.topic):
                return message
            others.add(f"{message.topic} ({message.kind})")
    except DamagedRecordingError as error:
        raise RecordingError(f"{error}; no event came before") from error
    held, known = ", ".join(sorted(others)) or "no message at all", ", ".join(PACKETS + ARRAYS)
    raise UnsupportedError(f"{bag.path} holds no event messages ({known}): it holds {held}")


def _opened(bag: Bag, first: Message, streams: list[str]) -> Source:
    decode = Packets if first.kind in PACKETS else _Arrays
    probe = decode(bag.aligned)
    try:
        data = _plain(first.data, bag.aligned)
        fields = Fields(data, bag.aligned)
        fields.header()
        height, width = fields.take("I"), fields.take("I")
        probe(data)
    except FAULTS as error:
        raise RecordingError(f"{bag.path}: the first event message is damaged: {error}") from error
    size = (width, height) if 0 < width <= 1 << 16 and 0 < height <= 1 << 16 else None

    def blocks(canvas: Canvas | None = None) -> Iterator[Block]:
        return gathered(_decoded(bag, first.topic, decode(bag.aligned, canvas)))

    return Source(size, blocks, probe.notes, streams=streams, onto=blocks)


def _decoded(bag: Bag, topic: str, decode: Callable[[Bytes], Block]) -> Iterator[Block]:
    for number, message in enumerate(bag.messages()):
        if message.topic == topic:
            try:
                yield decode(_plain(message.data, bag.aligned))
            except FAULTS as error:
                raise DamagedRecordingError(f"{bag.path}: message {number} is damaged: {error}") from error


def _plain(data: Bytes, aligned: bool) -> Bytes:
    """A message as it was before it was packed; UnpackError where it is damaged."""
    return unpack(bytes(data), "zstd") if aligned and data[:4] == ZSTD else data


class Packets:
    """event_camera_msgs/EventPacket: what the camera sent, in the encoding that it used."""

    def __init__(self, aligned: bool, canvas: Canvas | None = None) -> None:
        self._aligned, self._canvas = aligned, canvas
        self._encodings: dict[str, Encoding] = {}
        self._shift_us: int | None = None
        self.notes: list[str] = []

    def __call__(self, data: Bytes) -> Block:
        fields = Fields(data, self._aligned)
        stamp_ns = fields.header()
        for kind in "IIQ":  # height, width, seq
            fields.take(kind)
        base_ns = fields.take("Q")
        name = bytes(fields.raw()).rstrip(b"\0").decode("ascii", "replace")
        fields.take("B")
        self.notes = [] if name in SINCE_EPOCH else [MOVED]
        block = self._encoding(name)(fields.raw(), base_ns, self._shift_us or 0)
        if self._shift_us is None and len(block.t_us):
            self._shift_us = 0 if name in SINCE_EPOCH else stamp_ns // 1000 - int(block.t_us[0])
            return block._replace(t_us=block.t_us + self._shift_us)
        return block

    def _encoding(self, name: str) -> Encoding:
        if name not in ENCODINGS:
            known = ", ".join(ENCODINGS)
            raise UnsupportedError(
                f"messages of the encoding '{printable(name)}' are not read: known are {known}"
            )
        if name not in self._encodings:
            self._encodings[name] = ENCODINGS[name](self._canvas)
        return self._encodings[name]


class _Arrays:
    """dvs_msgs/EventArray: one struct an event, with a time stamp of its own."""

    def __init__(self, aligned: bool, _: Canvas | None = None) -> None:
        self._aligned = aligned
        self.notes: list[str] = []

    def __call__(self, data: Bytes) -> Block:
        fields = Fields(data, self._aligned)
        fields.header()
        fields.take("I"), fields.take("I")
        count = fields.take("I")
        start = fields.position
        if not self._aligned:
            return _block(np.frombuffer(data, PACKED, count, start))
        if count and start % 4 == 0:  # only the first event can start there: it is two bytes shorter
            first = np.frombuffer(data, PACKED, 1, start)
            return joined([_block(first), _block(_aligned_events(data, count - 1, start + 14))])
        return _block(_aligned_events(data, count, start))


def _aligned_events(data: Bytes, count: int, start: int) -> NDArray[Any]:
    """`count` events of ROS 2; the last one lacks the byte that fills it up."""
    if start + count * STEP > len(data) + 1:
        raise ValueError(f"it claims {count} events")
    return np.ndarray((count,), ALIGNED, data, min(start, len(data)), (STEP,))


def _block(events: NDArray[Any]) -> Block:
    count = len(events)
    t_us, x, y = np.empty(count, np.int64), np.empty(count, np.uint16), np.empty(count, np.uint16)
    p = np.empty(count, np.bool_)
    _split(events, t_us, x, y, p)
    return Block(t_us, x, y, p)


@njit(cache=True)
def _split(
    events: NDArray[Any],
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
) -> None:
    """Fill the arrays from structs of either layout: as they lie, faster than event by event to a canvas."""
    for i in range(len(events)):
        event = events[i]
        t_us[i] = np.int64(event["s"]) * 1_000_000 + np.int64(event["ns"]) // 1000
        x[i], y[i], p[i] = event["x"], event["y"], event["p"] != 0
