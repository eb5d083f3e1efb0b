"""Traffic lights: when each is red, in one drive."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.town import Town

CYCLE_S = 24.0
RED_S = 7.0
"""Long enough to see cars cross, short enough that a drive stands still for a small part of its time."""
LEVELS = (0.02, 3.0)
"""Brightness of a light that is off and on, by day and by night alike."""


class Signals:
    """The lights of a town; each drive finds them at other points of their cycles."""

    def __init__(self, town: Town, rng: np.random.Generator) -> None:
        self._rows = town.signals
        crossings = sorted({(int(i), int(j)) for i, j in town.signals[:, :2]})
        self._start = {crossing: float(rng.uniform(0, CYCLE_S)) for crossing in crossings}

    def red(self, crossing: tuple[int, int], axis: int, seconds: float) -> bool:
        """Whether cars along an axis (0: x, 1: y) must wait; False where there are no lights."""
        return crossing in self._start and self._phase(crossing, axis, seconds) < RED_S

    def until_green(self, crossing: tuple[int, int], axis: int, seconds: float) -> float:
        """Seconds until the light of an axis turns green, 0 where it is."""
        if not self.red(crossing, axis, seconds):
            return 0.0
        return RED_S - self._phase(crossing, axis, seconds)

    def show(self, look: NDArray[np.float64], seconds: float) -> None:
        """Switch the primitives of all lights, in a frame's own copy of the looks."""
        for i, j, axis, red, green in self._rows:
            stop = self.red((int(i), int(j)), int(axis), seconds)
            look[red, 3:5] = LEVELS[int(stop)]
            look[green, 3:5] = LEVELS[int(not stop)]

    def _phase(self, crossing: tuple[int, int], axis: int, seconds: float) -> float:
        """Seconds since the axis's light last turned red; the two axes are half a cycle apart."""
        return (seconds + self._start[crossing] + axis * CYCLE_S / 2) % CYCLE_S
