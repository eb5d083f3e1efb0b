"""UDP packets of events: those of faery, and those of EventCV, AEStream and SPIF."""

from __future__ import annotations

import re
import socket
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import RecordingError, SettingsError
from evplace.core.events import Size
from evplace.sources.live import WAIT_S, Item, Live
from evplace.sources.live._bytes import PACKED, as_block, packed
from evplace.sources.readers import Block
from evplace.sources.readers._clock import clock, unwrap_32
from evplace.sources.readers._source import joined

DATAGRAM = 1 << 16
GATHER_S = 0.005
"""Packets that come within so many seconds are handed on together."""
MOST = 512
"""Packets that are handed on together at most."""
BUFFER = 1 << 23
"""Bytes that the system is asked to hold for us."""
UNTIMED = np.uint32(1 << 31)
"""Marks a word of SPIF that no time follows."""


@dataclass(frozen=True)
class UDP:
    """Events over a network, for a sensor whose size the map says."""

    where: str = ""
    """Address and port to listen at: 0.0.0.0:3333, or 3333 for this machine alone."""
    layout: str = "faery"
    """faery (13 bytes an event), faery-32 (8 bytes), spif (EventCV, AEStream: 4 bytes, or 8 with times) or
    spif-be (the same, high byte first)."""

    def __post_init__(self) -> None:
        if self.layout not in LAYOUTS:
            raise SettingsError(
                f"the setting 'layout' cannot be '{self.layout}': known are {', '.join(LAYOUTS)}"
            )

    def open(self, size: Size | None) -> Live:
        """Listen; RecordingError where that cannot be."""
        host, port = host_and_port(self.where, "127.0.0.1")
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        listening = socket.socket(family, socket.SOCK_DGRAM)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER)
        try:
            listening.bind((host, port))
        except OSError as error:
            listening.close()
            raise RecordingError(f"cannot listen at UDP {host}:{port}: {error.strerror or error}") from error
        return Listening(listening, LAYOUTS[self.layout](), size)


class Listening:
    """A socket that is being listened to."""

    pace = 1.0
    waits = False

    def __init__(self, listening: socket.socket, layout: Layout, size: Size | None) -> None:
        self.size = size
        self.lost = 0
        self.notes: list[str] = []
        self.port: int = listening.getsockname()[1]
        """Where it listens."""
        self._socket, self._layout = listening, layout
        self._closed = threading.Event()
        self._begun = False

    def close(self) -> None:
        """End the listening."""
        self._closed.set()
        if not self._begun:
            self._socket.close()

    def blocks(self) -> Iterator[Item]:
        """The events of the packets; a packet that is none is counted as lost."""
        self._begun = True
        with self._socket:
            while not self._closed.is_set():
                parts = list(self._packets())
                yield self._layout.decode(parts) if parts else None

    def _packets(self) -> Iterator[bytes]:
        """The packets that are there, the first of which is waited for."""
        until_s = time.monotonic() + WAIT_S
        for _ in range(MOST):
            self._socket.settimeout(max(0.0, until_s - time.monotonic()))
            try:
                data = self._socket.recv(DATAGRAM)
            except (TimeoutError, BlockingIOError):
                return
            except OSError:  # on some systems a sender's failure reaches the receiver
                continue
            if data and len(data) % self._layout.width(data) == 0:
                until_s = min(until_s, time.monotonic() + GATHER_S)
                yield data
            else:
                self.lost += 1


class Layout(Protocol):
    """What the packets hold."""

    def width(self, data: bytes) -> int:
        """Bytes that an event takes in this packet."""

    def decode(self, parts: list[bytes]) -> Block:
        """The events of whole packets."""


class Faery:
    """13 bytes an event: 64 bits of microseconds, x, y, polarity."""

    def width(self, data: bytes) -> int:
        """Always the same."""
        return PACKED.itemsize

    def decode(self, parts: list[bytes]) -> Block:
        """The events, with their own times."""
        return packed(b"".join(parts))


class Faery32:
    """8 bytes an event: 32 bits of microseconds, x, and y above the polarity."""

    def __init__(self) -> None:
        self._times = _Times()

    def width(self, data: bytes) -> int:
        """Always the same."""
        return 8

    def decode(self, parts: list[bytes]) -> Block:
        """The events, with times that do not wrap."""
        found = np.frombuffer(b"".join(parts), [("t", "<u4"), ("x", "<u2"), ("y", "<u2")])
        t_us = self._times.unwrapped(found["t"])
        return as_block(t_us, found["x"], found["y"] >> 1, found["y"] & 1 == 1)


class Spif:
    """A word an event: whether no time follows, 15 bits of x, polarity, 15 bits of y; then its time, or none.

    Events without a time get that of their packet's arrival.
    """

    def __init__(self, order: str = "<") -> None:
        self._word = np.dtype(f"{order}u4")
        self._times = _Times()

    def width(self, data: bytes) -> int:
        """4, or 8 where times follow; a packet's first word tells."""
        return 8 if len(data) >= 4 and not np.frombuffer(data, self._word, 1)[0] & UNTIMED else 4

    def decode(self, parts: list[bytes]) -> Block:
        """The events of each packet."""
        return joined([self._packet(part) for part in parts])

    def _packet(self, data: bytes) -> Block:
        words = np.frombuffer(data, self._word).astype(np.uint32)
        if self.width(data) == 8:
            t_us, words = self._times.unwrapped(words[1::2]), words[::2]
        else:
            t_us = np.full(len(words), time.monotonic_ns() // 1000, np.int64)
        return as_block(t_us, words >> 16 & 0x7FFF, words & 0x7FFF, words >> 15 & 1 == 1)


class _Times:
    """Times of 32 bits that wrap every 71.6 min."""

    def __init__(self) -> None:
        self._state: NDArray[np.int64] | None = None

    def unwrapped(self, t_us: NDArray[Any]) -> NDArray[np.int64]:
        if self._state is None:
            self._state = clock(int(t_us[0]))
        times: NDArray[np.int64] = unwrap_32(self._state, np.ascontiguousarray(t_us, np.uint32))
        return times


LAYOUTS: dict[str, Callable[[], Layout]] = {
    "faery": Faery,
    "faery-32": Faery32,
    "spif": Spif,
    "spif-be": lambda: Spif(">"),
}


def host_and_port(where: str, host: str) -> tuple[str, int]:
    """`HOST:PORT`, or a port alone, for which `host` is taken; RecordingError where it is neither."""
    found = re.fullmatch(r"(?:(?:\[(.+)\]|(.*)):)?(\d{1,5})", where)
    if found is None or not 0 <= int(found[3]) < 1 << 16:
        raise RecordingError(f"'{where}' is no address: give host and port, as in {host}:3333")
    return found[1] or found[2] or host, int(found[3])
