"""The default on real drives: single images, live, in hindsight, and whether it knows what it has never seen.

    python bench/best_real.py DATA

DATA holds traverses/ with LENS's example, Brisbane in 7x7 pixels, and Nordland. "Off the map"
localises the query once more on a map whose middle 40 % is cut out: AUROC of known against unknown, live.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evplace import Localizer, PlaceRuns, Traverse, evaluate, open_traverse, train
from evplace.evaluation._measures import auroc
from evplace.evaluation.truth import Truth, by_frames, by_matrix


def sets(data: Path) -> Iterator[tuple[str, Traverse, Traverse, Truth]]:
    """Name, reference, query and truth."""
    lens = data / "traverses" / "lens"
    reference, query = (open_traverse(lens, drive=f"example-{name}") for name in ("reference", "query"))
    yield "LENS example, within 2", reference, query, by_frames(len(query), len(reference), 2)
    reference, query = (open_traverse(lens, drive=name) for name in ("sunset2", "sunset1"))
    matrix = lens / "brisevent" / "davis346" / "sunset2_sunset1_GT.npy"
    yield "Brisbane, 7x7", reference, query, by_matrix(matrix, len(query), len(reference), None)
    film = np.load(data / "traverses" / "nordland_64x32.npz")
    for every, within in ((4, 2), (1, 10)):
        drives = [_film(film[season][::every], 10.0 * every) for season in ("summer", "winter")]
        truth = by_frames(len(drives[1]), len(drives[0]), within)
        yield f"Nordland, every {every}, within {within}", drives[0], drives[1], truth


def _film(images: np.ndarray, seconds: float) -> Traverse:
    t_us = (np.arange(len(images)) * seconds * 1e6).astype(np.int64)
    return Traverse(np.ascontiguousarray(images), t_us, np.full(len(images), -1))


def main() -> None:
    """Print a line for each set and scorer."""
    print("set, scorer: single images, live, hindsight, % right; off the map: AUROC live")
    for name, reference, query, truth in sets(Path(sys.argv[1])):
        for scorer in ("ncc", "edges", "trained", "fused"):
            shown = []
            place_map = train(reference, PlaceRuns(len(reference)), scorer)
            kept = place_map.items.t_us
            assert kept is not None
            columns = np.searchsorted(reference.t_us, kept)
            narrowed = _columns(truth, columns)
            for matcher, answers in (("best", "live"), ("bayes", "live"), ("bayes", "hindsight")):
                where = Localizer(place_map, matcher, **({"threshold": -1.0} if matcher == "bayes" else {}))
                figures = evaluate(where, query, narrowed, answers=answers).figures
                shown.append(100 * figures["accuracy_seen"])
            off = _off_the_map(reference, query, truth, scorer)
            print(
                f"{name}, {scorer}: " + " ".join(f"{one:.1f}" for one in shown) + f"; {off:.3f}", flush=True
            )


def _off_the_map(reference: Traverse, query: Traverse, truth: Truth, scorer: str) -> float:
    """AUROC of the live scores of queries whose place is in a map without its middle 40 %."""
    images = len(reference)
    keep = np.r_[0 : int(0.3 * images), int(0.7 * images) : images]
    part = Traverse(
        np.ascontiguousarray(reference.images[keep]), reference.t_us[keep], reference.counts[keep],
        recipe=reference.recipe,
    )  # fmt: skip
    place_map = train(part, PlaceRuns(len(part)), scorer)
    assert place_map.items.t_us is not None
    columns = keep[np.searchsorted(part.t_us, place_map.items.t_us)]
    where = Localizer(place_map, "bayes", threshold=-1.0)
    result = evaluate(where, query, _columns(truth, columns))
    judged = truth.seen
    found = auroc(result.answers.score[judged], result.seen[judged])
    return float("nan") if found is None else found


def _columns(truth: Truth, columns: np.ndarray) -> Truth:
    """The same truth over some of the items."""
    right = truth.right[:, columns]
    return by_matrix(right, len(right), len(columns), "queries")


if __name__ == "__main__":
    main()
