"""LENS's two real drives: recall@1 for each scorer and matcher, exact and within 2 frames.

    EVPLACE_DATA=/path/to/data python bench/real_traverses.py [--seeds 3]

The example is 100 event frames of 80x80 for the map and 100 of the same route as queries; the given truth is
the same index, a frame or two off what the images show. Brisbane is sunset2 (641 frames) as the map and
sunset1 (724) as queries, reduced to 7x7 pixels by its makers, with their truth matrix. Every matcher runs
with its defaults or the settings named, and is asked for its best item whether it stands by it or not; a
query without any item counts as wrong. The defaults of hmm were chosen by its author with Brisbane, Nordland
and VPR-Bench's corridor in view, not with the example. Algorithm 1 needs probabilities: image scores are
turned into them by a softmax of each row's standard scores.
"""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.capture import open_traverse
from evplace.images import ImageSettings
from evplace.localizer import Localizer
from evplace.matchers import open_matcher
from evplace.placemap import PlaceMap
from evplace.places import PlaceRuns
from evplace.training import train
from evplace.traverse import Traverse

MATCHERS: dict[str, tuple[str, dict[str, Any]]] = {
    "global-max": ("best", {}),
    "Algorithm 1": ("local", {}),
    "Algorithm 1, tau1=0": ("local", {"tau1": 0.0}),
    "seqslam": ("seqslam", {}),
    "seqslam ds=21": ("seqslam", {"ds": 21}),
    "hmm": ("hmm", {}),
}
LENS = Path("traverses") / "lens"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    seeds = parser.parse_args().seeds
    data = Path(os.environ.get("EVPLACE_DATA", Path(__file__).parents[2] / "shared" / "data"))
    example = data / LENS / "example" / "davis128"
    reference, query = (_opened(example / f"example-{part}", 80) for part in ("reference", "query"))
    print("LENS example: share right in %, exact / within 2 frames")
    for name, maps in _maps(reference, seeds):
        for matcher in MATCHERS:
            answers = [_items(place_map, query, matcher) for place_map in maps]
            exact, near = ([_within(items, np.eye(100), reach) for items in answers] for reach in (0, 2))
            _print(name, matcher, exact, near)
    brisbane = data / LENS / "brisevent" / "davis346"
    reference, query = (_opened(brisbane / part, 7) for part in ("sunset2", "sunset1"))
    truth = np.load(brisbane / "sunset2_sunset1_GT.npy")
    print("LENS Brisbane: share right in %, as the given truth has it")
    for name, maps in _image_maps(reference):
        for matcher in MATCHERS:
            items = _items(maps[0], query, matcher)
            _print(name, matcher, [_within(items, truth, 0)])


def _opened(folder: Path, side: int) -> Traverse:
    return open_traverse(folder, images=ImageSettings(width=side, height=side, crop_bottom=0.0))


def _image_maps(reference: Traverse) -> Iterator[tuple[str, list[PlaceMap]]]:
    places = PlaceRuns(len(reference))
    yield "sad", [train(reference, places, "sad")]
    yield "ncc", [train(reference, places, "ncc")]
    yield "ncc log", [train(reference, places, "ncc", scorer_settings={"log": True})]
    yield "ncc log, no blur", [train(reference, places, "ncc", scorer_settings={"sigma": 0.0, "log": True})]


def _maps(reference: Traverse, seeds: int) -> Iterator[tuple[str, list[PlaceMap]]]:
    yield from _image_maps(reference)
    yield "network", [train(reference, PlaceRuns(len(reference)), seed=seed) for seed in range(seeds)]


def _items(place_map: PlaceMap, query: Traverse, matcher: str) -> NDArray[np.int64]:
    name, settings = MATCHERS[matcher]
    rows = Localizer(place_map).rows(query.images)
    if name == "local" and place_map.scorer != "network":
        spread = np.maximum(rows.std(axis=1, keepdims=True), 1e-9)
        rows = _softmax((rows - rows.mean(axis=1, keepdims=True)) / spread)
    matching = open_matcher(name, distances=place_map.scorer == "sad", **settings)
    matching.extend(rows)
    return matching.path().item


def _softmax(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    weights = np.exp(rows - rows.max(axis=1, keepdims=True))
    return weights / weights.sum(axis=1, keepdims=True)


def _within(items: NDArray[np.int64], truth: NDArray[Any], reach: int) -> float:
    """Share of queries with a right item at most `reach` from the answer, in %."""
    width = truth.shape[1]
    offsets = np.clip(items[:, None] + np.arange(-reach, reach + 1), 0, width - 1)
    right = np.take_along_axis(truth.astype(bool), offsets, axis=1).any(axis=1) & (items >= 0)
    return float(100 * right.mean())


def _print(name: str, matcher: str, *columns: list[float]) -> None:
    cells = []
    for values in columns:
        spread = f" +- {np.std(values, ddof=1):.1f}" if len(values) > 1 else ""
        cells.append(f"{np.mean(values):5.1f}{spread}")
    print(f"  {name:<18} {matcher:<26} {' / '.join(cells)}", flush=True)


if __name__ == "__main__":
    main()
