"""Camera images made less dependent on the light: what colour is given as a fair chance beside events.

Each takes images (n, h, w) or (n, h, w, 3) uint8 and gives as many of the same size; each image for itself.
The rules and their numbers are ours.
"""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.core.grey import luminance

Images = NDArray[np.uint8]
Tone = Literal["plain", "normalised", "edges"]

SPREAD = 48.0
"""Grey levels that one standard deviation becomes in a normalised image; its mean becomes 128."""
EDGE_SHARE = 0.17
"""Share of pixels that become edges: as many as events set in a window of 1/30 s in the virtual city."""


def toned(images: Images, tone: str) -> Images:
    """`images` as they are (plain), normalised, or as edges; SettingsError for another tone."""
    if tone not in get_args(Tone):
        raise SettingsError(f"unknown tone '{tone}': known are {', '.join(get_args(Tone))}")
    if tone == "plain":
        return images
    change = normalised if tone == "normalised" else edges
    return np.stack([change(image) for image in images])


def normalised(image: Images) -> Images:
    """(h, w[, 3]): each channel with mean 128 and standard deviation 48; a flat one becomes 128."""
    values = image.astype(np.float32)
    values -= values.mean(axis=(0, 1), keepdims=True)
    deviation = values.std(axis=(0, 1), keepdims=True)
    values *= SPREAD / np.maximum(deviation, 1e-3)
    return np.clip(np.rint(values + 128), 0, 255).astype(np.uint8)


def edges(image: Images) -> Images:
    """(h, w): 255 at the 17 % of pixels where the grey image changes most (Sobel), else 0.

    Where more pixels than that change equally, as in a flat image, fewer are set.
    """
    values = image.astype(np.float32)
    grey = values if values.ndim == 2 else luminance(values)
    padded = np.pad(grey, 1, mode="edge")
    across = padded[:-2] + 2 * padded[1:-1] + padded[2:]  # (h, w + 2)
    down = padded[:, :-2] + 2 * padded[:, 1:-1] + padded[:, 2:]  # (h + 2, w)
    strength = np.hypot(across[:, 2:] - across[:, :-2], down[2:] - down[:-2])
    return np.where(strength > np.quantile(strength, 1 - EDGE_SHARE), 255, 0).astype(np.uint8)
