"""What other places than the right one score, and what a score is worth by that."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

STEP = 0.05
GRID = -4.0 + STEP * (np.arange(360) + 0.5)
"""z-scores at which densities are kept."""
TRUST = 0.3
"""How far an image counts as new: images a tenth of a second apart are much alike."""
TOP = 8.0
"""A right place scores anything from 0 to here."""
OUTLIERS = 0.1
"""Share of images that show nothing of their place: a lorry before the camera."""


def density(z: Floats) -> Floats:
    """(GRID,) log density of z-scores (n,) of other places: smoothed counts, then an exponential."""
    ordered = np.sort(z)
    edges = np.append(GRID - STEP / 2, GRID[-1] + STEP / 2)
    counts = np.histogram(ordered, edges)[0] / len(z) / STEP
    kernel: Floats = np.exp(-0.5 * (np.arange(-12, 13) / 4.0) ** 2)
    smooth = np.convolve(counts, kernel / kernel.sum(), "same")
    begin = ordered[int(len(ordered) * 0.995)]
    above = ordered[ordered > begin]
    slope = max(float((above - begin).mean()), 0.1) if len(above) else 0.5
    tail = begin < GRID
    smooth[tail] = 0.005 / slope * np.exp(-(GRID[tail] - begin) / slope)
    return np.asarray(np.log(np.maximum(smooth, 1e-26)), np.float64)


def _usual() -> Floats:
    """Of a map that was not measured: a normal density, with the tail that image comparison usually has."""
    normal = -0.5 * (GRID / 0.93) ** 2 - np.log(0.93 * np.sqrt(2 * np.pi))
    at = int(np.searchsorted(GRID, 2.4))
    tail = normal[at] - 1.93 * (GRID - GRID[at])
    return np.asarray(np.where(GRID[at] > GRID, normal, tail), np.float64)


USUAL = _usual()


def evidence(wrong: Floats) -> Floats:
    """(GRID,) logarithm of how much a z-score speaks for its reference against any other place.

    A score below the likeliest one of other places says no more than that one.
    """
    clamped = np.where(np.arange(len(GRID)) < int(wrong.argmax()), wrong.max(), wrong)
    ratio = TRUST * (-np.log(TOP) - np.maximum(clamped, -60.0))
    return np.asarray(np.log((1 - OUTLIERS) * np.exp(np.minimum(ratio, 40.0)) + OUTLIERS), np.float64)
