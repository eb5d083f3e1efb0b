"""Further outputs of a drive: JSON lines and NMEA, to standard output, a file, a device or UDP.

Each writes on a thread of its own: one that is stuck holds up nothing, and loses the oldest that wait.
"""

from __future__ import annotations

import contextlib
import queue
import socket
import sys
import threading
from collections.abc import Callable
from pathlib import Path

from evplace.core.errors import OutputError
from evplace.serving._report import Report
from evplace.sources.live.udp import host_and_port

WAITING = 256
"""Reports that wait for one output at most."""

Write = Callable[[str], None]


class Output:
    """Texts of reports on their way somewhere."""

    def __init__(self, text: Callable[[Report], str], where: str) -> None:
        """To `where`: - is standard output, `udp:HOST:PORT` packets, anything else a file or a device."""
        self.fault: str | None = None
        """What ended it before its time."""
        self.lost = 0
        self._text, self._where = text, where
        self._waiting: queue.Queue[Report | None] = queue.Queue(WAITING)
        self._write, self._end = _opened(where)
        self._thread = threading.Thread(target=self._run, name=f"output {where}", daemon=True)
        self._thread.start()

    def publish(self, report: Report) -> None:
        """Have a report written; called on another thread."""
        self._put(report)

    def close(self, seconds: float) -> None:
        """Write what waits, but no longer than so many seconds."""
        self._put(None)
        self._thread.join(seconds)
        self._end()

    def _put(self, report: Report | None) -> None:
        while True:
            try:
                self._waiting.put_nowait(report)
                return
            except queue.Full:
                with contextlib.suppress(queue.Empty):
                    self._waiting.get_nowait()
                    self.lost += 1

    def _run(self) -> None:
        try:
            while (report := self._waiting.get()) is not None:
                text = self._text(report)
                if text:
                    self._write(text)
        except OSError as error:
            self.fault = f"the output {self._where} has ended: {error.strerror or error}"


def _opened(where: str) -> tuple[Write, Callable[[], None]]:
    """What writes there, and what ends it; OutputError where it cannot be opened."""
    if where == "-":
        return _print, lambda: None
    if where.startswith("udp:"):
        at = host_and_port(where.removeprefix("udp:").removeprefix("//"), "127.0.0.1")
        sender = socket.socket(socket.AF_INET6 if ":" in at[0] else socket.AF_INET, socket.SOCK_DGRAM)
        return lambda text: _send(sender, text, at), sender.close
    try:
        file = Path(where).open("a", encoding="utf-8", newline="", buffering=1)  # noqa: SIM115 - closed at its end
    except OSError as error:
        raise OutputError(f"cannot write to {where}: {error.strerror or error}") from error
    return lambda text: _append(file.write, text), lambda: _ended(file.close)


def _print(text: str) -> None:
    sys.stdout.write(text)
    sys.stdout.flush()


def _append(write: Callable[[str], int], text: str) -> None:
    write(text)


def _send(sender: socket.socket, text: str, at: tuple[str, int]) -> None:
    with contextlib.suppress(ConnectionRefusedError):  # nobody listens yet
        sender.sendto(text.encode(), at)


def _ended(close: Callable[[], None]) -> None:
    with contextlib.suppress(OSError):
        close()
