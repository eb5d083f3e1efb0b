"""Sources that give what a test tells them to, when it tells them to."""

from __future__ import annotations

import queue
from collections.abc import Iterator

from evplace.core.events import Events, Size
from evplace.sources.live import Item
from evplace.sources.readers import Block


def block(events: Events) -> Block:
    return Block(events.t_us, events.x, events.y, events.p)


class Made:
    """Gives the items that are `put`, one after another; `end` ends it."""

    def __init__(self, size: Size | None = (80, 60), pace: float = 1.0, waits: bool = False) -> None:
        self.size, self.pace, self.waits = size, pace, waits
        self.lost = 0
        self._items: queue.Queue[Item | Exception | str] = queue.Queue()

    def put(self, *items: Item | Exception) -> None:
        for item in items:
            self._items.put(item)

    def end(self) -> None:
        self._items.put("end")

    def close(self) -> None:
        self.end()

    def blocks(self) -> Iterator[Item]:
        while True:
            try:
                item = self._items.get(timeout=0.01)
            except queue.Empty:
                yield None
                continue
            if isinstance(item, str):
                return
            if isinstance(item, Exception):
                raise item
            yield item
