"""Memory of a live drive of a day, hour by hour, for each matcher: python bench/bench_day.py [--rate 30]

Against 10,000 references. The clock is simulated: a day at 30 Hz is 2.6 million steps, which take an hour or so;
at a lower rate an hour has fewer of them. What is counted is what Python, numpy and numba have asked for.
"""

from __future__ import annotations

import argparse
import gc
import math
import time
import tracemalloc

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
    steps = math.ceil(3600 * rate)
    for query in range(start, start + steps):
        matching.step(table[query % PLAYED], Seen(int(query * 1e6 / rate), 50.0))
    return start + steps


def main() -> None:
    """Print a line for each matcher."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--rate", type=float, default=1.0, help="images a second")
    flags.add_argument("--matchers", nargs="+", default=families.names("matchers"))
    args = flags.parse_args()
    table = rows()
    for name in args.matchers:
        began, query, held = time.process_time(), 0, []
        gc.collect()
        tracemalloc.start()
        matching = follow(families.make("matchers", name, None, {}), route(), distances=False)
        for _ in range(HOURS):
            query = hour(matching, table, query, args.rate)
            held.append(tracemalloc.get_traced_memory()[0] / 1e6)
        tracemalloc.stop()
        shown = " ".join(f"{mb:.1f}" for mb in held)
        print(
            f"{name}: {query} steps, MB by hour: {shown}; last over second {held[-1] / held[1]:.3f}", end=""
        )
        print(f" ({time.process_time() - began:.0f} s)", flush=True)


if __name__ == "__main__":
    main()
