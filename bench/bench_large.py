"""Memory of paths through tables that no memory holds: python bench/bench_large.py [--queries 2000 6000]

100,000 references. What `path` needs beyond 256 MiB a table lies in a file: the peak does not grow with the
queries; the file does, by 6 bytes a cell: 60 GB for 100,000 queries.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import time

import numpy as np

from evplace.matchers import open_matcher

ITEMS, BLOCK = 100_000, 64


def through(name: str, queries: int) -> None:
    """Print what a path through so many queries needs."""
    rng, matching, began = np.random.default_rng(0), open_matcher(name), time.process_time()
    for start in range(0, queries, BLOCK):
        many = min(BLOCK, queries - start)
        rows = rng.random((many, ITEMS), np.float32) * 0.5 + 0.05
        rows[np.arange(many), start + np.arange(many)] = 0.995
        matching.extend(rows)
    right = (matching.path().item == np.arange(queries)).mean()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    took = time.process_time() - began
    print(f"{name}: {queries} x {ITEMS}, {right:.1%} right, peak {peak:.0f} MiB, {took:.0f} s", flush=True)


def main() -> None:
    """Each path in a process of its own."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--queries", type=int, nargs="+", default=[2000, 6000])
    flags.add_argument("--matchers", nargs="+", default=["hmm", "dp", "graph", "seqslam"])
    flags.add_argument("--here", action="store_true", help="in this process")
    args = flags.parse_args()
    for name in args.matchers:
        for queries in args.queries:
            if args.here:
                through(name, queries)
            else:
                again = ["--here", "--matchers", name, "--queries", str(queries)]
                subprocess.run([sys.executable, __file__, *again], check=True)


if __name__ == "__main__":
    main()
