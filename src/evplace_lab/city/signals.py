"""Traffic lights: when each is red, in one drive."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.town import Town

CYCLE_S = 24.0
RED_S = 7.0
"""Long enough to see cars cross, short enough that a drive stands still for a small part of its time."""
LEVELS = (0.02, 3.0)
"""Brightness of a light that is off and on, by day and by night alike."""

Value = TypeVar("Value", float, NDArray[Any])


class Signals:
    """The lights of a town; each drive finds them at other points of their cycles."""

    def __init__(self, town: Town, rng: np.random.Generator) -> None:
        self._rows = town.signals
        crossings = sorted({(int(i), int(j)) for i, j in town.signals[:, :2]})
        self._start = {crossing: float(rng.uniform(0, CYCLE_S)) for crossing in crossings}
        self._starts = np.array([self._start[int(i), int(j)] for i, j in town.signals[:, :2]])

    def red(self, crossing: tuple[int, int], axis: int, seconds: float) -> bool:
        """Whether cars along an axis (0: x, 1: y) must wait; False where there are no lights."""
        return crossing in self._start and _phase(self._start[crossing], axis, seconds) < RED_S

    def until_green(self, crossing: tuple[int, int], axis: int, seconds: float) -> float:
        """Seconds until the light of an axis turns green, 0 where it is."""
        if not self.red(crossing, axis, seconds):
            return 0.0
        return RED_S - _phase(self._start[crossing], axis, seconds)

    def show(self, look: NDArray[np.float64], seconds: float) -> None:
        """Switch the primitives of all lights, in a frame's own copy of the looks."""
        axis, red, green = self._rows[:, 2:].T
        stop = _phase(self._starts, axis, seconds)[:, None] < RED_S
        off, on = LEVELS
        look[red, 3:5] = np.where(stop, on, off)
        look[green, 3:5] = np.where(stop, off, on)


def _phase(start: Value, axis: Value, seconds: float) -> Value:
    """Seconds since an axis's light last turned red; the two axes are half a cycle apart."""
    return (seconds + start + axis * CYCLE_S / 2) % CYCLE_S
