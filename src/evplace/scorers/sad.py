"""Sum of absolute differences with every reference image: SeqSLAM's comparison."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.placemap import PlaceMap
from evplace.scorers import references_of
from evplace.scorers._distances import sad


@dataclass(frozen=True)
class Settings:
    """No settings: images are compared as they are."""


class SadScorer:
    """One score a reference image: the negated mean absolute difference of its pixels, in grey levels."""

    distances = True

    def __init__(self, references: NDArray[np.uint8]) -> None:
        """From reference images (items, h, w) or (items, h, w, C)."""
        self._references = np.ascontiguousarray(references.reshape(len(references), -1))

    def rows(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """See Scorer."""
        return -sad(np.ascontiguousarray(images.reshape(len(images), -1)), self._references)


def scorer(place_map: PlaceMap) -> SadScorer:
    """Over the reference images of a map."""
    return SadScorer(references_of(place_map))
