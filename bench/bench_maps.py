"""Maps: how fast the network trains, is saved, and answers. python bench/bench_maps.py

104 places and images of noise, as large as the paper's; one thread.
"""

from __future__ import annotations

import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
import torch
from torch.nn.functional import cross_entropy

from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.placemap import train
from evplace.places import PlaceRuns
from evplace.scorers import Learning
from evplace.scorers._network.network import Network, NetworkSettings
from evplace.scorers._network.training import train_network
from evplace.scorers.network import TrainSettings
from harness import alternate, report

PLACES, BATCH, STEPS = 104, 64, 10


def plain_eager(images: np.ndarray, labels: np.ndarray) -> None:
    """The same network and steps as anyone would write them: float32, channels first."""
    network = Network(PLACES, (1, 90, 160), NetworkSettings())
    optimiser = torch.optim.Adam(network.parameters(), 0.001)
    for step in range(STEPS):
        batch = np.random.default_rng(step).permutation(len(images))[:BATCH]
        inputs = torch.from_numpy(images[batch]).unsqueeze(1).float().div(255)
        loss = cross_entropy(network(inputs), torch.from_numpy(labels[batch]))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()


def main() -> None:
    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (PLACES, 90, 160), np.uint8)
    labels = np.arange(PLACES)
    settings = TrainSettings(steps=STEPS, batch=BATCH)
    functions = {
        "evplace": partial(train_network, images, labels, labels >= 0, PLACES, settings, Learning()),
        "plain eager float32": partial(plain_eager, images, labels),
    }
    timings = alternate(functions)
    # A pass over 104 images is one full batch and one of 40.
    seen = {"evplace": STEPS * PLACES / 2, "plain eager float32": STEPS * BATCH}
    each = {name: type(t)(tuple(s / seen[name] for s in t.seconds)) for name, t in timings.items()}
    report("training, CPU time an image", each, 1e-3, "ms")
    drive = Traverse(images, np.arange(PLACES) * 33_333, np.full(PLACES, 9))
    learned = train(drive, PlaceRuns(PLACES), steps=1)
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        learned.save(Path(folder) / "map")
        print(f"saving a map of {PLACES} places: {time.perf_counter() - began:.3f} s")
    localizer = Localizer(learned)
    taken = []
    for image in images:
        began = time.perf_counter()
        localizer.rows(image[None])
        taken.append(time.perf_counter() - began)
    low, middle, high = (1e3 * value for value in np.percentile(taken, [5, 50, 95]))
    print(f"answering for one image, one thread: median {middle:.2f} ms ({low:.2f} to {high:.2f})")


if __name__ == "__main__":
    main()
