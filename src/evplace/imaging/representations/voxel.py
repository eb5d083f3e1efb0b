"""Events shared between bins of time."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from evplace.core.compiled import njit
from evplace.core.events import Events, Size
from evplace.imaging.representations import Channels
from evplace.imaging.representations._grids import outside


class Voxel:
    """Zhu et al.'s grid of `bins` times: each event's sign is shared between the two bins beside its time.

    Sums are cut at -`saturation` and `saturation` and mapped to [0, 1], so that no event is 0.5.
    """

    used: ClassVar[tuple[str, ...]] = ("bins", "saturation")

    def __init__(self, size: Size, bins: int, saturation: int) -> None:
        self._size, self._bins, self._saturation = size, bins, saturation
        self._parts: list[Events] = []

    def add(self, events: Events) -> None:
        """See Representation."""
        if len(events) and (events.x.max() >= self._size[0] or events.y.max() >= self._size[1]):
            raise outside(events)
        self._parts.append(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation; time runs from the window's first event to its last (Zhu et al. 2019)."""
        grid = np.zeros((self._bins, self._size[1], self._size[0]), np.float32)
        if any(len(part) for part in self._parts):
            events = Events.concatenate(self._parts)
            span = max(int(events.t_us[-1] - events.t_us[0]), 1)
            position = (events.t_us - events.t_us[0]) * (self._bins - 1) / span
            _share(grid, position, events.x, events.y, events.p)
        share = np.clip(grid / np.float32(self._saturation), -1, 1)
        share = share * np.float32(0.5) + np.float32(0.5)
        return np.asarray(share, np.float32)

    def clear(self) -> None:
        """See Representation."""
        self._parts.clear()


@njit(cache=True)
def _share(grid: Any, position: Any, x: Any, y: Any, p: Any) -> None:
    bins = grid.shape[0]
    for i in range(len(x)):
        sign = 1.0 if p[i] else -1.0
        left = int(position[i])
        right_share = position[i] - left
        grid[left, y[i], x[i]] += sign * (1.0 - right_share)
        if left + 1 < bins:
            grid[left + 1, y[i], x[i]] += sign * right_share
