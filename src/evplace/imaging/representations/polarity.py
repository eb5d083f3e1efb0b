"""Where the pixel became darker, and where brighter."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from evplace.core.events import Events, Size
from evplace.imaging.representations import Channels
from evplace.imaging.representations._grids import mark, outside


class Polarity:
    """Two binary grids: where the pixel became darker, and where it became brighter."""

    used: ClassVar[tuple[str, ...]] = ()

    def __init__(self, size: Size) -> None:
        self._grid = np.zeros((2, size[1], size[0]), np.int8)

    def add(self, events: Events) -> None:
        """See Representation."""
        for sign in (0, 1):
            chosen = events.p == bool(sign)
            if not mark(self._grid[sign], events.x[chosen], events.y[chosen]):
                raise outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        return self._grid

    def clear(self) -> None:
        """See Representation."""
        self._grid.fill(0)
