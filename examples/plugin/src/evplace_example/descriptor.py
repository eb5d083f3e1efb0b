"""Thumbnail: the image as a few grey cells, each the mean over its share of the pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError


@dataclass(frozen=True)
class Thumbnail:
    """How small the image becomes; the product of two vectors is the correlation of two thumbnails."""

    width: int = 16
    """Columns of the thumbnail."""
    height: int = 9
    """Rows of the thumbnail."""

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise SettingsError("thumbnail takes a width and a height of 1 or more")

    def describe(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See Descriptor: (n, cells), of mean 0 and length 1; an image without contrast becomes 0."""
        cells = _means(_means(images.astype(np.float32), 1, self.height), 2, self.width)
        vectors = cells.reshape(len(images), -1)
        vectors = vectors - vectors.mean(axis=1, keepdims=True)
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        return np.asarray(vectors / np.maximum(length, 1e-3), np.float32)


def _means(images: NDArray[np.float32], axis: int, cells: int) -> NDArray[np.float32]:
    """The images with that axis cut into as many stretches, or fewer pixels, each replaced by its mean."""
    edges = np.linspace(0, images.shape[axis], min(cells, images.shape[axis]) + 1).astype(int)
    sums = np.add.reduceat(images, edges[:-1], axis)
    shape = [1] * images.ndim
    shape[axis] = -1
    return np.asarray(sums / np.diff(edges).reshape(shape), np.float32)
