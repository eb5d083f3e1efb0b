"""Hub: hands reports from the drive's thread to everybody who listens, on the event loop.

Whoever is slow loses the oldest of what waits for them, and holds up nobody else.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.serving._report import Describer, Report

WAITING = 64
"""Messages that wait for one listener at most: two seconds of matches."""
REMEMBERED = 900
"""Matches that a page gets that is opened now: half a minute."""


class Picture(NamedTuple):
    """An event image on its way to the page."""

    t_us: int
    grey: NDArray[np.uint8]


class Listener:
    """Messages for one who listens, the oldest of which go first where too many wait."""

    def __init__(self) -> None:
        self.lost = 0
        self._waiting: deque[str] = deque()
        self._some = asyncio.Event()

    def put(self, message: str) -> None:
        """One more message."""
        if len(self._waiting) >= WAITING:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append(message)
        self._some.set()

    async def get(self) -> str:
        """The next message, once there is one."""
        while not self._waiting:
            self._some.clear()
            await self._some.wait()
        return self._waiting.popleft()


class Hub:
    """Everybody who listens to one drive. All but `publish` is for the event loop's thread."""

    def __init__(self, describe: Describer, loop: asyncio.AbstractEventLoop) -> None:
        self.latest: dict[str, Any] | None = None
        """The last report, as JSON has it."""
        self.recent: deque[list[Any]] = deque(maxlen=REMEMBERED)
        """Time, state, probability, easting and northing of the last reports."""
        self.picture: Picture | None = None
        self.pictured = asyncio.Event()
        """Set, and replaced, with each new picture."""
        self.matches: dict[str, int] = {}
        """State -> matches so far."""
        self.latencies_s: deque[float] = deque(maxlen=4096)
        self._describe, self._loop = describe, loop
        self._listeners: set[Listener] = set()
        self._coming: deque[tuple[Report, NDArray[np.uint8] | None]] = deque(maxlen=4 * WAITING)
        self._called = False

    def publish(self, report: Report, image: NDArray[np.uint8] | None) -> None:
        """Take a report from another thread."""
        self._coming.append((report, image))
        if not self._called:
            self._called = True
            self._loop.call_soon_threadsafe(self._deliver)

    def listen(self) -> Listener:
        """A new listener; `leave` takes it away."""
        listener = Listener()
        self._listeners.add(listener)
        return listener

    def leave(self, listener: Listener) -> None:
        """Forget a listener."""
        self._listeners.discard(listener)

    @property
    def listeners(self) -> int:
        """How many listen."""
        return len(self._listeners)

    def _deliver(self) -> None:
        self._called = False
        while self._coming:
            self._one(*self._coming.popleft())

    def _one(self, report: Report, image: NDArray[np.uint8] | None) -> None:
        match = report.match
        self.latest = self._describe.values(report)
        line = self._describe.text(self.latest)
        self.matches[match.state] = self.matches.get(match.state, 0) + 1
        if report.latency_s == report.latency_s:
            self.latencies_s.append(report.latency_s)
        self.recent.append(
            [self.latest[name] for name in ("t_us", "state", "probability", "easting", "northing", "item")]
        )
        for listener in self._listeners:
            listener.put(line)
        if image is not None and match.state != "no-events":
            self.picture = Picture(match.t_us, grey(image))
            self.pictured.set()
            self.pictured = asyncio.Event()


def grey(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(h, w) of an image with or without channels."""
    return image if image.ndim == 2 else image.max(axis=-1)
