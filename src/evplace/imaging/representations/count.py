"""How many events fell."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from evplace.core.compiled import njit
from evplace.core.events import Events, Size
from evplace.imaging.representations import Channels
from evplace.imaging.representations._grids import inside, outside


class Count:
    """How many events fell, up to `saturation`, as a share of it."""

    used: ClassVar[tuple[str, ...]] = ("saturation",)

    def __init__(self, size: Size, saturation: int) -> None:
        self.grid = np.zeros((size[1], size[0]), np.int32)
        """(H, W), which readers may mark by themselves."""
        self._saturation = saturation

    def add(self, events: Events) -> None:
        """See Representation."""
        if not _count(self.grid, events.x, events.y):
            raise outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        share = np.minimum(self.grid, self._saturation) / np.float32(self._saturation)
        return share.astype(np.float32)[None]

    def clear(self) -> None:
        """See Representation."""
        self.grid.fill(0)


@njit(cache=True)
def _count(grid: Any, x: Any, y: Any) -> bool:
    if not inside(grid, x, y):
        return False
    for i in range(len(x)):
        grid[y[i], x[i]] += 1
    return True
