"""How much an image shows of a camera that moves: one that stands shows little, and nothing new."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Images = NDArray[np.uint8]


class Activity:
    """Of the images of one drive, one after another."""

    def __init__(self, of_events: bool) -> None:
        """Event images show what moves; of a camera's own images it is what changes from one to the next."""
        self._of_events = of_events
        self._before: NDArray[np.int16] | None = None

    def push(self, image: Images) -> float:
        """Mean grey level of an event image; mean change of a camera image, NaN of the first."""
        if self._of_events:
            return float(image.mean())
        values = image.astype(np.int16)
        before, self._before = self._before, values
        return float("nan") if before is None else float(np.abs(values - before).mean())


def activity(images: Images, of_events: bool) -> NDArray[np.float64]:
    """(n,) of the images of a drive."""
    measured = Activity(of_events)
    return np.array([measured.push(image) for image in images])
