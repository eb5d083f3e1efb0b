"""A recording at the sensor's own pace, faster or slower, once or over and over; also as fast as it goes."""

from __future__ import annotations

import itertools
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from evplace.core.errors import DamagedRecordingError, SettingsError
from evplace.core.events import Events, Size
from evplace.sources.live import ANEW, WAIT_S, Item, Live
from evplace.sources.readers import Block, Recording, open_recording

SLICE_US = 10_000
"""Microseconds of the sensor's time that are handed on at a time: a camera's packets are about so long."""
FASTEST = 1000.0


@dataclass(frozen=True)
class Replay:
    """A recording as if it were a camera."""

    where: str = ""
    """The recording's path."""
    speed: float = 1.0
    """How many times as fast as it was recorded; 0 as fast as it goes, without losing any event."""
    loops: int = 1
    """How often it is played; 0 for ever."""
    time_unit: str | None = None
    """Unit of the times, where the file does not say: s, ms, us or ns."""
    stream: str | None = None
    """Which camera, where the file holds several."""
    columns: str | None = None
    """What the columns of a table are: t,x,y,p in their order."""

    def __post_init__(self) -> None:
        if not 0 <= self.speed <= FASTEST:
            raise SettingsError(f"the setting 'speed' cannot be {self.speed}: it takes 0 to {FASTEST:g}")
        if self.loops < 0:
            raise SettingsError(f"the setting 'loops' cannot be {self.loops}: it takes 0 (for ever) or more")

    def open(self, size: Size | None) -> Live:
        """Open the recording; RecordingError as `open_recording`. A size that the file states is taken."""
        recording = open_recording(
            self.where, time_unit=self.time_unit, stream=self.stream, columns=self.columns
        )
        if size is not None and not recording.states_size:
            recording = open_recording(self.where, size, None, self.time_unit, self.stream, self.columns)
        return Replaying(recording, self.speed, self.loops)


class Replaying:
    """A recording that is being played; another thread may pause it, wind it on and change its speed."""

    def __init__(self, recording: Recording, speed: float, loops: int) -> None:
        self.size = recording.size
        self.notes = recording.notes
        self.waits = speed == 0
        self.lost = 0
        self.at_us = 0
        """How far it has come, in microseconds from its first event."""
        self.loop = 1
        """Which time it is played, from 1."""
        self.paused = False
        self._recording, self._speed, self._loops = recording, speed, loops
        self._closed = threading.Event()
        self._jump_us: int | None = None
        self._due_s = self._due_us = 0.0

    @property
    def pace(self) -> float:
        """Seconds of the recording in one second."""
        return 0.0 if self.paused else self._speed

    @property
    def speed(self) -> float:
        """How many times as fast as it was recorded."""
        return self._speed

    def change(self, paused: bool | None = None, speed: float | None = None, by_s: float = 0.0) -> None:
        """Pause or go on, change the speed, wind on or back by seconds; SettingsError if it cannot."""
        if speed is not None and not (0 < speed <= FASTEST and self._speed):
            raise SettingsError(
                f"the speed of this replay cannot become {speed:g}: it takes above 0 to {FASTEST:g}"
            )
        self.paused = self.paused if paused is None else paused
        self._speed = self._speed if speed is None else speed
        if by_s:
            self._jump_us = max(0, self.at_us + round(by_s * 1e6))
        self._due_s = 0.0

    def close(self) -> None:
        """End the replay."""
        self._closed.set()

    def blocks(self) -> Iterator[Item]:
        """The recording's events, each when it is due; DamagedRecordingError at its fault, as offline."""
        start_us = 0
        while not self._closed.is_set():
            yield from self._once(start_us)
            if self._jump_us is not None:
                start_us, self._jump_us = self._jump_us, None
            elif self._loops and self.loop >= self._loops:
                return
            else:
                self.loop, start_us = self.loop + 1, 0
            yield ANEW

    def _once(self, start_us: int) -> Iterator[Item]:
        """From a time after the first event to the end, or until it is to be somewhere else."""
        self._due_s, first_us = 0.0, None
        try:
            for packet in self._recording.packets():
                first_us = int(packet.t_us[0]) if first_us is None else first_us
                packet = packet[int(np.searchsorted(packet.t_us, first_us + start_us)) :]
                for piece in self._pieces(packet):
                    yield from self._wait_for(int(piece.t_us[-1]) - first_us)
                    if self._closed.is_set() or self._jump_us is not None:
                        return
                    yield Block(piece.t_us, piece.x, piece.y, piece.p)
        except DamagedRecordingError:
            if self._loops == 1:
                raise
            # The good part is played over and over; it was said the first time.

    def _pieces(self, packet: Events) -> Iterator[Events]:
        """A packet in pieces of SLICE_US; whole where it is read as fast as it goes."""
        if not self._speed or not len(packet):
            yield from [packet] if len(packet) else []
            return
        edges = np.arange(int(packet.t_us[0]) + SLICE_US, int(packet.t_us[-1]) + 1, SLICE_US)
        cuts = [0, *np.unique(np.searchsorted(packet.t_us, edges)).tolist(), len(packet)]
        for start, stop in itertools.pairwise(cuts):
            if stop > start:
                yield packet[start:stop]

    def _wait_for(self, at_us: int) -> Iterator[None]:
        """Nothing, again and again, until the time has come that is so far from the first event."""
        while not self._closed.is_set() and self._jump_us is None:
            if not self.paused and (not self._speed or self._left_s(at_us) <= 0):
                break
            self._closed.wait(WAIT_S if self.paused else min(WAIT_S, self._left_s(at_us)))
            if self.paused or self._left_s(at_us) > 0:
                yield None
        self.at_us = at_us

    def _left_s(self, at_us: int) -> float:
        """Seconds until that time; it is counted from the first piece after a start or a change."""
        if not self._due_s:
            self._due_s, self._due_us = time.monotonic(), at_us
        return self._due_s + (at_us - self._due_us) / 1e6 / self._speed - time.monotonic()
