"""Drive: takes packets from a feed, localises them, and closes windows by the clock where no event comes.

The time by the sensor's clock is told from the last events: what has passed between their coming and the
last time that the source said that nothing came, less GRACE_S for what may be on its way. Events that come
later still are left out, and counted.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable

import numpy as np

from evplace.core.errors import EvplaceError
from evplace.localizer import Localizer, Match
from evplace.serving._feed import Feed, Packet
from evplace.serving._report import Report

GRACE_S = 0.15
"""Seconds that events may be late by."""
LOOK_S = 0.03
"""Seconds between two looks at the clock where nothing comes: about a window."""
RATE_S = 1.0
"""Seconds over which the rate of events is counted."""

Publish = Callable[[Report], None]


class Drive:
    """A drive that is being localised, on a thread of its own."""

    def __init__(self, where: Localizer, feed: Feed, publish: Publish) -> None:
        """Reports go to `publish`, which is called on the drive's thread and must be quick."""
        self.where, self.feed = where, feed
        self.fault: str | None = None
        """What ended the drive, where it did not end well."""
        self.ended = threading.Event()
        self._publish = publish
        self._closed = False
        self._last_us = 0
        self._clock_us: float | None = None
        self._clock_s = 0.0
        self._ticked_us: int | None = None
        self._seen: deque[tuple[float, int]] = deque()
        self._thread = threading.Thread(target=self._run, name="drive", daemon=True)

    def start(self) -> None:
        """Begin to read and to localise."""
        self.feed.start()
        self._thread.start()

    def close(self, seconds: float) -> None:
        """End within about so many seconds; what is held is not localised any more."""
        self._closed = True
        self.feed.close()
        self.feed.join(seconds / 2)
        self._thread.join(seconds / 2)

    def _run(self) -> None:
        try:
            while not self._closed:
                packet = self.feed.take(LOOK_S)
                if packet is not None:
                    self._push(packet)
                elif self.feed.ended:
                    self._tell(self.where.finish(), np.nan)
                    break
                else:
                    self._tick()
            self.fault = self.feed.fault
        except EvplaceError as error:
            self.fault = str(error)
        except Exception as error:  # whatever a part of another package may raise: the service goes on
            self.fault = f"localising failed: {type(error).__name__}: {error}"
        finally:
            self.feed.close()
            self.ended.set()

    def _push(self, packet: Packet) -> None:
        if packet.anew:
            self._tell(self.where.new_clock(), np.nan)
            self._ticked_us = None
        events = packet.events
        if self._ticked_us is not None and events.t_us[0] <= self._ticked_us:
            late = int(np.searchsorted(events.t_us, self._ticked_us, "right"))
            self.feed.skip(late)
            events = events[late:]
        self._seen.append((packet.came_s, len(packet.events)))
        if len(events):
            self._last_us = int(events.t_us[-1])
            self._clock_us, self._clock_s = float(self._last_us), packet.came_s
            self._tell(self.where.push(events), packet.came_s)

    def _tick(self) -> None:
        """Close the windows that are over by the clock."""
        now_s, pace = max(self._clock_s, self.feed.quiet_s), self.feed.pace
        if self._clock_us is None or pace <= 0:
            self._clock_s = now_s
            return
        self._clock_us += (now_s - self._clock_s) * pace * 1e6
        self._clock_s = now_s
        over_us = int(self._clock_us - GRACE_S * pace * 1e6)
        if over_us > (self._ticked_us or self._last_us):
            self._ticked_us = over_us
            self._tell(self.where.tick(over_us), np.nan)

    def _tell(self, matches: Iterable[Match], came_s: float) -> None:
        for match in matches:
            now_s = time.monotonic()
            silent_s, counters = now_s - self.feed.last_s, self.feed.counters()
            latency_s, rate = now_s - came_s, self._rate(now_s)
            self._publish(Report(match, time.time(), latency_s, rate, silent_s, counters))

    def _rate(self, now_s: float) -> float:
        """Events a second, of those that came within RATE_S."""
        while self._seen and self._seen[0][0] < now_s - RATE_S:
            self._seen.popleft()
        return sum(count for _, count in self._seen) / RATE_S
