"""Cosine of the images' pixels with every reference image: the similarity that the graph matcher is fed.

Vysotska and Stachniss take the cosine of network features, without centring; here the features are the
pixels, since the paper names none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.imaging.traverse import Traverse
from evplace.places import Places
from evplace.scorers import Content, Learned, Learning, Rows, in_blocks, keep_images, references_of


@dataclass(frozen=True)
class Cosine:
    """One score a reference image, from 0 to 1; an image that is all zero is like nothing: 0."""

    def learn(self, reference: Traverse, places: Places, _: Learning) -> Learned:
        """See Scorer."""
        return keep_images(reference, places)

    def open(self, content: Content) -> CosineRows:
        """See Scorer."""
        return CosineRows(references_of(content))


class CosineRows:
    """See OpenScorer."""

    distances = False

    def __init__(self, references: NDArray[np.uint8]) -> None:
        """From reference images (items, h, w) or (items, h, w, C)."""
        self._references = in_blocks(_unit, references)

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """See OpenScorer."""
        rows: Rows = np.clip(_unit(images) @ self._references.T, 0, 1)
        return rows


def _unit(images: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(n, pixels) each image as a vector of length 1."""
    flat = images.reshape(len(images), -1).astype(np.float32)
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    unit: NDArray[np.float32] = flat / np.maximum(length, 1)
    return unit
