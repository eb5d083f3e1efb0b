"""Repeated: where an event was followed by another, which the noise of single pixels seldom is."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import RecordingError
from evplace.core.events import Events, Size


class Repeated:
    """1 where two events or more fell in the window, whatever their signs."""

    used: ClassVar[tuple[str, ...]] = ()

    def __init__(self, size: Size) -> None:
        self._counts = np.zeros((1, size[1], size[0]), np.int64)

    def add(self, events: Events) -> None:
        """See Representation."""
        height, width = self._counts.shape[1:]
        if np.any(events.x >= width) or np.any(events.y >= height):
            raise RecordingError(f"an event lies outside the sensor of {width}x{height}: give its real size")
        np.add.at(self._counts[0], (events.y, events.x), 1)

    def channels(self, t_us: int) -> NDArray[Any]:  # noqa: ARG002 - the window's end makes no difference
        """See Representation."""
        return -(self._counts > 1).astype(np.int8)

    def clear(self) -> None:
        """See Representation."""
        self._counts.fill(0)
