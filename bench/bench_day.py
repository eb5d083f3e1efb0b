"""Memory of a live drive of a day, hour by hour, for each matcher: python bench/bench_day.py [--rate 30]

Against 10,000 references, by a simulated clock. A day at 30 Hz is 2.6 million steps, up to an hour of CPU;
at a lower rate an hour has fewer. Memory is all that the process holds (Linux). Without matchers named,
each runs in a process of its own.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from evplace.core import families
from evplace.matchers import Following, Route, Seen
from evplace.matchers._drives import follow

HOURS, ITEMS, PLAYED = 24, 10_000, 500


def route() -> Route:
    """A straight road, an item a metre."""
    position = np.stack([500_000 + np.arange(ITEMS, dtype=np.float64), np.full(ITEMS, 4e6)], axis=1)
    return Route(position, np.full(ITEMS, 90.0), np.arange(ITEMS, dtype=np.int64) * 100_000, content=50.0)


def rows() -> np.ndarray:
    """(PLAYED, items) score rows, which are played again and again: a short stretch of the road."""
    table = np.random.default_rng(0).uniform(0.1, 0.5, (PLAYED, ITEMS)).astype(np.float32)
    table[np.arange(PLAYED), 1000 + np.arange(PLAYED)] = 0.995
    return table


def hour(matching: Following, table: np.ndarray, start: int, rate: float) -> int:
    """Step for an hour; the number of the next query."""
    end = start + math.ceil(3600 * rate)
    for query in range(start, end):
        matching.step(table[query % PLAYED], Seen(int(query * 1e6 / rate), 50.0))
    return end


def held_mb() -> float:
    """What this process holds."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def day(name: str, rate: float) -> None:
    """Print a line."""
    began, query, held = time.process_time(), 0, []
    matching, table = follow(families.make("matchers", name, None, {}), route(), distances=False), rows()
    for _ in range(HOURS):
        query = hour(matching, table, query, rate)
        held.append(held_mb())
    shown = " ".join(f"{mb:.0f}" for mb in held)
    took = time.process_time() - began
    print(f"{name}: {query} steps ({took:.0f} s), last hour / second {held[-1] / held[1]:.3f}; MB: {shown}")


def main() -> None:
    """One matcher after another."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--rate", type=float, default=5.0, help="images a second")
    flags.add_argument("--matchers", nargs="+", default=[])
    args = flags.parse_args()
    for name in args.matchers:
        day(name, args.rate)
    for name in [] if args.matchers else families.names("matchers"):
        subprocess.run([sys.executable, __file__, "--rate", str(args.rate), "--matchers", name], check=True)


if __name__ == "__main__":
    main()
