"""The paper's effect on the virtual city: the network of Table 1 and the blurred correlation, by global-max.

    evplace city -o city                                   the benchmark city, about ten minutes
    python bench/city_table.py --city city --seeds 3 --out city-table

The map is day-1. Accuracy in %, by the paper's rule (a cell or one of its eight neighbours; an image of a
place that the map lacks counts as wrong here, since global-max never says so). Mean and standard deviation
over the seeds. Nothing in the city or the sensors was changed after the first accuracy was seen. Finished
rows are kept in --out and not made again.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from evplace.localizer import Localizer
from evplace.places import PlaceGrid
from evplace.training import PRESETS, train
from evplace.traverse import Traverse
from evplace.trial import evaluate

INPUTS = ("colour", "ideal", "from-8bit", "weak")
QUERIES = ("night-1", "rain-1", "day-2", "night-2", "rain-2")
PAPER = {"night-1": (85.8, 3.4), "rain-1": (75.4, 31.4), "day-2": (55.6, 34.1), "night-2": (46.0, 0.6),
         "rain-2": (33.3, 19.8)}  # fmt: skip
"""Table 2 of the paper, global-max: events, colour."""
CORRELATION = -1
"""In place of a seed: no training."""


def row(city: Path, name: str, seed: int) -> dict[str, list[float]]:
    """Query -> accuracy over all, over the seen, and chance over the seen, in %."""
    day = Traverse.load(city / "day-1" / name)
    assert day.track is not None
    places = PlaceGrid.from_track(day.track)
    if seed == CORRELATION:
        learned = train(day, places, "ncc")
    else:
        learned = train(day, places, settings=PRESETS["paper"], seed=seed)
    figures = {}
    for query in QUERIES:
        found = evaluate(Localizer(learned, "best"), Traverse.load(city / query / name)).figures
        figures[query] = [100 * found[key] for key in ("accuracy", "accuracy_seen", "chance_seen")]
    return figures


def kept_row(arguments: tuple[Path, Path, str, int]) -> dict[str, list[float]]:
    """A row from its file, or made and kept."""
    city, out, name, seed = arguments
    file = out / f"{name}-{'correlation' if seed == CORRELATION else seed}.json"
    if not file.exists():
        import torch

        torch.set_num_threads(1)
        figures = row(city, name, seed)
        file.write_text(json.dumps(figures))
    found: dict[str, list[float]] = json.loads(file.read_text())
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--city", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", type=int, default=3)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    seeds = [CORRELATION, *range(arguments.seeds)]
    work = [(arguments.city, arguments.out, name, seed) for seed, name in itertools.product(seeds, INPUTS)]
    with ProcessPoolExecutor(os.cpu_count(), mp_context=get_context("spawn")) as pool:
        rows = dict(zip([item[2:] for item in work], pool.map(kept_row, work), strict=True))
    for part, column in (("all images", 0), ("seen images only", 1)):
        print(f"accuracy in %, {part}: network / blurred correlation")
        print(f"  {'query':<9}" + "".join(f"{name:>24}" for name in INPUTS) + "   paper: events, colour")
        for query in QUERIES:
            cells = []
            for name in INPUTS:
                trained = [rows[name, seed][query][column] for seed in range(arguments.seeds)]
                spread = np.std(trained, ddof=1) if len(trained) > 1 else float("nan")
                plain = rows[name, CORRELATION][query][column]
                cells.append(f"{np.mean(trained):5.1f} +- {spread:4.1f} / {plain:5.1f}")
            paper = "   {:.1f}, {:.1f}".format(*PAPER[query]) if column == 0 else ""
            print(f"  {query:<9}" + "".join(f"{cell:>24}" for cell in cells) + paper)
    chance = rows["ideal", CORRELATION]
    print("chance, seen images: " + ", ".join(f"{query} {chance[query][2]:.1f}" for query in QUERIES))


if __name__ == "__main__":
    main()
