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
    return z_by(values[ordered(len(values))], values)


def z_by(usual: NDArray[np.floating[Any]], scores: NDArray[np.floating[Any]]) -> NDArray[np.float32]:
    """(n,) some scores of a row by those (m,) that say what is usual."""
    middle, spread = scale_of(np.asarray(usual, np.float32))
    if not spread:
        return np.zeros(len(scores), np.float32)
    return np.asarray((scores - middle) / np.float32(spread), np.float32)


def scale_of(some: NDArray[np.float32]) -> tuple[np.float32, float]:
    """The median of scores and half their 16 to 84 % range, which is 0 where all are alike."""
    low, middle, high = (int(share * (len(some) - 1)) for share in (0.16, 0.5, 0.84))
    lowest, usual, highest = np.sort(some)[[low, middle, high]]  # many times as fast as a partition
    spread = float(highest - lowest) / 2
    alike = spread <= 1e-6 * float(max(abs(lowest), abs(usual), abs(highest)))
    return usual, 0.0 if alike else spread


def ordered(items: int) -> slice:
    """The scores of a row that are put in order: those that say what is usual."""
    return slice(None, None, max(items // MOST_ORDERED, 1))
