"""From seeds to a file of weights: towns, trainings, and how often the unseen towns are found again.

Everything is kept under its settings, a file a town and a file a training, so that a call that was stopped
goes on where it was.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.settings import to_dict
from evplace.core.storage import read_json
from evplace.core.workers import Workers, run_all
from evplace.scorers import Learning
from evplace.scorers.trained import ABOUT, WEIGHTS, DescriptorGraph
from evplace_lab.descriptor.bursts import Bursts, BurstSettings, is_hall
from evplace_lab.descriptor.judging import recalls

VERSION = 3
"""Counts up whenever the same settings give other images or other weights."""
UNSEEN = (201, 202, 203)
"""Seeds of two towns and of halls that no training sees."""
Progress = Callable[[int, int, str], None]
"""Called with (steps done, steps in all, what is being done)."""


@dataclass(frozen=True)
class Recipe:
    """What the shipped weights were made with."""

    towns: int = 44
    """Seeds of towns and halls to train on, from 0."""
    bursts: BurstSettings = field(default_factory=BurstSettings)
    """How much is made of each."""
    steps: int = 7000
    """Steps of each training."""

    @property
    def key(self) -> str:
        """What two sets of towns of the same settings have in common."""
        return hashlib.sha256(f"{VERSION} {self.bursts}".encode()).hexdigest()[:12]


def make_towns(folder: Path, recipe: Recipe, workers: Workers, progress: Progress) -> None:
    """All towns that are not there yet."""
    seeds = [*range(recipe.towns), *UNSEEN]
    todo = [seed for seed in seeds if not town_file(folder, recipe, seed).exists()]
    jobs = [
        {"file": str(town_file(folder, recipe, seed)), "seed": seed, "bursts": to_dict(recipe.bursts)}
        for seed in todo
    ]
    done = len(seeds) - len(todo)

    def said(_: int, line: str) -> None:
        nonlocal done
        done += 1
        progress(done, len(seeds), line)

    run_all("evplace_lab.descriptor.worker", jobs, workers, folder / "towns", said)


def town_file(folder: Path, recipe: Recipe, seed: int) -> Path:
    """Where the images of one seed are kept."""
    return folder / "towns" / f"{seed:05d}-{recipe.key}.npz"


def train_seed(folder: Path, recipe: Recipe, seed: int, progress: Progress) -> dict[str, Any]:
    """One training, kept in `folder/seed-N`; returns what its file says."""
    from evplace_lab.descriptor.export import write_descriptor
    from evplace_lab.descriptor.training import TrainingSettings, as_arrays, device_name, train_descriptor

    out = folder / f"seed-{seed}"
    wanted = {"version": VERSION, "seed": seed, "recipe": to_dict(recipe)}
    if (out / ABOUT).exists() and (out / WEIGHTS).exists():
        found = read_json(out / ABOUT, "the description of a descriptor")
        if {key: found.get(key) for key in wanted} == wanted:
            return found
    towns = [Bursts.load(town_file(folder, recipe, number)) for number in range(recipe.towns)]
    began = time.monotonic()
    watched = Learning(
        lambda step, steps, loss: progress(step, steps, f"seed {seed}, loss {loss:.3f}"),
        out / "training.safetensors",
    )
    network = train_descriptor(
        towns, TrainingSettings(steps=recipe.steps, seed=seed), watched, f"{VERSION} {recipe}"
    )
    about = wanted | {"device": device_name(), "seconds": round(time.monotonic() - began)}
    write_descriptor(out, as_arrays(network), about)
    return read_json(out / ABOUT, "the description of a descriptor")


def judged(folder: Path, recipe: Recipe, graph: DescriptorGraph) -> dict[str, float]:
    """Name of each kind of unseen place -> recall in %; see `judging`."""
    found: dict[str, list[float]] = {"streets": [], "halls": []}
    for seed in UNSEEN:
        kind = "halls" if is_hall(seed, recipe.bursts) else "streets"
        found[kind] += recalls(graph, Bursts.load(town_file(folder, recipe, seed)))
    return {kind: float(np.mean(values)) for kind, values in found.items() if values}
