"""Recorder: writes what comes, on a thread of its own; a full disk ends it, and nothing else."""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from pathlib import Path

from evplace.core.errors import EvplaceError, OutputError
from evplace.core.events import Events, Size
from evplace.core.storage import check_new_file
from evplace.sources.writers import write_recording

HELD = 4_000_000
"""Events that wait to be written at most; beyond that they are left out and counted."""


class Recorder:
    """A file that grows; once its sensor's clock begins anew, NAME-2 and so on beside it."""

    def __init__(self, path: Path, size: Size, overwrite: bool = False) -> None:
        """OutputError where `path` exists, or its format can only be written at the end."""
        if path.suffix.lower() == ".npz":
            raise OutputError(
                f"{path}: an .npz can only be written at the end: record to .raw, .aedat4 or .h5"
            )
        check_new_file(path, overwrite)
        self.path = path
        self.events = 0
        """Events that were written."""
        self.left_out = 0
        """Events that were not, because the disk was too slow or full."""
        self.fault: str | None = None
        """What ended the recording before its time."""
        self.files: list[Path] = []
        """The files that are complete."""
        self._size, self._overwrite = size, overwrite
        self._queue: queue.Queue[Events | None] = queue.Queue()  # None ends a file
        self._waiting = 0
        self._taken = False
        self._thread = threading.Thread(target=self._run, name="recorder", daemon=True)
        self._thread.start()

    def take(self, events: Events, anew: bool) -> None:
        """Have events written; `anew` where the sensor's clock begins anew with them."""
        if self.fault is not None or self._waiting + len(events) > HELD:
            self.left_out += len(events)
            return
        if anew and self._taken:
            self._queue.put(None)
        self._taken = True
        self._waiting += len(events)
        self._queue.put(events)

    def close(self, seconds: float) -> None:
        """Complete the file; `fault` says so where that takes longer."""
        self._queue.put(None)  # which ends the file
        self._queue.put(None)  # and no other follows
        self._thread.join(seconds)
        if self._thread.is_alive():
            self.fault = f"{self.path} was not complete after {seconds:g} s"

    def _run(self) -> None:
        name, number = self.path, 1
        while (first := self._queue.get()) is not None:
            try:
                write_recording(name, self._written(first), self._size, overwrite=self._overwrite)
            except EvplaceError as error:
                self.fault = str(error)
                self._queue = queue.Queue()
                return
            self.files.append(name)
            number += 1
            name = self.path.with_stem(f"{self.path.stem}-{number}")

    def _written(self, first: Events) -> Iterator[Events]:
        """The events of one file."""
        events: Events | None = first
        while events is not None:
            yield events
            self._waiting -= len(events)
            self.events += len(events)
            events = self._queue.get()
