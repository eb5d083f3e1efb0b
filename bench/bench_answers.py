"""CPU time from a window's end to its Match, each scorer with its default matcher.

    OPENBLAS_NUM_THREADS=1 python bench/bench_answers.py [--references 10000]

10,000 references of 160x90, a 640x480 sensor; the network has 1,000 places of ten of them each. The window is
closed by `tick`, so its image is in the time, too. The network reads 74 MB an image, edges 88, sad 144 and
cosine 576.
"""

from __future__ import annotations

import argparse
import platform
import time

import numpy as np

from best_cost import street
from evplace import Events, Localizer, PlaceGrid, PlaceRuns, Track, Traverse, train
from evplace.imaging.recipe import Recipe

SCORERS = ("fused", "edges", "trained", "ncc", "seqslam", "sad", "network", "cosine")
RATE, EVENTS, SENSOR = 30, 57_000, (640, 480)


def drive(many: int) -> Traverse:
    """Images that slide past, a reference in two metres and a fifth of a second."""
    t_us = np.arange(many, dtype=np.int64) * 200_000
    xy = np.stack([500_000 + 2.0 * np.arange(many), np.full(many, 4e6)], axis=1)
    track = Track.local(t_us, xy, np.full(many, 90.0))
    images = np.ascontiguousarray(street(many, 0))
    return Traverse(images, t_us, np.full(many, 5000), track, Recipe("events", SENSOR))


def end_of(number: int) -> int:
    """When a window is over, in microseconds."""
    return -(-(number + 1) * 1_000_000 // RATE)


def window(number: int) -> Events:
    """Generated events at random pixels."""
    rng = np.random.default_rng(number)
    t_us = np.sort(rng.integers(end_of(number - 1), end_of(number), EVENTS))
    t_us[0] = end_of(number - 1)
    x, y = rng.integers(0, SENSOR[0], EVENTS), rng.integers(0, SENSOR[1], EVENTS)
    return Events.of(t_us, x, y, rng.integers(0, 2, EVENTS), SENSOR)


def main() -> None:
    """Print a line for each scorer."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--references", type=int, default=10_000)
    flags.add_argument("--windows", type=int, default=300)
    flags.add_argument("--scorers", nargs="+", default=SCORERS)
    args = flags.parse_args()
    print(platform.processor() or platform.machine(), f"{args.references} references; ms: p10, p50, p90, p99")
    day = drive(args.references)
    for scorer in args.scorers:
        more = {"steps": 1} if scorer == "network" else {}
        places = PlaceRuns(args.references, 10) if scorer == "network" else PlaceGrid.from_track(day.track)
        where = Localizer(train(day, places, scorer, **more))
        took = []
        for number in range(args.windows):
            list(where.push(window(number)))
            began = time.thread_time()
            found = list(where.tick(end_of(number)))
            took.append(1000 * (time.thread_time() - began))
            assert number == 0 or len(found) == 1, found
        shown = " ".join(f"{ms:.2f}" for ms in np.quantile(took[20:], (0.1, 0.5, 0.9, 0.99)))
        print(f"{scorer:8} and {where.settings['name']:6}: {shown}", flush=True)


if __name__ == "__main__":
    main()
