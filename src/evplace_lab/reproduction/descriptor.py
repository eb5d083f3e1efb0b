"""The learned descriptor: its towns, its trainings, and the shipped weights beside them.

The first seed makes the weights that come with evplace. Their towns took 6 minutes of 16 cores, the training
3.3 minutes of a GPU (NVIDIA H200) that two other trainings shared; a step takes a core 1.8 seconds, so
that without a GPU a training takes 3 and a half hours. Another processor rounds otherwise, and ends in other
weights. How often the images of unseen towns and halls are found again says what they are worth.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from evplace.core.errors import SettingsError
from evplace.core.settings import make
from evplace.core.workers import Workers
from evplace.scorers.network import Network
from evplace.scorers.trained import FOLDER, DescriptorGraph
from evplace_lab.descriptor.making import Recipe, judged, make_towns, train_seed
from evplace_lab.reproduction import Choice, Table

TITLE = "The learned descriptor: recall at 1 in % of single images of unseen places"
NEEDS = "nothing"
INPUTS: tuple[str, ...] = ()
METHODS: tuple[str, ...] = ()
FORMAT = "evplace-descriptor-1"


def document(
    out: Path, choice: Choice, workers: Workers, progress: Callable[[int, int, str], None] | None
) -> dict[str, Any]:
    """Make what is missing in `out`; a row for each seed, and one for the shipped weights.

    Settings of the choice's trainings are those of the recipe: towns, steps.
    """
    recipe, began = _recipe(choice), time.process_time()
    Network().require()
    said = progress or (lambda *_: None)
    make_towns(out, recipe, workers, said)
    rows = []
    for seed in range(choice.seeds):
        about = train_seed(out, recipe, seed, said)
        found = judged(out, recipe, DescriptorGraph(out / f"seed-{seed}"))
        rows.append({"weights": f"seed {seed}", **about, "recall": found})
    shipped = DescriptorGraph(FOLDER)
    rows.append({"weights": "shipped", "sha256": shipped.checksum, "recall": judged(out, recipe, shipped)})
    cpu_s = round(time.process_time() - began, 1)
    return {"format": FORMAT, "title": TITLE, "rows": rows, "cpu_s": cpu_s}


def tables(document: dict[str, Any]) -> Iterator[Table]:
    """One table."""
    kinds = list(document["rows"][0]["recall"])
    lines = [
        [row["weights"], *(f"{row['recall'][kind]:.1f}" for kind in kinds), row["sha256"][:12]]
        for row in document["rows"]
    ]
    yield Table(document["title"], ["weights", *kinds, "sha256"], lines)


def _recipe(choice: Choice) -> Recipe:
    try:
        return make(Recipe, choice.train)
    except SettingsError as error:
        raise SettingsError(f"the descriptor's recipe: {error}") from error
