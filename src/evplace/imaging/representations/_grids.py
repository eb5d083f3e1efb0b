"""What several representations do with a grid of the sensor's size."""

from __future__ import annotations

from typing import Any

import numpy as np

from evplace.core.compiled import njit
from evplace.core.errors import RecordingError
from evplace.core.events import Events


def outside(events: Events) -> RecordingError:
    return RecordingError(
        f"an event at column {events.x.max()}, row {events.y.max()} lies outside the sensor of "
        f"{events.size[0]}x{events.size[1]}: give the sensor's real `size`"
    )


@njit(cache=True)
def inside(grid: Any, x: Any, y: Any) -> bool:
    """Two maxima over all events: far cheaper than a test at each store."""
    fits: bool = _largest(x) < grid.shape[1] and _largest(y) < grid.shape[0]
    return fits


@njit(cache=True)
def _largest(values: Any) -> Any:
    """Written so that it compiles to vector code: max(), or a loop over the values themselves, does not."""
    most = np.uint16(0)
    for i in range(len(values)):
        value = values[i]
        most = value if value > most else most
    return most


@njit(cache=True)
def mark(grid: Any, x: Any, y: Any) -> bool:
    """Plain byte stores: faster than bit sets, and than scattering into the small image."""
    if not inside(grid, x, y):
        return False
    for i in range(len(x)):
        grid[y[i], x[i]] = -1
    return True
