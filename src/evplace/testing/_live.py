"""What a live source promises."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from evplace.core import families
from evplace.core.events import Size
from evplace.sources.live import Anew, Facts, Item, Source
from evplace.sources.readers import Block
from evplace.testing._require import check_settings, require

ITEMS = 1000
"""Items that are looked at, at most."""
QUIET = 20
"""Items one after another that say that nothing came, after which no more events are waited for."""
END_S = 60.0
"""Seconds within which a source that was closed must end; a busy machine is slow."""
FIELDS = tuple(map(np.dtype, (np.int64, np.uint16, np.uint16, np.bool_)))


def check_live(source: Source, size: Size | None = None) -> None:
    """That a source is a frozen dataclass of settings that opens something that gives events and ends.

    `source` has settings under which it gives events; `size` is that of its sensor, where it must be told.
    """
    check_settings("live", source)
    who = families.described("live", source)
    live = source.open(size)
    for name in ("blocks", "close"):
        require(callable(getattr(live, name, None)), f"what {who} opens must have {name}()")
    facts = Facts.of(live)
    require(facts.pace >= 0, f"the pace of {who} must be 0 or more, not {facts.pace}")
    found = _some(live.blocks(), who)
    require(any(isinstance(item, Block) for item in found), f"{who} must give events here, it gave none")
    for item in found:
        _check_item(item, who)
    _check_end(source, size, who)


def _some(items: Any, who: str) -> list[Item]:
    """What comes, until there are events enough."""
    found: list[Item] = []
    for item in items:
        found.append(item)
        blocks = sum(isinstance(one, Block) for one in found)
        if len(found) >= ITEMS or blocks >= 3 or (blocks and found[-QUIET:] == [None] * QUIET):
            break
    require(found, f"{who} must give something")
    items.close()
    return found


def _check_item(item: object, who: str) -> None:
    require(
        item is None or isinstance(item, Anew | Block),
        f"{who} must give a Block, None or ANEW, not {type(item).__name__}",
    )
    if isinstance(item, Block):
        kinds = tuple(np.asarray(column).dtype for column in item[:4])
        require(kinds == FIELDS, f"blocks of {who} must be t_us int64, x and y uint16, p bool, not {kinds}")
        require(len({len(column) for column in item[:4]}) == 1, f"columns of {who} must be of one length")


def _check_end(source: Source, size: Size | None, who: str) -> None:
    """That it ends when another thread closes it."""
    live = source.open(size)
    ended = threading.Event()

    def run() -> None:
        for _ in live.blocks():
            pass
        ended.set()

    threading.Thread(target=run, daemon=True).start()
    live.close()
    require(ended.wait(END_S), f"blocks() of {who} must end soon after close()")
