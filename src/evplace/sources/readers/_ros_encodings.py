"""The encodings of event_camera_msgs/EventPacket: one function object each, from a packet's bytes to events.

`evt3` and `mono` mark events on a canvas where there is one; the others store all of them, and close it.

Layouts: the README of event_camera_msgs for `mono`, libcaer's polarity.h for `libcaer`, event_camera_codecs
for `libcaer_cmp`, Prophesee for `evt3`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.sources.readers._canvas import Canvas, Sink, compiled, put, sink_of
from evplace.sources.readers._source import Block
from evplace.sources.readers.evt3 import Decoder

TIME_HIGH, TIME_LOW, ADDR_X, ADDR_Y, VECT_BASE_Y, VECT_8 = range(6)
"""The kinds of words of `libcaer_cmp`."""

Bytes = bytes | bytearray | memoryview
"""Views, where a message is a part of something larger: it is not copied before it is decoded."""
Encoding = Callable[..., Block]
"""A packet's bytes, its time_base in ns and, where some are to be added to all times, microseconds -> events;
remembers what the next packet needs."""
SINCE_EPOCH = ("libcaer", "libcaer_cmp")
"""Encodings whose times count from 1970; the others count from the camera's own start."""


def evt3(canvas: Canvas | None = None) -> Encoding:
    """Prophesee's words as they came from the camera; the time_base means nothing."""
    decoder = Decoder()

    def decode(data: Bytes, base_ns: int, shift_us: int = 0) -> Block:
        decoder.shift_us = shift_us
        return decoder.decode(_words(data, "<u2"), canvas)

    return decode


def mono(canvas: Canvas | None = None) -> Encoding:
    """64 bits an event: 32 of time since time_base (ns), 16 of x, 15 of y, the polarity."""

    def decode(data: Bytes, base_ns: int, shift_us: int = 0) -> Block:
        words = _words(data, "<u8")
        sink = sink_of(canvas, len(words))
        _decode_mono(words, _ns(base_ns), shift_us, sink)
        return sink.block()

    return decode


@compiled
def _decode_mono(words: NDArray[np.uint64], base_ns: int, shift_us: int, sink: Sink) -> None:
    for unsigned in words:
        word = np.int64(unsigned & np.uint64(0x7FFFFFFFFFFFFFFF))
        t_us = (base_ns + (word & 0xFFFFFFFF)) // 1000 + shift_us
        put(sink, t_us, word >> 32 & 0xFFFF, word >> 48, unsigned >> np.uint64(63) == 1)


def stored(decode: Callable[[Bytes, int], Block], canvas: Canvas | None) -> Encoding:
    """An encoding whose events are all stored, and what follows waits for their checks."""

    def closing(data: Bytes, base_ns: int, shift_us: int = 0) -> Block:
        block = decode(data, base_ns)
        if canvas is not None:
            canvas.close()
        return block._replace(t_us=block.t_us + shift_us)

    return closing


def libcaer(canvas: Canvas | None = None) -> Encoding:
    """Two 32-bit words an event: polarity, y and x above a flag; then 31 bits of microseconds that wrap."""

    def decode(data: Bytes, base_ns: int) -> Block:
        words = _words(data, "<u4")
        pixel, low = words[: len(words) // 2 * 2 : 2], words[1::2].astype(np.int64) & 0x7FFFFFFF
        wraps = np.cumsum(np.diff(low, prepend=low[:1]) < -(1 << 30), dtype=np.int64)
        t_us = low + (wraps << 31) + _ns(base_ns) // 1000
        x, y = (pixel >> 17 & 0x7FFF).astype(np.uint16), (pixel >> 2 & 0x7FFF).astype(np.uint16)
        return Block(t_us, x, y, (pixel >> 1 & 1).astype(np.bool_))

    return stored(decode, canvas)


def libcaer_cmp(canvas: Canvas | None = None) -> Encoding:
    """16-bit words that change a state (time since time_base, column, row) and give events."""

    def decode(data: Bytes, base_ns: int) -> Block:
        words = _words(data, "<u2")
        kinds = words >> 12
        room = int(np.count_nonzero(kinds == ADDR_Y) + 8 * np.count_nonzero(kinds == VECT_8))
        t_us, x, y = np.empty(room, np.int64), np.empty(room, np.uint16), np.empty(room, np.uint16)
        p = np.empty(room, np.bool_)
        count, used = _decode_cmp(words, _ns(base_ns) // 1000, t_us, x, y, p)
        if used < len(words):
            raise ValueError(f"word {used} is of the unknown kind {kinds[used]}")
        return Block(t_us[:count], x[:count], y[:count], p[:count])

    return stored(decode, canvas)


@njit(cache=True)
def _decode_cmp(
    words: NDArray[np.uint16],
    base_us: int,
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
) -> tuple[int, int]:
    """Fill the arrays; return the events, and the words up to one of unknown kind.

    A word's kind stands in its upper 4 bits. Each packet starts with the time 0.
    """
    high, low, column, row = np.int64(0), np.int64(0), np.int64(0), np.int64(0)
    polarity, count = False, 0
    for i in range(len(words)):
        kind, value = words[i] >> 12, np.int64(words[i] & 0xFFF)
        if kind == ADDR_Y:  # one event
            t_us[count], x[count], y[count] = base_us + (high | low), column, value & 0x7FF
            p[count] = value & 0x800 != 0
            count += 1
        elif kind == ADDR_X:
            column = value & 0x7FF
        elif kind == TIME_LOW:
            low = value
        elif kind == TIME_HIGH:
            high = value << 12
        elif kind == VECT_BASE_Y:
            row, polarity = value & 0x7FF, value & 0x800 != 0
        elif kind == VECT_8:  # up to 8 neighbouring rows
            for bit in range(8):
                if value >> bit & 1:
                    t_us[count], x[count], y[count] = base_us + (high | low), column, row + bit
                    p[count] = polarity
                    count += 1
            row += 8
        else:
            return count, i
    return count, len(words)


ENCODINGS = {"evt3": evt3, "mono": mono, "libcaer": libcaer, "libcaer_cmp": libcaer_cmp}
"""By the name in the message."""


def _words(data: Bytes, kind: str) -> NDArray[np.unsignedinteger]:
    words = np.frombuffer(data, kind, len(data) // np.dtype(kind).itemsize)
    return np.require(words, requirements="A")  # as loops are compiled for


def _ns(base_ns: int) -> int:
    """A time base that fits 64 signed bits; ValueError for one that is damaged."""
    if base_ns >= 1 << 62:
        raise ValueError(f"its time base of {base_ns} ns is impossible")
    return base_ns
