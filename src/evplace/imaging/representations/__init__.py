"""What a window of events leaves on the sensor's grid: the paper's binary image and its rivals.

One file a representation: a class of the file's name that is a `Representation`, made for a sensor of `size`
(width, height) with those settings of images that its `used` names.
"""

from __future__ import annotations

from typing import Any, ClassVar, Protocol

from numpy.typing import NDArray

from evplace.core.events import Events

Channels = NDArray[Any]
"""(C, H, W) int8 holding 0 and -1 (set), or float32 in [0, 1]."""


def grid_of(representation: Representation) -> NDArray[Any] | None:
    """What readers may mark themselves, where a representation shows no more than where events fell.

    That is its `grid` (H, W), if it has one: int8, where an event sets -1, or int32, where it adds 1.
    """
    grid: NDArray[Any] | None = getattr(representation, "grid", None)
    return grid


class Representation(Protocol):
    """Remembers the events of the open window."""

    used: ClassVar[tuple[str, ...]]
    """The fields of ImageSettings that it is made with, by their names, beside `size`."""

    def add(self, events: Events) -> None:
        """Take events of the open window; RecordingError where one lies outside the sensor."""

    def channels(self, t_us: int) -> Channels:
        """(C, H, W): the window that ends at `t_us`."""

    def clear(self) -> None:
        """Begin the next window."""
