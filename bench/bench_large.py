"""Memory of drives through maps that no memory holds: python bench/bench_large.py [--queries 2000 6000]

100,000 references. Paths: what `path` needs beyond 256 MiB a table lies in a file: the peak does not grow
with the queries; the file does, by 6 bytes a cell: 60 GB for 100,000 queries.

    python bench/bench_large.py --evaluate best bayes --queries 100000 --seconds 300

`evaluate` keeps no rows. With --seconds it stops after so many, as if it were killed, and goes on where it
was when it is called again (exit code 4 until it is done).
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from evplace.evaluation._evaluate import evaluate
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers import open_matcher
from evplace.placemap import train
from evplace.places import PlaceGrid
from evplace.sources.tracks import Track

ITEMS, BLOCK = 100_000, 64
TO_BE_GONE_ON_WITH = 4


def peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def through(name: str, queries: int) -> None:
    """Print what a path through so many queries needs."""
    rng, matching, began = np.random.default_rng(0), open_matcher(name), time.process_time()
    for start in range(0, queries, BLOCK):
        many = min(BLOCK, queries - start)
        rows = rng.random((many, ITEMS), np.float32) * 0.5 + 0.05
        rows[np.arange(many), start + np.arange(many)] = 0.995
        matching.extend(rows)
    right = (matching.path().item == np.arange(queries)).mean()
    took = time.process_time() - began
    print(
        f"{name}: {queries} x {ITEMS}, {right:.1%} right, peak {peak_mib():.0f} MiB, {took:.0f} s", flush=True
    )


def drives(queries: int) -> tuple[Traverse, Traverse]:
    """A road of 100 km with an image a metre, and its first `queries` images again, with noise."""
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (ITEMS, 8, 8), dtype=np.uint8)
    t_us = np.arange(ITEMS, dtype=np.int64) * 100_000
    xy = np.column_stack([np.arange(ITEMS, dtype=np.float64), np.zeros(ITEMS)])
    counts, east = np.full(ITEMS, 100), np.full(ITEMS, 90.0)
    noisy = np.clip(images[:queries] + rng.normal(0, 60, (queries, 8, 8)), 0, 255).astype(np.uint8)
    track = Track.local(t_us[:queries], xy[:queries] + np.array([0.0, 0.5]), east[:queries])
    reference = Traverse(images, t_us, counts, track=Track.local(t_us, xy, east))
    return reference, Traverse(noisy, t_us[:queries], counts[:queries], track=track)


def judge(name: str, queries: int, seconds: float, folder: Path) -> int:
    """Print what an evaluation needs; TO_BE_GONE_ON_WITH where its time was over."""
    reference, query = drives(queries)
    assert reference.track is not None
    where = Localizer(train(reference, PlaceGrid.from_track(reference.track), "sad", matcher="best"), name)
    began, first = time.monotonic(), [-1]

    def progress(done: int, total: int, _: str) -> None:
        first[0] = done if first[0] < 0 else first[0]
        if time.monotonic() - began > seconds:
            print(f"{name}: from {first[0]} to {done} of {total}, peak {peak_mib():.0f} MiB", flush=True)
            sys.exit(TO_BE_GONE_ON_WITH)

    result = evaluate(where, query, progress=progress, checkpoint=folder / f"{name}-{queries}.checkpoint")
    shown = ", ".join(f"{key} {result.figures[key]:.4f}" for key in ("accuracy", "recall@1", "recall@20"))
    print(
        f"{name}: {queries} x {ITEMS} evaluated, {shown}; the last piece from {first[0]}; peak "
        f"{peak_mib():.0f} MiB, {time.process_time():.0f} s of CPU in it, {result.took_s:.0f} s in all",
        flush=True,
    )
    return 0


def main() -> int:
    """Each drive in a process of its own."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--queries", type=int, nargs="+", default=[2000, 6000])
    flags.add_argument("--matchers", nargs="+", default=["hmm", "dp", "graph", "seqslam"])
    flags.add_argument(
        "--evaluate", nargs="+", default=[], help="matchers whose answers are evaluated instead"
    )
    flags.add_argument("--seconds", type=float, default=float("inf"), help="stop an evaluation after so many")
    flags.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()), help="for what it keeps")
    flags.add_argument("--here", action="store_true", help="in this process")
    args = flags.parse_args()
    for name in args.evaluate or args.matchers:
        for queries in args.queries:
            if args.here and args.evaluate:
                return judge(name, queries, args.seconds, args.folder)
            if args.here:
                through(name, queries)
                continue
            which = ["--evaluate" if args.evaluate else "--matchers", name, "--queries", str(queries)]
            again = ["--here", *which, "--seconds", str(args.seconds), "--folder", str(args.folder)]
            code = subprocess.run([sys.executable, __file__, *again]).returncode
            if code:
                return code
    return 0


if __name__ == "__main__":
    sys.exit(main())
