"""How long ago the last event fell."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from evplace.core.compiled import njit
from evplace.core.events import Events, Size
from evplace.imaging.representations import Channels
from evplace.imaging.representations._grids import inside, outside


class TimeSurface:
    """exp(-(t - last event's time) / tau): the last time at each pixel, remembered across windows."""

    used: ClassVar[tuple[str, ...]] = ("tau_ms",)

    def __init__(self, size: Size, tau_ms: float) -> None:
        self._last_us = np.full((size[1], size[0]), -1, np.int64)
        self._tau_us = tau_ms * 1000

    def add(self, events: Events) -> None:
        """See Representation."""
        if not _last(self._last_us, events.t_us, events.x, events.y):
            raise outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        surface = np.exp(-np.maximum(t_us - self._last_us, 0) / self._tau_us)
        surface[self._last_us < 0] = 0.0
        return surface.astype(np.float32)[None]

    def clear(self) -> None:
        """See Representation; the last times stay, since the decay is what forgets them."""


@njit(cache=True)
def _last(grid: Any, t_us: Any, x: Any, y: Any) -> bool:
    if not inside(grid, x, y):
        return False
    for i in range(len(x)):
        grid[y[i], x[i]] = t_us[i]
    return True
