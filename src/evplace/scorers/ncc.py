"""Normalised correlation of blurred, reduced images with every reference image.

Event images have their edges a pixel or two elsewhere at each pass; the blur forgives that. No training.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.scorers._reduction import reduction

FLAT = 1e-3
"""Below this length, in grey levels, what is left of an image is rounding."""


@dataclass(frozen=True)
class NCC:
    """How images are prepared for the correlation; scores go from -1 to 1."""

    sigma: float = 2.0
    """Standard deviation of the Gaussian blur in pixels; 0 for none (ours)."""
    width: int = 40
    """Columns after the reduction; images that are smaller stay as they are (ours)."""
    height: int = 22
    """Rows after the reduction (ours)."""
    log: bool = False
    """Take log(1 + value) first: for images of event counts, whose few large values would rule."""

    def __post_init__(self) -> None:
        if self.sigma < 0 or self.width < 1 or self.height < 1:
            raise SettingsError("the settings of ncc need sigma of 0 or more, width and height of 1 or more")

    def describe(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(n, pixels): blurred, reduced, of mean 0 and length 1; an image without contrast becomes 0."""
        height, width = images.shape[1:3]
        rows = reduction(height, min(height, self.height), self.sigma)
        columns = reduction(width, min(width, self.width), self.sigma)
        channels = np.moveaxis(images.reshape(*images.shape[:3], -1), 3, 1)
        values = np.ascontiguousarray(channels, np.float32)
        if self.log:
            values = np.log1p(values)
        small = np.moveaxis(rows @ values @ columns.T, 1, 3)
        flat = small.reshape(len(small), -1)
        flat -= flat.mean(axis=1, keepdims=True)
        length = np.linalg.norm(flat, axis=1, keepdims=True)
        unit: NDArray[np.float32] = np.divide(flat, length, out=np.zeros_like(flat), where=length > FLAT)
        return unit
