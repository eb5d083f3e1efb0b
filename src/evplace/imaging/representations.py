"""What a window of events leaves on the sensor's grid: the paper's binary image and its rivals.

Each takes events with `add`, and gives with `channels(t_us)` its grids (C, H, W) at the window's end: int8
holding 0 and -1 (set), or float32 in [0, 1]. `clear` starts the next window.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numba import njit
from numpy.typing import NDArray

from evplace.core.errors import RecordingError
from evplace.core.events import Events, Size

Channels = NDArray[Any]


class Representation(Protocol):
    """Remembers the events of the open window."""

    def add(self, events: Events) -> None:
        """Take events of the open window; RecordingError where one lies outside the sensor."""

    def channels(self, t_us: int) -> Channels:
        """(C, H, W): the window that ends at `t_us`."""

    def clear(self) -> None:
        """Begin the next window."""


class Binary:
    """1 where an event fell, whatever its sign (paper, Eq. 3)."""

    def __init__(self, size: Size) -> None:
        self._grid = np.zeros((1, size[1], size[0]), np.int8)

    def add(self, events: Events) -> None:
        """See Representation."""
        if not _mark(self._grid[0], events.x, events.y):
            raise _outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        return self._grid

    def clear(self) -> None:
        """See Representation."""
        self._grid.fill(0)


class Polarity:
    """Two binary grids: where the pixel became darker, and where it became brighter."""

    def __init__(self, size: Size) -> None:
        self._grid = np.zeros((2, size[1], size[0]), np.int8)

    def add(self, events: Events) -> None:
        """See Representation."""
        for sign in (0, 1):
            chosen = events.p == bool(sign)
            if not _mark(self._grid[sign], events.x[chosen], events.y[chosen]):
                raise _outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        return self._grid

    def clear(self) -> None:
        """See Representation."""
        self._grid.fill(0)


class Count:
    """How many events fell, up to `saturation`, as a share of it."""

    def __init__(self, size: Size, saturation: int) -> None:
        self._grid = np.zeros((size[1], size[0]), np.int32)
        self._saturation = saturation

    def add(self, events: Events) -> None:
        """See Representation."""
        if not _count(self._grid, events.x, events.y):
            raise _outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        share = np.minimum(self._grid, self._saturation) / np.float32(self._saturation)
        return share.astype(np.float32)[None]

    def clear(self) -> None:
        """See Representation."""
        self._grid.fill(0)


class TimeSurface:
    """exp(-(t - last event's time) / tau): the last time at each pixel, remembered across windows."""

    def __init__(self, size: Size, tau_us: float) -> None:
        self._last_us = np.full((size[1], size[0]), -1, np.int64)
        self._tau_us = tau_us

    def add(self, events: Events) -> None:
        """See Representation."""
        if not _last(self._last_us, events.t_us, events.x, events.y):
            raise _outside(events)

    def channels(self, t_us: int) -> Channels:
        """See Representation."""
        surface = np.exp(-np.maximum(t_us - self._last_us, 0) / self._tau_us)
        surface[self._last_us < 0] = 0.0
        return surface.astype(np.float32)[None]

    def clear(self) -> None:
        """See Representation; the last times stay, since the decay is what forgets them."""


class Voxel:
    """Zhu et al.'s grid of `bins` times: each event's sign is shared between the two bins beside its time.

    Sums are cut at -`saturation` and `saturation` and mapped to [0, 1], so that no event is 0.5.
    """

    def __init__(self, size: Size, bins: int, saturation: int) -> None:
        self._size, self._bins, self._saturation = size, bins, saturation
        self._parts: list[Events] = []

    def add(self, events: Events) -> None:
        """See Representation."""
        if len(events) and (events.x.max() >= self._size[0] or events.y.max() >= self._size[1]):
            raise _outside(events)
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


def _outside(events: Events) -> RecordingError:
    return RecordingError(
        f"an event at column {events.x.max()}, row {events.y.max()} lies outside the sensor of "
        f"{events.size[0]}x{events.size[1]}: give the sensor's real `size`"
    )


@njit(cache=True)
def _inside(grid: Any, x: Any, y: Any) -> bool:
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
def _mark(grid: Any, x: Any, y: Any) -> bool:
    """Plain byte stores: faster than bit sets, and than scattering into the small image."""
    if not _inside(grid, x, y):
        return False
    for i in range(len(x)):
        grid[y[i], x[i]] = -1
    return True


@njit(cache=True)
def _count(grid: Any, x: Any, y: Any) -> bool:
    if not _inside(grid, x, y):
        return False
    for i in range(len(x)):
        grid[y[i], x[i]] += 1
    return True


@njit(cache=True)
def _last(grid: Any, t_us: Any, x: Any, y: Any) -> bool:
    if not _inside(grid, x, y):
        return False
    for i in range(len(x)):
        grid[y[i], x[i]] = t_us[i]
    return True


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
