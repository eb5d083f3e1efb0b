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
        self.grid = np.zeros((size[1], size[0]), np.int8)
        """(H, W), which readers may mark by themselves."""

    def add(self, events: Events) -> None:
        """See Representation."""
        if not mark(self.grid, events.x, events.y):
            raise outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        return self.grid[None]

    def clear(self) -> None:
        """See Representation."""
        self.grid.fill(0)
