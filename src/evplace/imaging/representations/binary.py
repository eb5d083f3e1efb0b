"""Where an event fell: the paper's image."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from evplace.core.events import Events, Size
from evplace.imaging.representations import Channels
from evplace.imaging.representations._grids import mark, outside


class Binary:
    """1 where an event fell, whatever its sign (paper, Eq. 3)."""

    used: ClassVar[tuple[str, ...]] = ()

    def __init__(self, size: Size) -> None:
        self._grid = np.zeros((1, size[1], size[0]), np.int8)

    def add(self, events: Events) -> None:
        """See Representation."""
        if not mark(self._grid[0], events.x, events.y):
            raise outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        return self._grid

    def clear(self) -> None:
        """See Representation."""
        self._grid.fill(0)
