"""Timing in alternation: each round runs every function once, so that a busy machine hurts all alike."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Timing:
    """CPU seconds of one function over all rounds."""

    seconds: tuple[float, ...]

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))

    @property
    def spread(self) -> tuple[float, float]:
        """Least and most."""
        return min(self.seconds), max(self.seconds)


def alternate(functions: dict[str, Callable[[], object]], rounds: int = 5) -> dict[str, Timing]:
    """CPU time (all threads) of each function, after one unmeasured round that compiles and warms."""
    taken: dict[str, list[float]] = {name: [] for name in functions}
    for measured in [False] + [True] * rounds:
        for name, function in functions.items():
            gc.collect()
            start = time.process_time()
            function()
            if measured:
                taken[name].append(time.process_time() - start)
    return {name: Timing(tuple(seconds)) for name, seconds in taken.items()}


def report(title: str, timings: dict[str, Timing], unit: float = 1.0, unit_name: str = "s") -> None:
    """One line a function: median, spread, and its time over the first one's, round by round."""
    print(title)
    base = next(iter(timings.values()))
    for name, timing in timings.items():
        low, high = timing.spread
        ratios = [other / ours for other, ours in zip(timing.seconds, base.seconds, strict=True)]
        print(
            f"  {name:<34} {timing.median / unit:9.4g} {unit_name}  ({low / unit:.4g} to {high / unit:.4g})"
            f"  x{np.median(ratios):.3g} ({min(ratios):.3g} to {max(ratios):.3g})"
        )
