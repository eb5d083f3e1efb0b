"""Frames of the city a second of CPU: python bench/bench_city.py [--before CHECKOUT]

Whole drives at 160x120 with three sensors, as the benchmark is made: rendering, events, images, writing. The
time before the first image, which builds the town, is left out. With another checkout, both make the same
drives in alternation.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from evplace_lab.city.plan import CitySettings
from evplace_lab.city.recording import record_drive
from evplace_lab.city.town import build_town
from harness import Timing, processor, report

CONDITIONS = ("day", "night", "rain", "dusk")
LENGTH_M = 100.0
ROUNDS = 3


def seconds_a_frame(name: str) -> float:
    """CPU seconds of a frame from the first image of a drive to its last."""
    settings, ticks = CitySettings(route_length_m=LENGTH_M), list[float]()
    with tempfile.TemporaryDirectory() as folder:
        town = build_town(settings.seed)
        record_drive(Path(folder), town, settings, name, 1, lambda _: ticks.append(time.process_time()))
    every = settings.fps // settings.image_hz
    return (ticks[-1] - ticks[0]) / (len(ticks) - 1) / every


def measured(checkout: Path, name: str) -> float:
    """The same in a process that takes the package from a checkout."""
    environment = {**os.environ, "PYTHONPATH": str(checkout / "src"), "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, __file__, "--drive", name]
    return float(subprocess.run(command, env=environment, capture_output=True, check=True, text=True).stdout)


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--before", type=Path, help="another checkout, measured in alternation")
    parser.add_argument("--drive", choices=CONDITIONS, help="this drive alone, in this process")
    args = parser.parse_args()
    if args.drive:
        print(seconds_a_frame(args.drive))
        return
    checkouts = {"now": Path(__file__).resolve().parents[1]}
    if args.before:
        checkouts["before"] = args.before
    print(processor(), "load", *os.getloadavg())
    for name in CONDITIONS:
        taken: dict[str, list[float]] = {which: [] for which in checkouts}
        for is_measured in [False] + [True] * ROUNDS:
            for which, checkout in checkouts.items():
                seconds = measured(checkout, name)
                taken[which] += [seconds] * is_measured
        timings = {which: Timing(tuple(seconds)) for which, seconds in taken.items()}
        report(
            f"{name}: {1 / timings['now'].median:.0f} frames a second, CPU time a frame", timings, 1e-3, "ms"
        )


if __name__ == "__main__":
    main()
