"""Camera images in another light, so that a network does not learn the light of the day it was trained on.

Darker or a little brighter, of another gamma, of another colour of light, and with the sensor's noise. The
numbers are ours and were not tuned on any query.
"""

from __future__ import annotations

import torch
from torch import Tensor

GAINS = (0.05, 2.0)
"""Least and most brightness, drawn evenly in the logarithm."""
GAMMAS = (0.6, 1.6)
COLOUR = 0.3
"""Each channel is brighter or darker by up to this share."""
NOISE = 0.05
"""Largest standard deviation of the noise, where full scale is 1."""


def in_another_light(images: Tensor) -> Tensor:
    """(n, C, h, w) in [0, 1] -> the same shape: a light drawn for each image from torch's random state."""
    n, channels = images.shape[:2]
    device = images.device
    each = (n, 1, 1, 1)
    least, most = (torch.log(torch.tensor(gain)) for gain in GAINS)
    gain = torch.exp(least + (most - least) * torch.rand(each)).to(device)
    gamma = (GAMMAS[0] + (GAMMAS[1] - GAMMAS[0]) * torch.rand(each)).to(device)
    colour = (1 + COLOUR * (2 * torch.rand(n, channels, 1, 1) - 1)).to(device)
    noise = (NOISE * torch.rand(each) * torch.randn(images.shape)).to(device)
    lit = images.pow(gamma) * gain * colour + noise
    return lit.clamp_(0, 1).contiguous(memory_format=torch.channels_last)
