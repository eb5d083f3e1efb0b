"""The TCP network stream of dv-processing and DV, read in a child process: its reader can hang for ever."""

from __future__ import annotations

import contextlib
import queue
import subprocess
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.util import find_spec

from evplace.core.errors import EvplaceError, MissingExtraError
from evplace.core.events import Size
from evplace.core.workers import start
from evplace.sources.live import ANEW, WAIT_S, Item, Live, _dv_child
from evplace.sources.live.udp import host_and_port
from evplace.sources.readers import Block
from evplace.sources.readers._isolated import message

PATIENCE_S = 5.0
"""Seconds without a sign of life after which the child is taken to hang."""
AGAIN_S = 0.2
"""Seconds until a stream that has ended is asked for again."""
HELD = 64
"""Messages of the child that are held at most; it waits beyond that."""


@dataclass(frozen=True)
class DV:
    """A stream that a dv-processing NetworkWriter or DV's network output offers."""

    where: str = ""
    """Address and port: 127.0.0.1:7777, or a port on this machine."""

    def open(self, size: Size | None) -> Live:
        """Begin; RecordingError for no address, MissingExtraError without dv-processing."""
        host, port = host_and_port(self.where, "127.0.0.1")
        if find_spec("dv_processing") is None:
            raise MissingExtraError("dv-processing", "live", "a stream of DV")
        return Streaming(host, port, size)


class Streaming:
    """A stream that is asked for again whenever it has ended."""

    pace = 1.0
    waits = False

    def __init__(self, host: str, port: int, size: Size | None) -> None:
        self.size = size
        self.lost = 0
        self.notes: list[str] = []
        self._job = {"host": host, "port": port}
        self._closed = threading.Event()

    def close(self) -> None:
        """End the reading."""
        self._closed.set()

    def blocks(self) -> Iterator[Item]:
        """Events as they come, whoever sends them; None while nobody does."""
        begun = False
        while not self._closed.is_set():
            for item in self._once():
                begun = begun or isinstance(item, Block)
                yield item
            if begun and not self._closed.is_set():
                self.lost += 1
                begun = False
                yield ANEW
            self._closed.wait(AGAIN_S)
            yield None

    def _once(self) -> Iterator[Item]:
        """What one child gives, from its start to its end."""
        child = start(_dv_child.__name__, self._job, stderr=subprocess.DEVNULL)
        found: queue.Queue[Item | Size] = queue.Queue(HELD)
        reading = threading.Thread(target=_read, args=(child, found), daemon=True)
        reading.start()
        silent_s = 0.0
        try:
            while not self._closed.is_set() and silent_s < PATIENCE_S:
                try:
                    item = found.get(timeout=WAIT_S)
                except queue.Empty:
                    silent_s += WAIT_S
                    yield None
                    if not reading.is_alive() and found.empty():
                        return
                    continue
                silent_s = 0.0
                if isinstance(item, tuple) and not isinstance(item, Block):
                    self.size = item
                else:
                    yield item
        finally:
            _end(child, reading, found)


def _end(child: subprocess.Popen[bytes], reading: threading.Thread, found: queue.Queue[Item | Size]) -> None:
    """End a child, and the thread that hears it, which may wait for room."""
    child.kill()
    while reading.is_alive():
        with contextlib.suppress(queue.Empty):
            found.get(timeout=WAIT_S)
    child.communicate()


def _read(child: subprocess.Popen[bytes], found: queue.Queue[Item | Size]) -> None:
    """Hand on what the child says, until it says no more."""
    assert child.stdout is not None
    try:
        while (said := message(child.stdout)) is not None:
            if isinstance(said, Block):
                found.put(said if len(said.t_us) else None)
            elif said["size"] is not None:
                found.put((said["size"][0], said["size"][1]))
    except (EOFError, EvplaceError, ValueError):
        return
