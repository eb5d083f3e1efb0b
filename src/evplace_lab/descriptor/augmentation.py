"""What a camera, a road and the weather do to event images, drawn for each image of a batch."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import affine_grid, avg_pool2d, grid_sample

SHIFT, TURN, ZOOM = (0.1, 0.09), 0.035, 0.08
"""Largest shift across and down in half images, turn in radians, and change of size."""
NOISE, UNDER = 0.25, 4
"""Largest share of a sensor's pixels that noise lights, and how many of them lie under one of the image."""
HIDDEN = 0.4
"""Share of images with something in front: a block without events, or full of them."""


def augmented(images: Tensor) -> Tensor:
    """(n, 45, 80) in 0 to 255 -> the same, on its device; all is drawn from torch's random state."""
    with images.device:
        return _seen_worse(images)


def _seen_worse(images: Tensor) -> Tensor:
    x = _moved(images)
    x = x * (torch.rand(x.shape) >= 0.35 * _for_some(x, 0.5))
    noise = 0.08 * _for_some(x, 0.5) ** 2
    x = torch.maximum(x, (torch.rand(x.shape) < noise) * (40 + 60 * torch.rand(x.shape)))
    x = x + (255 - x) * _noise(x)
    x = torch.lerp(x, _smoothed(x), _for_some(x, 0.3))
    return _hidden(x * (0.6 + 0.8 * torch.rand(len(x), 1, 1))).clamp_(0, 255)


def _for_some(x: Tensor, share: float) -> Tensor:
    """(n, 1, 1): a number from 0 to 1 for a share of the images, 0 for the others."""
    return torch.rand(len(x), 1, 1) * (torch.rand(len(x), 1, 1) < share)


def _noise(x: Tensor) -> Tensor:
    """Share of each pixel that a sensor's noise lights in the dark, where it lights pixels everywhere."""
    share = (NOISE * _for_some(x, 0.4)).expand(x.shape)
    lit = torch.binomial(torch.full_like(share, UNDER), share) / UNDER
    return torch.lerp(lit, _smoothed(lit), torch.rand(len(x), 1, 1))


def _smoothed(x: Tensor) -> Tensor:
    return avg_pool2d(x[:, None], 3, 1, 1)[:, 0]


def _moved(x: Tensor) -> Tensor:
    """A little shifted, turned and zoomed; what comes in at the border is mirrored."""
    n = len(x)
    height, width = x.shape[1:]
    turn, zoom = TURN * _even(n), 1 + ZOOM * _even(n)
    cos, sin = torch.cos(turn) * zoom, torch.sin(turn) * zoom
    rows = [
        torch.stack([cos, -sin * height / width, SHIFT[0] * _even(n)], 1),
        torch.stack([sin * width / height, cos, SHIFT[1] * _even(n)], 1),
    ]
    grid = affine_grid(torch.stack(rows, 1), [n, 1, height, width], align_corners=False)
    return grid_sample(x[:, None], grid, padding_mode="reflection", align_corners=False)[:, 0]


def _even(n: int) -> Tensor:
    return 2 * torch.rand(n) - 1


def _hidden(x: Tensor) -> Tensor:
    """Blocks of a quarter of the image at most, a part of them full of events."""
    n, height, width = x.shape
    down, across = torch.arange(height)[None, :, None], torch.arange(width)[None, None, :]
    tall, wide = 6 + 12 * torch.rand(n, 1, 1), 8 + 22 * torch.rand(n, 1, 1)
    top, left = torch.rand(n, 1, 1) * (height - tall), torch.rand(n, 1, 1) * (width - wide)
    inside = (down >= top) & (down < top + tall) & (across >= left) & (across < left + wide)
    inside &= torch.rand(n, 1, 1) < HIDDEN
    events = torch.rand(x.shape) * 200 * _for_some(x, 0.5)
    return torch.where(inside, events, x)
