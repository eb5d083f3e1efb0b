"""Training the descriptor: images of one place shall be alike, whatever the drive and the sensor.

The loss is InfoNCE with several positives (van den Oord et al. 2018): each image is told from all images of
other places in its batch. Batches and what is drawn on them depend on the seed and the step alone, so that a
run that was killed ends in the same weights.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import softplus

from evplace.scorers import Learning
from evplace.scorers._network.checkpoint import Checkpoint
from evplace_lab.descriptor.augmentation import augmented
from evplace_lab.descriptor.batches import Batch, Routes, draw_batch
from evplace_lab.descriptor.bursts import Bursts
from evplace_lab.descriptor.network import DescriptorNetwork

SAME_M, SAME_DEG = 6.0, 20.0
"""So near and alike in direction two images are of one place."""
OTHER_M, OTHER_DEG = 25.0, 60.0
"""So far apart, or so differently turned, they are not; between, nothing is said."""
TEMPERATURE = 0.07
WARMING = 0.1
"""Share of the steps in which the learning rate rises."""


@dataclass(frozen=True)
class TrainingSettings:
    """How the network is trained."""

    steps: int = 7000
    """Steps of one batch each."""
    routes: int = 32
    """Routes in a batch."""
    places: int = 8
    """Places of each route, each in every drive."""
    learning_rate: float = 0.002
    """Its largest value; it rises and falls once (AdamW)."""
    weight_decay: float = 0.001
    """Of AdamW."""
    seed: int = 0
    """Draws the first weights and the batches."""
    bfloat16: bool = True
    """Convolutions in bfloat16."""


def train_descriptor(
    towns: Iterable[Bursts], settings: TrainingSettings, learning: Learning, run: str = ""
) -> DescriptorNetwork:
    """Train on `towns`, on a GPU where there is one; `run` says what the towns are, so that a checkpoint of
    others is passed over.
    """
    device = _device()
    routes = Routes.of(towns, device)
    torch.manual_seed(settings.seed)
    network = DescriptorNetwork()
    network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload] # which it has
    optimiser = torch.optim.AdamW(
        network.parameters(), settings.learning_rate, weight_decay=settings.weight_decay
    )
    saved = Checkpoint(learning.checkpoint, f"{settings} {run}")
    first = saved.load(network, optimiser)
    network.train()
    for step in range(first, settings.steps):
        for group in optimiser.param_groups:
            group["lr"] = settings.learning_rate * _pace((step + 1) / settings.steps)
        loss = _loss_of(network, routes, settings, step)
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        if learning.progress is not None:
            learning.progress(step + 1, settings.steps, float(loss.detach()))
        saved.keep(step + 1, network, optimiser)
    saved.remove()
    network.eval()
    return network.cpu()


def _device() -> str:
    return "cuda" if torch.cuda.is_available() else "cpu"


def device_name() -> str:
    """What trains: the name of a GPU, or "cpu"."""
    return torch.cuda.get_device_name() if _device() == "cuda" else "cpu"


def _loss_of(network: DescriptorNetwork, routes: Routes, settings: TrainingSettings, step: int) -> Tensor:
    batch = draw_batch(routes, settings.seed, step, settings.routes, settings.places)
    torch.manual_seed(settings.seed * 1_000_003 + step)
    images = augmented(batch.images)
    with torch.autocast(images.device.type, torch.bfloat16, enabled=settings.bfloat16):
        vectors = network(images)
    return info_nce(vectors, batch)


def info_nce(vectors: Tensor, batch: Batch) -> Tensor:
    """The mean, over all pairs of one place, of how badly the pair stands out from other places."""
    same, other = _pairs(batch)
    scores = vectors @ vectors.T / TEMPERATURE
    against = torch.logsumexp(scores.masked_fill(~other, -1e4), 1, keepdim=True)
    losses = softplus(against - scores) * same
    return losses.sum() / same.sum().clamp_min(1)


def _pairs(batch: Batch) -> tuple[Tensor, Tensor]:
    """(n, n) which two images are of one place, and which are not."""
    poses, route = batch.poses.double(), batch.route
    apart = torch.cdist(poses[:, :2], poses[:, :2])
    turned = torch.remainder(poses[:, None, 2] - poses[None, :, 2] + math.pi, 2 * math.pi) - math.pi
    degrees = torch.rad2deg(turned.abs())
    one_route = route[:, None] == route[None]
    same = one_route & (apart <= SAME_M) & (degrees <= SAME_DEG)
    other = ~one_route | (apart > OTHER_M) | (degrees > OTHER_DEG)
    return same & ~torch.eye(len(route), dtype=torch.bool, device=route.device), other


def _pace(share: float) -> float:
    """The learning rate at a share of the steps: up in a straight line, down along a cosine."""
    if share < WARMING:
        return share / WARMING
    return 0.5 * (1 + math.cos(math.pi * (share - WARMING) / (1 - WARMING)))


def as_arrays(network: DescriptorNetwork) -> dict[str, Any]:
    """All weights and running statistics, float32."""
    state = network.state_dict()
    return {
        name: value.numpy().astype(np.float32) for name, value in state.items() if "num_batches" not in name
    }
