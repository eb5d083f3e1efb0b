"""SeqSLAM's comparison: small grey images with normalised patches, by the sum of absolute differences.

OpenSeqSLAM 2.0 has MATLAB's `localcontrast` where the older program, and this one, normalises patches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.imaging.traverse import Traverse
from evplace.places import Places
from evplace.scorers import Content, Learned, Learning, Rows, keep_images, references_of
from evplace.scorers._distances import sad
from evplace.scorers._seqslam_images import prepare

LARGEST = 4096
"""Columns and rows of a reduced image at most."""


@dataclass(frozen=True)
class SeqSLAM:
    """How images are prepared, with OpenSeqSLAM's defaults; a score is the negated mean difference."""

    width: int = 64
    """Columns after the reduction (OpenSeqSLAM: 64)."""
    height: int = 32
    """Rows after the reduction (OpenSeqSLAM: 32)."""
    patch: int = 8
    """Side of the patches whose contrast is normalised (OpenSeqSLAM 2013: 8); 0 leaves them as they are."""

    def __post_init__(self) -> None:
        fits = 0 < self.width <= LARGEST and 0 < self.height <= LARGEST
        if not fits or not 0 <= self.patch <= LARGEST or self.patch == 1:
            raise SettingsError(
                f"images of {self.width}x{self.height} in patches of {self.patch} are impossible: take a "
                f"width and height from 1 to {LARGEST}, and a patch of 0 (none) or from 2 to {LARGEST}"
            )

    def learn(self, reference: Traverse, places: Places, _: Learning) -> Learned:
        """See Scorer."""
        return keep_images(reference, places)

    def open(self, content: Content) -> SeqSLAMRows:
        """See Scorer."""
        return SeqSLAMRows(references_of(content), self)


class SeqSLAMRows:
    """See OpenScorer."""

    distances = True

    def __init__(self, references: NDArray[np.uint8], settings: SeqSLAM) -> None:
        """From reference images (items, h, w) or (items, h, w, 3)."""
        self._settings = settings
        self._references = self._prepared(references)

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """See OpenScorer."""
        return -sad(self._prepared(images), self._references)

    def _prepared(self, images: NDArray[np.uint8]) -> NDArray[np.uint8]:
        s = self._settings
        return np.stack([prepare(image, (s.width, s.height), patch=s.patch or None) for image in images])
