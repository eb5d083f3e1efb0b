"""The author's published notebook, its whole recipe, on the benchmark: SGD, 1000 epochs, dropout and batch
statistics while answering.

    python bench/notebook.py CITY OUT [--seeds 3] [--sensor ideal]

Trains a map of the city's day-1 for each seed and keeps it in OUT; a training that was stopped goes on. On a
core a training takes about 50 minutes, on a GPU (NVIDIA H200) that others shared 5.6. Accuracies are those
of the paper's rule for a query's whole drive at once, since the statistics are those of all its images.
"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path

import numpy as np

from evplace import Localizer, PlaceGrid, PlaceMap, Traverse, evaluate, train
from evplace.scorers import Learning
from evplace.scorers.network import Network
from evplace.scorers.notebook import Notebook

QUERIES = ("night-1", "rain-1", "day-2", "night-2", "rain-2")
WAYS = {
    "as it is trained": None,
    "statistics of the queries": Notebook(batch_statistics=True, dropout=0.0),
    "and dropout": Notebook(),
}


def trained(day: Traverse, out: Path, seed: int) -> PlaceMap:
    """The map of one seed, read where it is there."""
    file = out / f"notebook-{seed}.evp"
    if not file.exists():
        how = dataclasses.replace(Network.presets["notebook"], seed=seed)
        learning = Learning(checkpoint=out / f"notebook-{seed}.checkpoint")
        train(day, PlaceGrid.from_track(day.track), how, learning=learning).save(file)
    return PlaceMap.load(file)


def main() -> None:
    """Print a line for each way of answering and query."""
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("city", type=Path)
    flags.add_argument("out", type=Path)
    flags.add_argument("--seeds", type=int, default=3)
    flags.add_argument("--sensor", default="ideal")
    args = flags.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    day = Traverse.load(args.city / "day-1" / args.sensor)
    maps = [trained(day, args.out, seed) for seed in range(args.seeds)]
    for way, scorer in WAYS.items():
        for query in QUERIES:
            drive = Traverse.load(args.city / query / args.sensor)
            found = []
            for place_map in maps:
                asked = place_map if scorer is None else dataclasses.replace(place_map, scorer=scorer)
                where = Localizer(asked, "best")
                found.append(100 * evaluate(where, drive, answers="hindsight").figures["accuracy"])
            print(f"{way}, {query}: {np.mean(found):.1f} ± {np.std(found, ddof=1):.1f}", flush=True)


if __name__ == "__main__":
    main()
