"""Events as other programs send them."""

from __future__ import annotations

import numpy as np

from evplace.core.events import Events
from evplace.sources.live._bytes import PACKED


def packed(events: Events) -> bytes:
    table = np.zeros(len(events), PACKED)
    table["t"], table["x"], table["y"], table["p"] = events.t_us, events.x, events.y, events.p
    return table.tobytes()


def faery_datagrams(events: Events) -> list[bytes]:
    return [packed(events[at : at + 100]) for at in range(0, len(events), 100)]
