"""Feed: takes events from a live source on a thread of its own, and holds them until they are taken.

What it holds is bounded: where the localizer is slower than the source, the oldest events go first, and are
counted. Sources that wait by themselves, such as files, lose nothing.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass, field
from typing import NamedTuple

from evplace.core.errors import EvplaceError, RecordingError
from evplace.core.events import Events, Size
from evplace.serving._clock import Sieve
from evplace.serving._recorder import Recorder
from evplace.sources.live import Facts, Live
from evplace.sources.readers import Block

HOLD = 6_000_000
"""Events that are held at most: 78 MB, 0.3 s at 20 million a second."""
PACKETS = 4096
"""Packets that are held at most, whatever is in them."""
PACKET = 100_000
"""Events of a packet at most, so that no one packet holds up all else."""


class Packet(NamedTuple):
    """Events on their way to the localizer."""

    events: Events
    came_s: float
    """When they came, by the host's monotonic clock."""
    anew: bool = False
    """Whether the sensor's times begin anew with them."""


@dataclass
class Counters:
    """What happened to the events, in numbers that only grow, but for the backlog."""

    events: int = 0
    """Good events that came."""
    backlog: int = 0
    """Events that wait to be localised."""
    skipped: int = 0
    """Events that were dropped, the oldest first, because too many waited."""
    overflows: int = 0
    """How often that happened, and how often the source itself has lost something."""
    recorded: int = 0
    """Events that were written to the file of `record`."""
    rejected: dict[str, int] = field(default_factory=dict)
    """Reason -> events left out because they cannot be."""


class Feed:
    """A source that is being read. `take` gives its packets one after another."""

    def __init__(self, source: Live, size: Size, recorder: Recorder | None = None, hold: int = HOLD) -> None:
        """For a sensor of `size`; at most `hold` events are held, and all that come go to the `recorder`."""
        self.source = source
        self.size = size
        """(width, height) of the sensor in pixels."""
        self.fault: str | None = None
        """What ended the source, where it did not end well."""
        self.ended = False
        """Whether nothing more comes, though some may still be held."""
        self.last_s = time.monotonic()
        """When the last events came."""
        self.quiet_s = self.last_s
        """Until when the source has said that nothing came: a busy machine is not a silent camera."""
        self._sieve, self._recorder, self._hold = Sieve(size), recorder, hold
        self._counters = Counters()
        self._waits = Facts.of(source).waits
        self._packets: deque[Packet] = deque()
        self._change = threading.Condition()
        self._closed = False
        self._anew = False
        self._thread = threading.Thread(target=self._run, name="source", daemon=True)

    @property
    def pace(self) -> float:
        """Seconds of the sensor's time in one second; 0 where the clock says nothing of the events."""
        return float(Facts.of(self.source).pace)

    def counters(self) -> Counters:
        """The counts by now."""
        counted = self._counters
        recorded = 0 if self._recorder is None else self._recorder.events
        lost = Facts.of(self.source).lost
        return Counters(
            counted.events, counted.backlog, counted.skipped, counted.overflows + lost, recorded,
            {reason: count for reason, count in self._sieve.dropped.items() if count},
        )  # fmt: skip

    def start(self) -> None:
        """Begin to read."""
        self._thread.start()

    def close(self) -> None:
        """End the reading; what is held can still be taken."""
        self._closed = True
        self.source.close()
        with self._change:
            self._change.notify_all()

    def join(self, seconds: float) -> None:
        """Wait until the reading has ended, but no longer."""
        self._thread.join(seconds)

    def skip(self, events: int) -> None:
        """Count events that came too late to be localised."""
        self._counters.skipped += events

    def take(self, seconds: float) -> Packet | None:
        """The next packet; None where none comes within so many seconds, or no more will come."""
        with self._change:
            if not self._packets and not self.ended:
                self._change.wait(seconds)
            if not self._packets:
                return None
            packet = self._packets.popleft()
            self._counters.backlog -= len(packet.events)
            self._change.notify_all()
            return packet

    def _run(self) -> None:
        try:
            for item in self.source.blocks():
                if self._closed:
                    break
                self._push(item)
        except EvplaceError as error:
            self.fault = str(error)
        except Exception as error:  # a source of another package may raise anything: the service goes on
            self.fault = f"the source failed: {type(error).__name__}: {error}"
        self._put(self._sieve.flush().blocks)
        with self._change:
            self.ended = True
            self._change.notify_all()

    def _push(self, item: object) -> None:
        if item is None:
            self.quiet_s = time.monotonic()
            self._put(self._sieve.flush().blocks)
        elif isinstance(item, Block):
            self.last_s = time.monotonic()
            check_size(self.size, getattr(self.source, "size", None))
            found = self._sieve.push(item, self.last_s, self.pace)
            self._anew = self._anew or found.anew
            self._put(found.blocks)
        else:
            self._put(self._sieve.flush().blocks)
            self._sieve.anew()
            self._anew = True

    def _put(self, blocks: list[Block]) -> None:
        """Record and hold events, in packets."""
        for block in blocks:
            events = Events(block.t_us, block.x, block.y, block.p, self._sieve.size)
            self._counters.events += len(events)
            if self._recorder is not None:
                self._recorder.take(events, self._anew)
            for start in range(0, len(events), PACKET):
                self._append(Packet(events[start : start + PACKET], time.monotonic(), self._anew))
                self._anew = False

    def _append(self, packet: Packet) -> None:
        counted = self._counters
        with self._change:
            while self._waits and self._is_full(packet) and not self._closed:
                self._change.wait(0.1)
            if self._is_full(packet):
                counted.overflows += 1
            while self._packets and self._is_full(packet):
                oldest = self._packets.popleft()
                counted.backlog -= len(oldest.events)
                counted.skipped += len(oldest.events)
                packet = packet._replace(anew=packet.anew or (oldest.anew and not self._packets))
                if oldest.anew and self._packets:
                    self._packets[0] = self._packets[0]._replace(anew=True)
            self._packets.append(packet)
            counted.backlog += len(packet.events)
            self._change.notify_all()

    def _is_full(self, packet: Packet) -> bool:
        return bool(self._packets) and (
            self._counters.backlog + len(packet.events) > self._hold or len(self._packets) >= PACKETS
        )


def check_size(wanted: Size | None, given: Size | None) -> None:
    """RecordingError where a map and a source have two sensors; a stream may say its own only as it comes."""
    if wanted is not None and given is not None and tuple(wanted) != tuple(given):
        raise RecordingError(
            f"the map was made with a sensor of {wanted[0]}x{wanted[1]} pixels, this source has "
            f"{given[0]}x{given[1]}: give the map's own sensor, or train a map with this one"
        )
