"""Textures as functions: hashes, smooth noise and box-filtered pulse trains.

A pulse train averaged over the footprint of a pixel has a closed form, so windows, bricks and lane
dashes do not flicker as they shrink, and there are no image files to ship.
"""

from __future__ import annotations

import math

import numpy as np

from evplace_lab.city.jit import compiled

Colour = tuple[float, float, float]
"""Linear red, green, blue: a reflectance, or a radiance in units of a sunlit white wall."""


@compiled
def hash01(x: int, y: int, seed: int) -> float:
    """A number in [0, 1) that looks random and depends on the three integers only."""
    h = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) ^ np.uint64(y) * np.uint64(0xC2B2AE3D27D4EB4F)
    h ^= np.uint64(seed) * np.uint64(0x165667B19E3779F9)
    h = (h ^ (h >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    h = (h ^ (h >> np.uint64(32))) * np.uint64(0xD6E8FEB86659FD93)
    return float(h >> np.uint64(40)) / 16777216.0


@compiled
def smoothstep(low: float, high: float, x: float) -> float:
    """0 at `low`, 1 at `high`, smooth between; the ends may be given in either order."""
    t = min(max((x - low) / (high - low), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)


@compiled
def noise(x: float, y: float, seed: int) -> float:
    """Smooth noise in [0, 1) with features one unit wide."""
    left = math.floor(x)
    low = math.floor(y)
    i = int(left)
    j = int(low)
    u = x - left
    v = y - low
    u = u * u * (3.0 - 2.0 * u)
    v = v * v * (3.0 - 2.0 * v)
    a = hash01(i, j, seed)
    b = hash01(i + 1, j, seed)
    c = hash01(i, j + 1, seed)
    d = hash01(i + 1, j + 1, seed)
    return a + (b - a) * u + (c - a) * v + (a - b - c + d) * u * v


@compiled
def _pulse_area(x: float, start: float, width: float) -> float:
    """The integral up to `x` of pulses of unit period on [start, start + width]."""
    whole = math.floor(x)
    return whole * width + min(max(x - whole - start, 0.0), width)


@compiled
def pulse(x: float, footprint: float, start: float, width: float) -> float:
    """How much of [x - footprint / 2, x + footprint / 2] unit-period pulses cover."""
    f = max(footprint, 1e-4)
    return (_pulse_area(x + 0.5 * f, start, width) - _pulse_area(x - 0.5 * f, start, width)) / f


@compiled
def band(x: float, footprint: float, low: float, high: float) -> float:
    """How much of [x - footprint / 2, x + footprint / 2] lies in [low, high]."""
    f = max(footprint, 1e-4)
    return max(min(x + 0.5 * f, high) - max(x - 0.5 * f, low), 0.0) / f


@compiled
def mix(a: Colour, b: Colour, share: float) -> Colour:
    """`a` with `share` of it replaced by `b`."""
    return (a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share, a[2] + (b[2] - a[2]) * share)


@compiled
def scale(a: Colour, k: float) -> Colour:
    """`a` times `k`."""
    return (a[0] * k, a[1] * k, a[2] * k)


@compiled
def plus(a: Colour, b: Colour) -> Colour:
    """The sum of two colours."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled
def times(a: Colour, b: Colour) -> Colour:
    """A reflectance under a light: the product of two colours."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2])


@compiled
def sample(grid: np.ndarray, x: float, y: float) -> float:
    """`grid` (rows, columns) at column `x`, row `y` between its cell centres; its edge value outside."""
    rows, columns = grid.shape
    x = min(max(x - 0.5, 0.0), columns - 1.001)
    y = min(max(y - 0.5, 0.0), rows - 1.001)
    i = int(x)
    j = int(y)
    u = x - i
    v = y - j
    low = grid[j, i] * (1.0 - u) + grid[j, i + 1] * u
    high = grid[j + 1, i] * (1.0 - u) + grid[j + 1, i + 1] * u
    return float(low * (1.0 - v) + high * v)
