"""A file that another program is writing: raw EVT2 or EVT3, lines of `t x y p`, or packed events."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from evplace.core.errors import RecordingError
from evplace.core.events import Size
from evplace.sources.live import ANEW, WAIT_S, Item, Live
from evplace.sources.live._bytes import ByteStream
from evplace.sources.live.stdin import PART, check_format


@dataclass(frozen=True)
class Tail:
    """A growing file, from its start on."""

    where: str = ""
    """The file's path; it may not be there yet."""
    format: str | None = None
    """evt2, evt3, packed or text, where the file does not say."""
    live: bool = False
    """Whether silence means that nothing happens: windows are then closed by the clock. A program that writes
    only now and then, when its buffer is full, is silent for other reasons."""

    def __post_init__(self) -> None:
        check_format(self.format)

    def open(self, size: Size | None) -> Live:
        """Begin to watch the file; RecordingError for a folder."""
        path = Path(self.where)
        if path.is_dir() or not self.where:
            raise RecordingError(f"'{self.where}' is no file that can grow: give a file's path")
        return Growing(path, self.format, size, 1.0 if self.live else 0.0)


class Growing:
    """A file that is read as it grows; one that is replaced or cut is read from its start again."""

    waits = True

    def __init__(self, path: Path, format: str | None, size: Size | None, pace: float) -> None:
        self.pace = pace
        self.notes = [] if path.exists() else [f"{path} is not there yet: it is waited for"]
        self._path, self._format, self._given = path, format, size
        self._bytes, self._lost_before = ByteStream(format), 0
        self._closed = threading.Event()

    @property
    def size(self) -> Size | None:
        """The sensor's, as the file says it."""
        return self._bytes.size or self._given

    @property
    def lost(self) -> int:
        """Lines that were no event, of all files."""
        return self._lost_before + self._bytes.lost

    def close(self) -> None:
        """End the watching."""
        self._closed.set()

    def blocks(self) -> Iterator[Item]:
        """What is written, as it is; RecordingError where it is of no known format."""
        while not self._closed.is_set():
            try:
                with self._path.open("rb") as file:
                    yield from self._grown(file)
            except FileNotFoundError:
                self._closed.wait(WAIT_S)
                yield None
            except OSError as error:
                raise RecordingError(f"cannot read {self._path}: {error.strerror or error}") from error

    def _grown(self, file: BinaryIO) -> Iterator[Item]:
        """The events of one file, until another takes its place."""
        self._lost_before, self._bytes = self.lost, ByteStream(self._format)
        while not self._closed.is_set():
            data = file.read(PART)
            if data:
                yield from self._bytes.push(data)
            elif self._is_another(file):
                yield ANEW
                return
            else:
                self._closed.wait(WAIT_S)
                yield None

    def _is_another(self, file: BinaryIO) -> bool:
        """Whether the name stands for another file by now, or this one was cut."""
        try:
            now = self._path.stat()
        except FileNotFoundError:
            return False  # it may come back under its name
        return not os.path.samestat(now, os.fstat(file.fileno())) or now.st_size < file.tell()
