"""CPU time of the default for one image: descriptors, comparison with all references, filter.

    python bench/best_cost.py [--references 1000 10000]

References are pictures of random blocks; nothing depends on what they show but the time that the filter takes
where it is sure of nothing, which is the longest.
"""

from __future__ import annotations

import argparse
import platform
import time

import numpy as np

from evplace import Localizer, PlaceGrid, Track, Traverse, train
from evplace.imaging.recipe import Recipe

REPEATS = 200


def street(images: int, seed: int) -> np.ndarray:
    """(images, 90, 160) pictures that slide past, a new column an image."""
    rng = np.random.default_rng(seed)
    wide = np.repeat(np.repeat(rng.integers(0, 120, (18, (images + 160) // 4 + 1)), 5, 0), 4, 1).astype(
        np.uint8
    )
    return np.lib.stride_tricks.sliding_window_view(wide, 160, axis=1)[:, :images].transpose(1, 0, 2)


def main() -> None:
    """Print a line for each number of references."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--references", type=int, nargs="+", default=[1000, 10000])
    print(platform.processor() or platform.machine(), "ms of CPU an image: median, 10 to 90 %; map: s of CPU")
    for many in flags.parse_args().references:
        images = np.ascontiguousarray(street(many, 0))
        t_us = np.arange(many, dtype=np.int64) * 200_000
        xy = np.stack([500_000 + 2.0 * np.arange(many), np.full(many, 4e6)], axis=1)
        track = Track.local(t_us, xy, np.full(many, 90.0))
        day = Traverse(images, t_us, np.full(many, 5000), track, Recipe("events", (160, 90)))
        began = time.process_time()
        where = Localizer(train(day, PlaceGrid.from_track(track)))
        learned = time.process_time() - began
        took = []
        for at in range(REPEATS):
            began = time.process_time()
            list(where.push_image(images[at % many], at * 100_000))
            took.append(1000 * (time.process_time() - began))
        low, middle, high = np.quantile(took[20:], (0.1, 0.5, 0.9))
        print(
            f"{many:7} references: {middle:.2f} ({low:.2f} to {high:.2f}) ms; map {learned:.1f} s", flush=True
        )


if __name__ == "__main__":
    main()
