"""How far the image moves between two frames: whether they come often enough to simulate events from."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

Frame = NDArray[Any]
"""(H, W) 8-bit grey, or linear light as floats."""

TOO_FAST = 1.0
"""Motion in pixels between two frames above which crossings are no longer known well."""


def image_motion(before: Frame, after: Frame) -> float:
    """About how many pixels the image moved: mean change over mean gradient, of the square root of light.

    Exact for a slow shift; beyond the width of the picture's details it stays below the truth but well
    above 1, so it tells a rate that is too low.
    """
    return float(_motion(np.ascontiguousarray(before), np.ascontiguousarray(after)))


class MotionCheck:
    """Warns once where frames come too seldom for the motion of the image."""

    def __init__(self, every: int = 5) -> None:
        """Looks at one pair of frames in `every`."""
        self._every, self._seen, self._warned = every, 0, False
        self._before: Frame | None = None

    def see(self, frame: Frame) -> None:
        """Look at the next frame."""
        if self._warned:
            return
        if self._seen % self._every == 1 and self._before is not None and self._before.shape == frame.shape:
            motion = image_motion(self._before, frame)
            if motion > TOO_FAST:
                self._warned = True
                warnings.warn(
                    f"the image moves by about {motion:.1f} pixels from frame {self._seen} to the next: "
                    f"events between them are guessed, give more frames a second",
                    stacklevel=3,
                )
        self._before = np.array(frame, copy=True) if self._seen % self._every == 0 else None
        self._seen += 1


@njit(cache=True)
def _motion(before: Frame, after: Frame) -> float:
    """Mean change over mean gradient, both of square roots, which weigh dark and bright parts alike."""
    change, gradient = 0.0, 0.0
    for y in range(before.shape[0] - 1):
        for x in range(before.shape[1] - 1):
            here = np.sqrt(float(before[y, x]))
            change += abs(np.sqrt(float(after[y, x])) - here)
            dx = np.sqrt(float(before[y, x + 1])) - here
            dy = np.sqrt(float(before[y + 1, x])) - here
            gradient += np.sqrt(dx * dx + dy * dy)
    return change / gradient if gradient > 0.0 else 0.0
