"""Decoders of a stream of bytes that come as they come: in parts of any length."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import RecordingError
from evplace.core.events import Size
from evplace.sources.readers import Block, evt2, evt3
from evplace.sources.readers._prophesee import evt_version, header, start_us, stated_size

PACKED = np.dtype([("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("p", "u1")])
"""An event of 13 bytes, as faery's arrays hold it and its UDP packets send it."""
HEADER = 1 << 16
"""Bytes within which a text header ends."""
NUMBERS = re.compile(rb"[ \t]*\d{1,18}[ \t,;]+\d{1,9}[ \t,;]+\d{1,9}[ \t,;]+-?\d[ \t]*\r?")
LINE = 1 << 10
"""Bytes of the longest line that may be an event."""
FORMATS = ("evt3", "evt2", "packed", "text")

Decode = Callable[[bytes], Block]
"""The events in whole words or lines."""


class ByteStream:
    """Bytes of any of FORMATS in, events out; a format with a header needs no name."""

    def __init__(self, format: str | None = None) -> None:
        self.size: Size | None = None
        self.lost = 0
        """Lines of text that were no event."""
        self._format = format
        self._held = b""
        self._decode: Decode | None = None
        self._word = 1

    def push(self, data: bytes) -> Iterator[Block]:
        """The events that `data` completes; RecordingError where it is of no known format."""
        self._held += data
        if self._decode is None and not self._begin():
            return
        assert self._decode is not None
        whole = self._whole()
        if whole:
            ready, self._held = self._held[:whole], self._held[whole:]
            yield self._decode(ready)
        if not self._word:  # what is longer is no event: its end is waited for, but not held
            self._held = self._held[:LINE]

    def _begin(self) -> bool:
        """Whether the format is known by now; the header is taken off."""
        if self._format in ("packed", "text"):
            self._start(self._format, 0)
            return True
        found = header(self._held)
        ended = len(self._held) > found.length and not self._held[found.length :].startswith(b"%")
        if self._held.startswith(b"%") and not ended and len(self._held) < HEADER:
            return False
        version = evt_version(found.fields)
        if found.length and version in ("2", "2.0", "3", "3.0"):
            self.size = stated_size(found.fields)
            self._start(f"evt{version[0]}", found.length, start_us(found.fields))
        elif self._format is not None:
            self._start(self._format, 0)
        elif b"\n" in self._held and any(map(NUMBERS.fullmatch, self._held.split(b"\n")[:3])):
            self._start("text", 0)
        elif len(self._held) >= 1 << 10:
            raise RecordingError(
                f"the stream is of no format that tells itself: it starts with {self._held[:12]!r}; give the "
                f"setting 'format' ({', '.join(FORMATS)})"
            )
        return self._decode is not None

    def _start(self, format: str, skipped: int, shift_us: int = 0) -> None:
        self._held = self._held[skipped:]
        self._word = {"evt3": 2, "evt2": 4, "packed": PACKED.itemsize, "text": 0}[format]
        if format == "evt3":
            self._decode = _evt3(shift_us)
        elif format == "evt2":
            self._decode = _evt2(shift_us)
        else:
            self._decode = packed if format == "packed" else self._lines

    def _whole(self) -> int:
        """How many of the held bytes are whole words or lines."""
        if self._word:
            return len(self._held) // self._word * self._word
        return self._held.rfind(b"\n") + 1

    def _lines(self, data: bytes) -> Block:
        """Lines of `t x y p`, times in whole microseconds; others are counted and left out."""
        lines = [line for line in data.split(b"\n") if line.strip() and not line.startswith(b"#")]
        good = [line for line in lines if NUMBERS.fullmatch(line)]
        self.lost += len(lines) - len(good)
        columns = np.array([re.split(rb"[ \t,;]+", line.strip()) for line in good], "S20")
        table = columns.reshape(-1, 4).astype(np.int64)
        return as_block(table[:, 0], table[:, 1], table[:, 2], table[:, 3] > 0)


def packed(data: bytes) -> Block:
    """Events of 13 bytes."""
    found = np.frombuffer(data, PACKED)
    return as_block(found["t"], found["x"], found["y"], found["p"] != 0)


def as_block(t_us: NDArray[np.integer], x: NDArray[np.integer], y: NDArray[np.integer], p: object) -> Block:
    """Four columns of any types as a block; a time beyond 63 bits becomes the largest within."""
    times = np.minimum(t_us, np.iinfo(np.int64).max // 2).astype(np.int64)
    return Block(times, _pixels(x), _pixels(y), np.ascontiguousarray(p, np.bool_))


def _pixels(values: NDArray[np.integer]) -> NDArray[np.uint16]:
    """Coordinates; what no sensor has lies outside of every one."""
    return np.ascontiguousarray(np.minimum(values, 0xFFFF), np.uint16)


def _evt3(shift_us: int) -> Decode:
    decoder = evt3.Decoder(shift_us)
    return lambda data: decoder.decode(np.frombuffer(data, "<u2"))


def _evt2(shift_us: int) -> Decode:
    decode = evt2.decoder(shift_us)
    return lambda data: decode(np.frombuffer(data, "<u4"))
