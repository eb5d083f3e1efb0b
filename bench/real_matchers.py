"""What each matcher finds on real drives: recall@1 and average precision, before and after matching.

    OMP_NUM_THREADS=1 EVPLACE_DATA=/path/to/data python bench/real_matchers.py

Nordland, summer against winter, within 10 frames; ten techniques on VPR-Bench's corridor, within 2; event
counts of Brisbane (LENS), by the given truth. Every matcher runs with the settings named. hmm's defaults were
chosen with these very data in view; nothing else was tuned on them.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from PIL import Image

from evplace.core import families
from evplace.evaluation.sweeps import sweep
from evplace.localizer import Answers
from evplace.matchers import Matcher, Path, stepped
from evplace.scorers._distances import ncc, sad
from evplace.scorers._seqslam_images import normalise_patches

MATCHERS: dict[str, tuple[str, dict[str, Any]]] = {
    "best": ("best", {}),
    "local on softmax, tau1=0": ("local", {"tau1": 0.0}),
    "seqslam openseqslam2": ("seqslam", {"preset": "openseqslam2"}),
    "seqslam openseqslam2013": ("seqslam", {"preset": "openseqslam2013"}),
    "seqslam ds=40": ("seqslam", {"ds": 40}),
    "seqslam ds=40, .5-2": ("seqslam", {"ds": 40, "v_min": 0.5, "v_max": 2.0}),
    "graph opr": ("graph", {"relocalise": "none", "alpha": 0.7, "memory": 0}),
    "graph opr, alpha=.1": ("graph", {"relocalise": "none", "alpha": 0.1, "memory": 0}),
    "graph isl, m=median": ("graph", {"m": "median"}),
    "dp": ("dp", {}),
    "hmm": ("hmm", {}),
    "hmm, any speed alike": ("hmm", {"steady": 0.0}),
    "hmm, rank less 3": ("hmm", {"drop": 3}),
}

Scene = tuple[str, np.ndarray, np.ndarray]
"""Name, distances (queries, references), truth (queries, references)."""


def probabilities(distances: np.ndarray) -> np.ndarray:
    """Softmax of the standardised negative distances, at a quarter of a deviation: input for Algorithm 1."""
    z = (distances.mean(1, keepdims=True) - distances) / (0.25 * distances.std(1, keepdims=True) + 1e-12)
    p = np.exp(z - z.max(1, keepdims=True))
    return p / p.sum(1, keepdims=True)


def right_of(path: Path, truth: np.ndarray) -> np.ndarray:
    """Whether each query's item is right, accepted or not."""
    return (path.item >= 0) & truth[np.arange(len(truth)), np.maximum(path.item, 0)]


def average_precision(points: Iterator[tuple[float, Path]], truth: np.ndarray) -> float:
    """Area below the precision-recall steps; recall over all queries that have a true reference."""
    seen = truth.any(1).sum()
    curve = set()
    for _, path in points:
        if path.accepted.any():
            found = (right_of(path, truth) & path.accepted).sum()
            curve.add((found / seen, found / path.accepted.sum()))
    area, before = 0.0, 0.0
    for recall, precision in sorted(curve, key=lambda point: (point[0], -point[1])):
        area, before = area + (recall - before) * precision, recall
    return area


def figures(
    name: str, values: dict[str, Any], distances: np.ndarray, truth: np.ndarray, answers: Answers
) -> tuple[float, float]:
    """(recall@1, average precision) of one matcher's live answers, or of its hindsight."""
    scores, negated = (probabilities(distances), False) if name == "local" else (-distances, True)
    if values.get("m") == "median":  # of the least distances: half the queries' best is good enough
        values = {**values, "m": float(np.median(distances.min(1)))}
    preset = values.get("preset")
    values = {key: value for key, value in values.items() if key != "preset"}
    matcher: Matcher = families.make("matchers", name, preset, values)
    matching = matcher.start(negated)
    if answers == "live":
        path, _ = stepped(matching.step, scores)
    else:
        matching.extend(scores)
        path = matching.path()
    recall = right_of(path, truth).sum() / truth.any(1).sum()
    swept = {key: value for key, value in values.items() if key not in ("tau1", "m")}
    points = sweep(families.make("matchers", name, preset, swept), scores, None, None, negated, answers)
    return recall, average_precision(points, truth)


def within(queries: int, references: int, frames: int) -> np.ndarray:
    """Truth of two drives aligned frame by frame."""
    return np.abs(np.arange(queries)[:, None] - np.arange(references)[None]) <= frames


def nordland(data: FilePath) -> Iterator[Scene]:
    images = np.load(data / "traverses" / "nordland_64x32.npz")
    summer, winter = (normalise_patches(images[name]) for name in ("summer", "winter"))
    truth = within(len(winter), len(summer), 10)
    yield "Nordland winter in summer, SAD of patch-normalised 64x32", sad(winter, summer), truth
    correlation = ncc(summer, winter).T
    yield "Nordland winter in summer, 1 - correlation of the same", 1 - correlation, truth


def corridor(data: FilePath) -> Iterator[Scene]:
    for name, similarity in np.load(data / "scores" / "vprbench_corridor.npz").items():
        yield f"corridor, {name}", 1 - similarity, within(*similarity.shape, 2)


def brisbane(data: FilePath) -> Iterator[Scene]:
    folder = data / "traverses" / "lens" / "brisevent" / "davis346"
    drives = [
        np.log1p(np.stack([np.asarray(Image.open(file)) for file in sorted((folder / name).glob("*.png"))]))
        for name in ("sunset1", "sunset2")
    ]
    truth = np.load(folder / "sunset2_sunset1_GT.npy") > 0
    yield "Brisbane sunset1 in sunset2, 1 - correlation of log counts 7x7", 1 - ncc(*drives), truth


def main() -> None:
    data = FilePath(os.environ.get("EVPLACE_DATA", FilePath(__file__).parents[2] / "shared" / "data"))
    if not data.is_dir():
        sys.exit(f"no real recordings at {data}: set EVPLACE_DATA")
    for scenes in (nordland, brisbane, corridor):
        for title, distances, truth in scenes(data):
            print(f"{title}: {distances.shape[0]} queries, {distances.shape[1]} references")
            for label, (name, values) in MATCHERS.items():
                for answers in ("live", "hindsight"):
                    recall, precision = figures(name, values, distances, truth, answers)
                    print(f"  {label:<26} {answers:<9} {recall:6.1%} / {precision:.3f}", flush=True)


if __name__ == "__main__":
    main()
