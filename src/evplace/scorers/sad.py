"""Sum of absolute differences with every reference image: SeqSLAM's comparison."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.imaging.traverse import Traverse
from evplace.places import Places
from evplace.scorers import Content, Learned, Learning, Rows, keep_images, references_of
from evplace.scorers._distances import sad


@dataclass(frozen=True)
class SAD:
    """One score a reference image: the negated mean absolute difference of its pixels, in grey levels."""

    def learn(self, reference: Traverse, places: Places, _: Learning) -> Learned:
        """See Scorer."""
        return keep_images(reference, places)

    def open(self, content: Content) -> SADRows:
        """See Scorer."""
        return SADRows(references_of(content))


class SADRows:
    """See OpenScorer."""

    distances = True

    def __init__(self, references: NDArray[np.uint8]) -> None:
        """From reference images (items, h, w) or (items, h, w, C)."""
        self._references = np.ascontiguousarray(references.reshape(len(references), -1))

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """See OpenScorer."""
        return -sad(np.ascontiguousarray(images.reshape(len(images), -1)), self._references)
