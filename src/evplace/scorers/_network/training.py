"""Training the paper's network, from top to bottom in `train_network`.

Every batch depends on the seed and the step alone, so a run that was killed goes on from its checkpoint and
ends in the same weights.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from evplace.scorers import Learning

if TYPE_CHECKING:
    import torch

    from evplace.scorers._network.network import Network
    from evplace.scorers.network import Network as Settings


def train_network(
    images: NDArray[np.uint8],
    labels: NDArray[np.int64],
    used: NDArray[np.bool_],
    n_places: int,
    settings: Settings,
    learning: Learning,
) -> dict[str, NDArray[np.float32]]:
    """Train Table 1 on the images (n, h, w[, C]) that are `used`; returns its weights by name."""
    import torch
    from torch.nn.functional import cross_entropy

    from evplace.scorers._network.augmentation import augmented
    from evplace.scorers._network.checkpoint import Checkpoint, fingerprint
    from evplace.scorers._network.network import Network, NetworkSettings, to_input, weights_of

    torch.manual_seed(settings.seed)
    device = "cuda" if torch.cuda.is_available() else "cpu"
    structure = NetworkSettings(settings.last_relu, settings.dropout, settings.own_scale)
    network = Network(n_places, image_shape(images), structure)
    # torch's own types know no `to` with a device and a memory format, which it has.
    network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    optimiser = _optimiser(network, settings)
    chosen = np.flatnonzero(used)
    steps = settings.steps if not settings.epochs else settings.epochs * -(-len(chosen) // settings.batch)
    saved = Checkpoint(learning.checkpoint, fingerprint(settings, labels, images))
    first = saved.load(network, optimiser)
    network.train()
    for step, batch in enumerate(
        batches(len(chosen), settings.batch, settings.seed, first, steps), first + 1
    ):
        torch.manual_seed(settings.seed + step)  # what is drawn, too, depends on the step alone
        set_rate(optimiser, settings, (step - 1) / steps)
        index = np.sort(chosen[batch])
        target = torch.from_numpy(labels[index]).to(device)
        inputs = augmented(to_input(images[index], device), settings.augment)
        with torch.autocast(device, torch.bfloat16, enabled=_bfloat16(settings, device)):
            loss = cross_entropy(network(inputs), target, label_smoothing=settings.label_smoothing)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        if learning.progress is not None:
            learning.progress(step, steps, float(loss.detach()))
        saved.keep(step, network, optimiser)
    saved.remove()
    return weights_of(network)


def batches(n: int, size: int, seed: int, first: int, steps: int) -> Iterator[NDArray[np.int64]]:
    """The batches of steps `first` .. `steps`-1: each pass a new shuffle, its last batch smaller."""
    per_pass = -(-n // size)
    for step in range(first, steps):
        order = np.random.default_rng([seed, step // per_pass]).permutation(n)
        start = step % per_pass * size
        yield order[start : start + size]


def image_shape(images: NDArray[np.uint8]) -> tuple[int, int, int]:
    """(C, h, w) of a stack of images (n, h, w) or (n, h, w, C)."""
    return (images.shape[3] if images.ndim == 4 else 1, images.shape[1], images.shape[2])


def _optimiser(network: Network, settings: Settings) -> torch.optim.Optimizer:
    import torch

    kind = torch.optim.AdamW if settings.optimiser == "adam" else torch.optim.SGD
    return kind(network.parameters(), lr=settings.learning_rate, weight_decay=settings.weight_decay)


def set_rate(optimiser: torch.optim.Optimizer, settings: Settings, done: float) -> None:
    """The learning rate where a share `done` of the steps has been taken: it hangs on nothing else."""
    falls = settings.schedule == "cosine"
    for group in optimiser.param_groups:
        group["lr"] = settings.learning_rate * (0.5 * (1 + math.cos(math.pi * done)) if falls else 1)


def _bfloat16(settings: Settings, device: str) -> bool:
    import torch

    if settings.precision != "auto":
        return settings.precision == "bfloat16"
    if device == "cuda":
        return bool(torch.cuda.is_bf16_supported())
    capability = torch.backends.cpu.get_cpu_capability()
    return capability.startswith("AVX512") and bool(torch.ops.mkldnn._is_mkldnn_bf16_supported())
