"""Recording: a file of events as packets that were checked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.ahead import ahead
from evplace.core.errors import (
    DamagedRecordingError,
    DoubtfulRecordingError,
    RecordingError,
    UnsupportedError,
)
from evplace.core.events import Events, Size
from evplace.sources.readers._canvas import Canvas
from evplace.sources.readers._checks import NOTHING_YET, REASONS, checked
from evplace.sources.readers._source import Block, Source, checked_source, joined
from evplace.sources.readers._verdict import verdict

PACKET = 1_000_000
"""Events in a packet at most."""
USUAL_SIZES = (
    (128, 128), (240, 180), (304, 240), (320, 240), (320, 320), (346, 260), (480, 360), (640, 480),
    (1280, 720),
)  # fmt: skip
"""Sensors that are sold or were; the smallest that holds the data is taken where a file states no size."""
LARGE = 1 << 22
"""Bytes of a file from which it is worth a thread."""
NOWHERE = 0xFFFF
"""Stands for a coordinate that is no number: it says nothing of the sensor."""
SAMPLE = 4_000_000
"""Events from which a missing sensor size is inferred."""


class Recording:
    """An event recording, read in packets from its start as often as wanted."""

    path: Path
    format: str
    """The reader's name, for example "aedat4"."""
    size: Size
    """(width, height) of the sensor in pixels."""
    dropped: dict[str, int]
    """Events left out so far, by reason; the reasons are always the same (see `_checks`)."""
    events: int | None
    """Events delivered so far; None before the first packet."""
    t_first_us: int | None
    t_last_us: int | None
    back_us: int
    """How far the furthest of the events dropped as backwards lay back."""
    notes: list[str]
    """Guesses and choices that were made, one plain sentence each."""
    streams: list[str]
    """The names of all streams of events in the file, the one that is read first; empty where a format has
    but one, without a name."""

    def __init__(self, path: Path, format: str, source: Source, size: Size | None) -> None:
        self.path = path
        self.format = format
        self.streams = list(source.streams)
        self.notes = _choice(self.streams) + list(source.notes)
        self._source = source
        self.size = self._decided_size(size)
        self._forget()

    def packets(self, canvas: Canvas | None = None) -> Iterator[Events]:
        """Events from the start, in packets of at most PACKET; the counts start anew as well.

        Where a `canvas` is given, the reader may mark events on it, which are then in no packet: plainly good
        ones of the window that the canvas has open, all of them before the events of the next packet.

        Times never decrease, within a packet and from one to the next. Raises DamagedRecordingError where
        the recording breaks off, after all that came before it has been delivered; DoubtfulRecordingError
        after all, where it can hardly be a recording (see `_verdict`).
        """
        self._forget()
        held: Block | None = None
        fault: RecordingError | None = None
        try:
            for block in self._blocks(canvas):
                good, held = self._kept(block if held is None else joined([held, block]), final=False)
                yield from self._delivered(good)
                if canvas is not None and held is None and self.t_last_us is not None:
                    canvas.open(self.t_last_us)
        except (DamagedRecordingError, UnsupportedError) as error:
            fault = error
        except OSError as error:
            fault = DamagedRecordingError(f"{self.path} cannot be read further: {error.strerror or error}")
        if held is not None:
            good, _ = self._kept(held, final=True)
            yield from self._delivered(good)
        self._judge(fault)

    def _blocks(self, canvas: Canvas | None) -> Iterator[Block]:
        """Decoded blocks; what was marked before the events of each is counted."""
        if canvas is None or self._source.onto is None:
            yield from ahead(self._source.blocks) if self._is_large else self._source.blocks()
            return
        canvas.close()
        for block in self._source.onto(canvas):
            if block.marked:
                self.events, self.t_last_us = (self.events or 0) + block.marked, canvas.last_us
            yield block

    @property
    def _is_large(self) -> bool:
        """Whether it is decoded ahead; marking on a canvas goes hand in hand with the canvas's windows."""
        try:
            size = LARGE if self.path.is_dir() else self.path.stat().st_size
        except OSError:  # it comes from elsewhere, or has gone: its blocks will say so
            return False
        return not self._source.apart and size >= LARGE

    def _judge(self, fault: RecordingError | None) -> None:
        """Raise what ended the reading, else what speaks against it."""
        if isinstance(fault, UnsupportedError) and self.events:
            raise DamagedRecordingError(f"{self.path} is read up to here: {fault}") from fault
        if fault is not None:
            raise fault
        span_us = (self.t_last_us or 0) - (self.t_first_us or 0)
        doubt = verdict(self.events or 0, self.dropped, span_us, self.size)
        if doubt is not None:
            raise DoubtfulRecordingError(f"{self.path} (as {self.format}): {doubt}")

    def hold(self, family: str, part: object) -> None:
        """Name `part`, which made this recording's source, where that breaks what it promises."""
        self._source = checked_source(self._source, family, part)

    @property
    def states_size(self) -> bool:
        """Whether the file says its sensor's size."""
        return self._source.size is not None

    @property
    def turn_us(self) -> int:
        """Microseconds after which the file's clock starts anew; 0 where it never does."""
        return self._source.turn_us

    @property
    def wraps(self) -> int:
        """How often the file's clock started anew between the first and the last event delivered so far."""
        turn_us, zero_us = self._source.turn_us, self._source.zero_us
        if not turn_us or self.t_first_us is None or self.t_last_us is None:
            return 0
        return (self.t_last_us - zero_us) // turn_us - (self.t_first_us - zero_us) // turn_us

    def _kept(self, block: Block, final: bool) -> tuple[Block, Block | None]:
        last_us = NOTHING_YET if self.t_last_us is None else self.t_last_us
        good, held, drops = checked(block, self.size, last_us, final)
        for reason, count in zip(REASONS, drops, strict=True):
            self.dropped[reason] += count
        self.back_us = max(self.back_us, good.back_us)
        return good, held

    def _delivered(self, block: Block) -> Iterator[Events]:
        """The block in packets, each counted before it is handed out."""
        events = Events(block.t_us, block.x, block.y, block.p, self.size).as_checked()
        for start in range(0, len(events), PACKET):
            packet = events[start : start + PACKET]
            self.events = (self.events or 0) + len(packet)
            if self.t_first_us is None:
                self.t_first_us = int(packet.t_us[0])
            self.t_last_us = int(packet.t_us[-1])
            yield packet

    def _forget(self) -> None:
        self.dropped = dict.fromkeys(REASONS, 0)
        self.events = self.t_first_us = self.t_last_us = None
        self.back_us = 0

    def _decided_size(self, given: Size | None) -> Size:
        """The size given, else the header's, else the smallest usual one that holds the data."""
        stated = self._source.size
        if given is not None:
            if stated is not None and stated != given:
                self.notes.append(f"size {_text(given)} as given; the file says {_text(stated)}")
            return given
        if stated is not None:
            return stated
        inferred = _smallest_holding(self._source)
        self.notes.append(f"the file states no sensor size: {_text(inferred)} inferred from its events")
        return inferred


def _choice(streams: list[str]) -> list[str]:
    """What is read of several streams of events, and what is not."""
    if len(streams) < 2:
        return []
    others = ", ".join(streams[1:])
    return [f"events are read from {streams[0]}; there are also {others}: choose with `stream=NAME`"]


def _smallest_holding(source: Source) -> Size:
    """The smallest usual sensor that holds all but one in 10,000 of the first events."""
    columns, rows, seen = np.zeros(1 << 16, np.int64), np.zeros(1 << 16, np.int64), 0
    fault: RecordingError | None = None
    try:
        for block in source.blocks():
            columns += np.bincount(block.x, minlength=1 << 16)
            rows += np.bincount(block.y, minlength=1 << 16)
            seen += len(block.t_us)
            if seen >= SAMPLE:
                break
    except (DamagedRecordingError, UnsupportedError) as error:
        fault = error  # it is raised again when the packets are read
    if seen == 0:
        raise fault or RecordingError(
            "the file states no sensor size and holds no event to infer it from: give the `size`"
        )
    width, height = _extent(columns), _extent(rows)
    return next(((w, h) for w, h in USUAL_SIZES if w >= width and h >= height), (width, height))


def _extent(counts: NDArray[np.int64]) -> int:
    """One more than the coordinate that all but one in 10,000 events reach at most."""
    counts = counts[:NOWHERE]
    total = int(counts.sum())
    return int(np.searchsorted(np.cumsum(counts), total - total // 10_000)) + 1


def _text(size: Size) -> str:
    return f"{size[0]}x{size[1]}"
