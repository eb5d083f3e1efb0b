"""Standard input: raw EVT2 or EVT3 with their headers, lines of `t x y p`, or events of 13 bytes (packed)."""

from __future__ import annotations

import os
import select
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass

from evplace.core.errors import SettingsError
from evplace.core.events import Size
from evplace.sources.live import WAIT_S, Item, Live
from evplace.sources.live._bytes import FORMATS, ByteStream

PART = 1 << 18
"""Bytes read at a time at most."""


@dataclass(frozen=True)
class Stdin:
    """What another program writes to a pipe."""

    where: str = ""
    """Nothing: there is one standard input."""
    format: str | None = None
    """evt2, evt3, packed or text, where the stream does not say."""
    live: bool = False
    """Whether silence means that nothing happens: windows are then closed by the clock."""

    def __post_init__(self) -> None:
        check_format(self.format)

    def open(self, size: Size | None) -> Live:
        """Begin to read."""
        return Piped(sys.stdin.fileno(), self.format, size, 1.0 if self.live else 0.0)


class Piped:
    """A pipe that is being read; its writer waits where we are slow."""

    waits = True

    def __init__(self, number: int, format: str | None, size: Size | None, pace: float) -> None:
        self.pace = pace
        self.notes: list[str] = []
        self._number, self._bytes, self._given = number, ByteStream(format), size
        self._closed = threading.Event()

    @property
    def size(self) -> Size | None:
        """The sensor's, as the stream says it once it has begun."""
        return self._bytes.size or self._given

    @property
    def lost(self) -> int:
        """Lines that were no event."""
        return self._bytes.lost

    def close(self) -> None:
        """End the reading."""
        self._closed.set()

    def blocks(self) -> Iterator[Item]:
        """What comes, up to the end of the pipe; RecordingError where it is of no known format."""
        while not self._closed.is_set():
            if sys.platform != "win32" and not select.select([self._number], [], [], WAIT_S)[0]:
                yield None
                continue
            data = os.read(self._number, PART)
            if not data:
                return
            yield from self._bytes.push(data)


def check_format(format: str | None) -> None:
    """SettingsError for a format of a stream that there is not."""
    if format not in (None, *FORMATS):
        raise SettingsError(f"the setting 'format' cannot be '{format}': known are {', '.join(FORMATS)}")
