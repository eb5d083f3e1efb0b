"""The paper's network (Table 1): three convolutions, two batch norms, three fully connected layers.

    image (C, 90, 160) -> conv 5x5, 6   -> ReLU -> max-pool 2 -> batch norm
                       -> conv 5x5, 16  -> ReLU -> max-pool 2 -> batch norm
                       -> conv 5x5, 32  -> ReLU -> max-pool 2 -> flatten (32 x 11 x 20 = 7040)
                       -> 2N -> ReLU -> 1.5N -> ReLU -> N (-> ReLU, as printed) -> softmax

Table 1 ends without a softmax: the cross-entropy of training applies one, and so does localising, since
Algorithm 1's thresholds are probabilities (tau2 = 0.01 is just above 1/N for N = 104).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError, PlaceMapError, SettingsError
from evplace.scorers._network.network_onnx import LEAST, SCALE

try:
    import torch
    from torch import Tensor, nn
except ModuleNotFoundError as error:
    raise MissingExtraError("torch", "train", "training the network") from error

Weights = dict[str, NDArray[np.float32]]
CHANNELS = (6, 16, 32)
MOST_WEIGHTS = 500_000_000
"""A graph of more would pass the 2 GB that ONNX can hold in one file."""


@dataclass(frozen=True)
class NetworkSettings:
    """What Table 1 leaves open or its author did otherwise."""

    last_relu: bool = False
    """ReLU on the last layer (paper: as printed; here off, since a place whose logit falls below zero gets no
    gradient from its own images any more)."""
    dropout: float = 0.0
    """Share of activations dropped before each fully connected layer in training (paper: not mentioned)."""
    own_scale: bool = False
    """Divide each image by its own root mean square before the first layer (paper: not mentioned)."""

    def __post_init__(self) -> None:
        if not 0 <= self.dropout < 1:
            raise SettingsError(f"the setting 'dropout' cannot be {self.dropout}: it takes 0 to below 1")


class Network(nn.Module):
    """Table 1 for `places` places and images of (channels, height, width)."""

    def __init__(self, places: int, image: tuple[int, int, int], settings: NetworkSettings) -> None:
        """Fresh weights, drawn from torch's random state."""
        super().__init__()
        channels, height, width = image
        if min(height, width) < 8:
            raise SettingsError(
                f"the network needs images of at least 8x8 pixels, these are {width}x{height}"
            )
        first, second, third = CHANNELS
        self.conv1 = nn.Conv2d(channels, first, 5, padding=2)
        self.norm1 = nn.BatchNorm2d(first, eps=1e-5, momentum=0.1)
        self.conv2 = nn.Conv2d(first, second, 5, padding=2)
        self.norm2 = nn.BatchNorm2d(second, eps=1e-5, momentum=0.1)
        self.conv3 = nn.Conv2d(second, third, 5, padding=2)
        flat = third * (height // 8) * (width // 8)
        _check_size(places, flat)
        self.full1 = nn.Linear(flat, 2 * places)
        self.full2 = nn.Linear(2 * places, int(1.5 * places))
        self.full3 = nn.Linear(int(1.5 * places), places)
        self.dropout = nn.Dropout(settings.dropout)
        self.last_relu = settings.last_relu
        self.own_scale = settings.own_scale

    def forward(self, images: Tensor) -> Tensor:
        """(n, C, h, w) float32 in [0, 1] -> (n, N) logits."""
        x = scaled(images) if self.own_scale else images
        x = self.norm1(_pooled(self.conv1(x)))  # (n, 6, h/2, w/2)
        x = self.norm2(_pooled(self.conv2(x)))  # (n, 16, h/4, w/4)
        x = _pooled(self.conv3(x)).flatten(1)  # (n, 32 (h/8) (w/8))
        x = torch.relu(self.full1(self.dropout(x)))  # (n, 2N)
        x = torch.relu(self.full2(self.dropout(x)))  # (n, 1.5N)
        logits: Tensor = self.full3(self.dropout(x))  # (n, N)
        return torch.relu(logits) if self.last_relu else logits


def _check_size(places: int, flat: int) -> None:
    """SettingsError where the fully connected layers would be too large to be saved."""
    weights = 2 * places * flat + 3 * places**2 + 3 * places**2 // 2
    if weights > MOST_WEIGHTS:
        raise SettingsError(
            f"a network of {places} places has {weights / 1e6:.0f} million weights, at most "
            f"{MOST_WEIGHTS / 1e6:.0f} can be saved: make the places larger"
        )


def scaled(images: Tensor) -> Tensor:
    """Each channel of each image with a root mean square of nearly `SCALE`; an empty one stays empty."""
    own = images.square().mean(dim=(2, 3), keepdim=True).sqrt()
    return images * (SCALE / (own + LEAST))


def _pooled(x: Tensor) -> Tensor:
    # ReLU and max-pool commute; pooling first leaves the ReLU a quarter of the work.
    return torch.relu(torch.max_pool2d(x, 2))


def to_input(images: NDArray[np.uint8], device: str = "cpu") -> Tensor:
    """(n, h, w) or (n, h, w, C) uint8 -> (n, C, h, w) float32 in [0, 1], channels last in memory."""
    layers = torch.from_numpy(np.ascontiguousarray(images)).to(device)
    layers = layers.unsqueeze(1) if layers.ndim == 3 else layers.permute(0, 3, 1, 2)
    return layers.contiguous(memory_format=torch.channels_last).float().div_(255)


def network_of(weights: Mapping[str, Tensor], settings: NetworkSettings) -> Network:
    """The network that has these weights; PlaceMapError where they are not such a network's."""
    try:
        places, channels = len(weights["full3.bias"]), weights["conv1.weight"].shape[1]
        columns = weights["full1.weight"].shape[1] // CHANNELS[-1]
        # Only the number of pixels matters to the layers: any height and width with their product will do.
        network = Network(places, (channels, 8, 8 * columns), settings)
        network.load_state_dict(weights, strict=False)  # but for the counts of batches, which nothing reads
    except (KeyError, IndexError, RuntimeError) as error:
        raise PlaceMapError(f"the map's weights are not those of the network: {error}") from error
    return network


def weights_of(network: Network) -> Weights:
    """All weights and running statistics as arrays."""
    state: dict[str, Any] = network.state_dict()
    return {
        name: value.detach().cpu().contiguous().numpy().astype(np.float32)
        for name, value in state.items()
        if not name.endswith("num_batches_tracked")
    }
