"""The descriptor's network: a small event image -> a unit vector.

    image (45, 80) -> root -> against its surroundings        contrast, whatever the number of events
                   -> conv 5x5 / 2, 32 -> conv 3x3, 64        (64, 23, 40)
                   -> max-pool 2 -> conv 3x3, 96 -> conv 3x3, 128      (128, 12, 20)
                   -> max-pool 2 -> conv 3x3, 128              (128, 6, 10)
                   -> twice: what a conv 3x3, 128 says is added
                   -> conv 1x1, 16 -> flatten -> 256, of length 1

Each convolution but the last has a batch norm and a ReLU. 0.88 million weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import MissingExtraError
from evplace.scorers._reduction import reduction
from evplace_lab.descriptor.sensors import SIZE

try:
    import torch
    from torch import Tensor, nn
except ModuleNotFoundError as error:
    raise MissingExtraError("torch", "train", "training the descriptor") from error

Weights = dict[str, NDArray[np.float32]]
LAYERS = ((1, 32, 5, 2), (32, 64, 3, 1), (64, 96, 3, 1), (96, 128, 3, 1), *3 * ((128, 128, 3, 1),))
"""Channels in and out, side of the kernel and stride of each convolution with batch norm."""
POOLED, ADDED = (2, 4), (5, 6)
"""Before these convolutions the image is halved; what these ones say is added to what they are given."""
LAST, DIMENSIONS = 16, 256
SHARP, WIDE = 0.7, 10.0
"""Standard deviations in pixels: of the blur, and of what a pixel is compared with."""
FLOOR = 0.15
"""Share of an image's mean deviation that is added to that of each pixel's surroundings."""


class Surroundings(nn.Module):
    """(n, 45, 80) in 0 to 255 -> (n, 1, 45, 80): the root, minus its local mean, over its local deviation."""

    def __init__(self) -> None:
        super().__init__()
        for name, sigma in (("sharp", SHARP), ("wide", WIDE)):
            for axis, side in (("rows", SIZE[1]), ("columns", SIZE[0])):
                self.register_buffer(f"{name}_{axis}", torch.from_numpy(reduction(side, side, sigma)), False)

    def forward(self, images: Tensor) -> Tensor:
        """See the class."""
        values = self._blurred("sharp", torch.sqrt(images / 255))
        mean = self._blurred("wide", values)
        variance = self._blurred("wide", values * values) - mean * mean
        deviation = torch.sqrt(torch.relu(variance))
        floor = FLOOR * deviation.mean((1, 2), keepdim=True) + 1e-3
        return ((values - mean) / (deviation + floor))[:, None]

    def _blurred(self, name: str, values: Tensor) -> Tensor:
        buffers = dict(self.named_buffers())
        return buffers[f"{name}_rows"] @ values @ buffers[f"{name}_columns"].T


class DescriptorNetwork(nn.Module):
    """See the module."""

    def __init__(self) -> None:
        """Fresh weights, drawn from torch's random state."""
        super().__init__()
        self.surroundings = Surroundings()
        self.convolutions = nn.ModuleList(
            nn.Conv2d(into, out, side, stride, side // 2, bias=False) for into, out, side, stride in LAYERS
        )
        self.norms = nn.ModuleList(nn.BatchNorm2d(out) for _, out, _, _ in LAYERS)
        self.last = nn.Conv2d(LAYERS[-1][1], LAST, 1)
        self.full = nn.Linear(LAST * 6 * 10, DIMENSIONS)

    def forward(self, images: Tensor) -> Tensor:
        """(n, 45, 80) float32 in 0 to 255 -> (n, 256) float32."""
        with torch.no_grad(), torch.autocast(images.device.type, enabled=False):
            x = self.surroundings(images).contiguous(memory_format=torch.channels_last)
        for number, (convolution, norm) in enumerate(zip(self.convolutions, self.norms, strict=True)):
            if number in POOLED:
                x = torch.max_pool2d(x, 2, ceil_mode=True)
            said = norm(convolution(x))
            x = torch.relu(x + said if number in ADDED else said)
        return nn.functional.normalize(self.full(self.last(x).flatten(1)).float(), dim=1)
