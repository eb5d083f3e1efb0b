"""Timing in alternation: each round runs every function once, so that a busy machine hurts all alike."""

from __future__ import annotations

import gc
import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

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
    """CPU time (all threads, child processes too) of each, after one unmeasured round that compiles."""
    taken: dict[str, list[float]] = {name: [] for name in functions}
    for measured in [False] + [True] * rounds:
        for name, function in functions.items():
            gc.collect()
            start = cpu_seconds()
            function()
            if measured:
                taken[name].append(cpu_seconds() - start)
    return {name: Timing(tuple(seconds)) for name, seconds in taken.items()}


def cpu_seconds() -> float:
    """CPU seconds of this process, and of its children that have ended."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system


def processor() -> str:
    """The name of this machine's processor, as Linux says it, else as Python does."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = {line.partition(":")[2].strip() for line in lines if line.startswith("model name")}
    return ", ".join(sorted(names)) or platform.machine()


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
