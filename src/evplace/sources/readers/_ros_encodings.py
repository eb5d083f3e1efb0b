"""The encodings of event_camera_msgs/EventPacket: one function object each, from a packet's bytes to events.

Layouts: the README of event_camera_msgs for `mono`, libcaer's polarity.h for `libcaer`, Prophesee for `evt3`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from evplace.sources.readers._source import Block
from evplace.sources.readers.evt3 import Decoder

Encoding = Callable[[bytes | memoryview, int], Block]
"""A packet's bytes and its time_base in ns -> events; remembers what the next packet needs."""
SINCE_EPOCH = ("libcaer",)
"""Encodings whose times count from 1970; the others count from the camera's own start."""


def evt3() -> Encoding:
    """Prophesee's words as they came from the camera; the time_base means nothing."""
    decoder = Decoder()
    return lambda data, _: decoder.decode(_words(data, "<u2"))


def mono() -> Encoding:
    """64 bits an event: 32 of time since time_base (ns), 16 of x, 15 of y, the polarity."""

    def decode(data: bytes | memoryview, base_ns: int) -> Block:
        words = _words(data, "<u8")
        t_ns = (words & np.uint64(0xFFFFFFFF)).astype(np.int64) + _ns(base_ns)
        x, y = words >> np.uint64(32) & np.uint64(0xFFFF), words >> np.uint64(48) & np.uint64(0x7FFF)
        return Block(t_ns // 1000, x.astype(np.uint16), y.astype(np.uint16), words >> np.uint64(63) == 1)

    return decode


def libcaer() -> Encoding:
    """Two 32-bit words an event: polarity, y and x above a flag; then 31 bits of microseconds that wrap."""

    def decode(data: bytes | memoryview, base_ns: int) -> Block:
        words = _words(data, "<u4")
        pixel, low = words[: len(words) // 2 * 2 : 2], words[1::2].astype(np.int64) & 0x7FFFFFFF
        wraps = np.cumsum(np.diff(low, prepend=low[:1]) < -(1 << 30), dtype=np.int64)
        t_us = low + (wraps << 31) + _ns(base_ns) // 1000
        x, y = (pixel >> 17 & 0x7FFF).astype(np.uint16), (pixel >> 2 & 0x7FFF).astype(np.uint16)
        return Block(t_us, x, y, (pixel >> 1 & 1).astype(np.bool_))

    return decode


ENCODINGS = {"evt3": evt3, "mono": mono, "libcaer": libcaer}
"""By the name in the message."""


def _words(data: bytes | memoryview, kind: str) -> NDArray[np.unsignedinteger]:
    return np.frombuffer(data, kind, len(data) // np.dtype(kind).itemsize)


def _ns(base_ns: int) -> int:
    """A time base that fits 64 signed bits; ValueError for one that is damaged."""
    if base_ns >= 1 << 62:
        raise ValueError(f"its time base of {base_ns} ns is impossible")
    return base_ns
