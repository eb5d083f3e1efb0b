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
