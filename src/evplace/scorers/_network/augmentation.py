"""What is done to the images of a batch, so that a network does not learn the one drive it was trained on.

All is drawn from torch's random state. The numbers are ours: those of light were not tuned on any query,
those of events on other towns than the benchmark.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, pad

GAINS = (0.05, 2.0)
"""Least and most brightness, drawn evenly in the logarithm."""
GAMMAS = (0.6, 1.6)
COLOUR = 0.3
"""Each channel is brighter or darker by up to this share."""
NOISE = 0.05
"""Largest standard deviation of the noise, where full scale is 1."""

SHIFT_COLUMNS, SHIFT_ROWS = 12 / 160, 6 / 90
"""Largest shift either way, as shares of the image: 12 columns and 6 rows of the paper's 160 x 90 pixels."""
LOST, DOTS = 0.5, 0.12
"""Most pixels that lose their events, and most that get a dot of noise."""
OFTEN = 0.7
"""Share of the images that lose events, and of those that get dots."""
HIDDEN = 0.6
"""Share of the images with something in front that gives no events."""
BLOCK_ROWS, BLOCK_COLUMNS = (15 / 90, 45 / 90), (20 / 160, 70 / 160)
"""Its least and largest size."""
SKY = 20 / 90
"""So much of the image, from above, it leaves free: cars and people stand on the road."""


def augmented(images: Tensor, kind: str) -> Tensor:
    """(n, C, h, w) in [0, 1] -> the same, by the setting `augment`: none, light or events."""
    if kind == "none":
        return images
    changed = in_another_light(images) if kind == "light" else as_another_drive(images)
    return changed.contiguous(memory_format=torch.channels_last)


def in_another_light(images: Tensor) -> Tensor:
    """Camera images darker or a little brighter, of another gamma, of another colour of light, and noisy."""
    n, channels = images.shape[:2]
    device = images.device
    each = (n, 1, 1, 1)
    least, most = (torch.log(torch.tensor(gain)) for gain in GAINS)
    gain = torch.exp(least + (most - least) * torch.rand(each)).to(device)
    gamma = (GAMMAS[0] + (GAMMAS[1] - GAMMAS[0]) * torch.rand(each)).to(device)
    colour = (1 + COLOUR * (2 * torch.rand(n, channels, 1, 1) - 1)).to(device)
    noise = (NOISE * torch.rand(each) * torch.randn(images.shape)).to(device)
    return (images.pow(gamma) * gain * colour + noise).clamp_(0, 1)


def as_another_drive(images: Tensor) -> Tensor:
    """Event images from a little beside, with events lost, noise, and things in the way."""
    return hidden(noisy(thinned(shifted(images))))


def shifted(images: Tensor) -> Tensor:
    """Each image moved across and down by whole pixels; what comes in at the border is mirrored."""
    n, _, height, width = images.shape
    across, down = round(SHIFT_COLUMNS * width), round(SHIFT_ROWS * height)
    wide = pad(images, (across, across, down, down), mode="reflect")
    columns, rows = torch.randint(2 * across + 1, (n,)), torch.randint(2 * down + 1, (n,))
    return torch.stack([
        image[:, row : row + height, column : column + width]
        for image, row, column in zip(wide, rows.tolist(), columns.tolist(), strict=True)
    ])  # fmt: skip


def thinned(images: Tensor) -> Tensor:
    """Single pixels set to 0, as where light is dim."""
    n, _, height, width = images.shape
    lost = torch.rand(n, 1, height, width) < LOST * _for_some(n)
    return images * ~lost.to(images.device)


def noisy(images: Tensor) -> Tensor:
    """With dots as the blur of Eq. 4 makes them of single events."""
    n, _, height, width = images.shape
    events = torch.rand(n, 1, height, width) < DOTS * _for_some(n) ** 2
    dots = (2 * avg_pool2d(events.float(), 3, 1, 1)).clamp_(max=1)
    return torch.maximum(images, dots.to(images.device))


def hidden(images: Tensor) -> Tensor:
    """A block of some images set to 0, anywhere below the sky."""
    n, _, height, width = images.shape
    tall, broad = height * _between(n, BLOCK_ROWS), width * _between(n, BLOCK_COLUMNS)
    top = height * SKY + torch.rand(n, 1, 1, 1) * (height * (1 - SKY) - tall)
    left = torch.rand(n, 1, 1, 1) * (width - broad)
    row, column = torch.arange(height)[:, None], torch.arange(width)
    block = (row >= top) & (row < top + tall) & (column >= left) & (column < left + broad)
    block &= torch.rand(n, 1, 1, 1) < HIDDEN
    return images * ~block.to(images.device)


def _for_some(n: int) -> Tensor:
    """(n, 1, 1, 1): a number from 0 to 1 for most images, 0 for the others."""
    return torch.rand(n, 1, 1, 1) * (torch.rand(n, 1, 1, 1) < OFTEN)


def _between(n: int, ends: tuple[float, float]) -> Tensor:
    return ends[0] + (ends[1] - ends[0]) * torch.rand(n, 1, 1, 1)
