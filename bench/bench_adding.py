"""What adding a drive costs, by the size of the map: python bench/bench_adding.py [--items 10000 100000]

The map is made up: streets side by side, a reference every 2 m, images and vectors drawn at random. A drive
of 2,000 references comes to it along the last of them, half of it beyond what is known. Seconds of CPU of
this process, and of the clock.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np

from evplace import PlaceGrid, Recipe, Track, Traverse, train
from evplace.placemap import Items, PlaceMap, add
from evplace.scorers import REFERENCES

STREET_M, APART_M, STEP_M = 5000.0, 40.0, 2.0
T = TypeVar("T")


def road(first: int, many: int, north_m: float = 0.0) -> Track:
    """Places `first` and on, along streets side by side, all driven eastward."""
    at = STEP_M * np.arange(first, first + many)
    xy = np.stack([500_000 + at % STREET_M, 4_000_000 + north_m + APART_M * (at // STREET_M)], axis=1)
    return Track.local(100_000 * np.arange(first, first + many), xy, np.full(many, 90.0))


def drive(first: int, many: int, seed: int) -> Traverse:
    """Images drawn at random, each a little like the one before."""
    rng, track = np.random.default_rng(seed), road(first, many, 1.0)
    street = (rng.random((90, 160 + 8 * many)) < 0.17).astype(np.uint8) * 255
    images = np.stack([street[:, 8 * n : 8 * n + 160] for n in range(many)])
    return Traverse(images, track.t_us, np.full(many, 9), track, Recipe("events", (160, 120)))


def made(items: int) -> PlaceMap:
    """A map of one drive of so many references."""
    few = drive(0, 500, 0)
    assert few.track is not None
    small = train(few, PlaceGrid.from_track(few.track))
    track, rng = road(0, items), np.random.default_rng(1)
    places = PlaceGrid.from_track(track)
    content = dict(small.content)
    content[REFERENCES] = np.resize(np.asarray(small.references), (items, *small.image_shape))
    for name in ("edges_vectors", "trained_vectors"):
        own = np.asarray(content[name])
        content[name] = (own.std(axis=0) * rng.standard_normal((items, own.shape[1]))).astype(np.float32)
    return PlaceMap(
        small.scorer, places,
        Items(places.label(track.xy), track.xy, track.heading_deg, t_us=track.t_us),
        np.column_stack([track.xy, track.heading_deg]), content, small.image_shape, small.recipe,
        (track.zone, track.northern), matcher=small.matcher, learned=small.learned,
    )  # fmt: skip


def timed(what: str, do: Callable[[], T], total: list[float]) -> T:
    """What it gives; what it took is printed."""
    cpu, wall = time.process_time(), time.monotonic()
    made_of_it = do()
    took = time.process_time() - cpu, time.monotonic() - wall
    total.append(took[0])
    print(f"  {what:32} {took[0]:7.2f} s of CPU, {took[1]:7.2f} s", flush=True)
    return made_of_it


def main() -> None:
    """A map of each size in turn."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--items", nargs="+", type=int, default=[10_000, 100_000])
    flags.add_argument("--added", type=int, default=2000)
    args = flags.parse_args()
    for items in args.items:
        with tempfile.TemporaryDirectory() as folder:
            path, total = Path(folder) / "map", list[float]()
            made(items).save(path)
            new = drive(items - args.added // 2, args.added, 2)
            print(f"{args.added:,} references to {items:,}")
            place_map = timed("open the map", lambda: PlaceMap.load(path), total)  # noqa: B023
            grown = timed("add the drive", lambda: add(place_map, new), total)  # noqa: B023
            timed("write it", lambda: grown.save(path, overwrite=True), total)  # noqa: B023
            print(f"  {'together':32} {sum(total):7.2f} s of CPU", flush=True)


if __name__ == "__main__":
    main()
