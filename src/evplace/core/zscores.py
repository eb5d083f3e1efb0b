"""Scores on a scale that means the same on any map: how far above the usual one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST_ORDERED = 2000
"""Scores that are put in order, or some more: every second, third ... of a longer row tells as much."""


def robust_z(row: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """(items,) a score row by its median and half its 16 to 84 % range, so that its peak does not count.

    Zero where all scores are alike.
    """
    values = np.asarray(row, np.float32)
    some = values[:: max(len(values) // MOST_ORDERED, 1)]
    low, middle, high = (int(share * (len(some) - 1)) for share in (0.16, 0.5, 0.84))
    ordered = np.partition(some, sorted({low, middle, high}))
    spread = float(ordered[high] - ordered[low]) / 2
    if spread <= 1e-6 * float(np.abs(ordered[[low, middle, high]]).max()):
        return np.zeros(len(values), np.float32)
    return np.asarray((values - ordered[middle]) / np.float32(spread), np.float32)
