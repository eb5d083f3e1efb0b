"""Curved streets and slopes: one smooth map from the drawing board (a straight grid) to the world.

Each world coordinate is a function of x plus a function of y. Its mixed derivative is zero, so a
rectangle of the drawing board becomes a parallelogram and ground tiles meet without cracks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Wave:
    """amplitude * sin(2 pi u / length + phase), in metres."""

    amplitude: float
    length: float
    phase: float

    def __call__(self, u: Points | float) -> Points:
        """The value at `u`."""
        return np.asarray(self.amplitude * np.sin(2 * math.pi * np.asarray(u) / self.length + self.phase))

    def slope(self, u: Points | float) -> Points:
        """The derivative at `u`."""
        k = 2 * math.pi / self.length
        return np.asarray(self.amplitude * k * np.cos(k * np.asarray(u) + self.phase))


@dataclass(frozen=True)
class Terrain:
    """How the drawing board is bent: streets along y sway by `east`, streets along x by `north`."""

    east: Wave
    north: Wave
    hill_x: Wave
    hill_y: Wave

    @classmethod
    def of(cls, rng: np.random.Generator) -> Terrain:
        """Streets that turn by up to about 11 degrees and climb by up to about 6 per cent."""
        turn = 2 * math.pi
        return cls(
            Wave(rng.uniform(5, 7), rng.uniform(210, 250), rng.uniform(0, turn)),
            Wave(rng.uniform(5, 7), rng.uniform(210, 250), rng.uniform(0, turn)),
            Wave(rng.uniform(1.5, 2.5), rng.uniform(230, 300), rng.uniform(0, turn)),
            Wave(rng.uniform(1.5, 2.5), rng.uniform(230, 300), rng.uniform(0, turn)),
        )

    def world(self, x: ArrayLike, y: ArrayLike, lift: float = 0.0) -> Points:
        """(..., 3) world positions, `lift` metres above the ground at drawing-board positions."""
        u, v = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        return np.stack([u + self.east(v), v + self.north(u), self.hill_x(u) + self.hill_y(v) + lift], -1)

    def heading(self, x: float, y: float, angle: float) -> float:
        """The world direction of a drawing-board direction at a point, radians."""
        c, s = math.cos(angle), math.sin(angle)
        return math.atan2(s + float(self.north.slope(x)) * c, c + float(self.east.slope(y)) * s)
