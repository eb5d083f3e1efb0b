"""Normalised correlation of blurred, reduced images with every reference image.

Event images have their edges a pixel or two elsewhere at each pass; the blur forgives that. No training.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError

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
        rows = _reduction(height, min(height, self.height), self.sigma)
        columns = _reduction(width, min(width, self.width), self.sigma)
        values = images.astype(np.float32)
        if self.log:
            values = np.log1p(values)
        small = np.einsum("ih,nhw...,jw->nij...", rows, values, columns, optimize=True)
        flat = np.asarray(small, np.float32).reshape(len(small), -1)
        flat -= flat.mean(axis=1, keepdims=True)
        length = np.linalg.norm(flat, axis=1, keepdims=True)
        unit: NDArray[np.float32] = np.divide(flat, length, out=np.zeros_like(flat), where=length > FLAT)
        return unit


@functools.cache
def _reduction(n_in: int, n_out: int, sigma: float) -> NDArray[np.float32]:
    """(out, in): a Gaussian blur with mirrored borders, then the mean over each output's share."""
    edges = np.arange(n_out + 1) * n_in / n_out
    inputs = np.arange(n_in)
    overlap = np.minimum(edges[1:, None], inputs + 1) - np.maximum(edges[:-1, None], inputs)
    share = np.maximum(overlap, 0) * n_out / n_in
    return np.asarray(share @ _blur(n_in, sigma), np.float32)


def _blur(n: int, sigma: float) -> NDArray[np.float64]:
    """(n, n): row i holds the weights of the Gaussian around i; cut at 4 sigma."""
    if sigma == 0 or n == 1:
        return np.eye(n)
    reach = int(min(4 * sigma + 0.5, n - 1))
    shifts = np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * (shifts / sigma) ** 2)
    kernel /= kernel.sum()
    matrix = np.zeros((n, n))
    for shift, weight in zip(shifts, kernel, strict=True):
        source = np.abs(np.arange(n) + shift)
        source = np.where(source >= n, 2 * (n - 1) - source, source)
        matrix[np.arange(n), source] += weight
    return matrix
