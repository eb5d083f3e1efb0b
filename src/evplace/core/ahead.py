"""Making what comes next in a thread of its own, while what came before is used: the other core's share."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Generator, Iterator
from queue import SimpleQueue
from typing import TypeVar

T = TypeVar("T")


class _End:
    """After the last part; what broke the parts off, if something did."""

    def __init__(self, error: BaseException | None) -> None:
        self.error = error


def ahead(make: Callable[[], Iterator[T]], most: int = 4) -> Iterator[T]:
    """What the iterator that `make` gives holds; `most` parts, and the next, are made before they are asked.

    What it raises is raised here, after all that it gave before. Whoever stops early, as by Ctrl-C, waits
    until the part that is being made is done; then the iterator is closed, in its own thread.
    """
    ready: SimpleQueue[T | _End] = SimpleQueue()
    room, stopped = threading.Semaphore(most), threading.Event()

    def run() -> None:
        try:
            with contextlib.closing(_generator(make)) as parts:
                for part in parts:
                    ready.put(part)
                    room.acquire()
                    if stopped.is_set():
                        return
            ready.put(_End(None))
        except BaseException as error:
            ready.put(_End(error))

    thread = threading.Thread(target=run, name="ahead", daemon=True)
    thread.start()
    try:
        while not isinstance(part := ready.get(), _End):
            yield part
            room.release()
        if part.error is not None:
            raise part.error
    finally:
        stopped.set()
        room.release()
        if thread is not threading.current_thread():  # which may be the one that collects what is forgotten
            thread.join()


def _generator(make: Callable[[], Iterator[T]]) -> Generator[T, None, None]:
    yield from make()
