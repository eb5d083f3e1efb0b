"""Vectors of a map in fewer numbers: along the directions in which its own references differ most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float32]

MOST_SAMPLED = 2000
"""References that the directions are found from; more change nothing that could be seen, and cost."""


class Compressed(NamedTuple):
    """References by their components."""

    basis: Vectors
    """(dimensions, components) orthonormal."""
    vectors: Vectors
    """(items, components)."""

    def rows(self, vectors: Vectors) -> Vectors:
        """(n, dimensions) -> (n, items) products, as those of the whole vectors but for what was left out."""
        return np.asarray((vectors @ self.basis) @ self.vectors.T, np.float32)


def compress(references: Vectors, components: int) -> Compressed:
    """References (items, dimensions) by their principal components; exact where these suffice."""
    sample = references[:: -(-len(references) // MOST_SAMPLED)].astype(np.float64)
    values, directions = np.linalg.eigh(sample @ sample.T)
    kept = np.flatnonzero(values > 1e-9 * max(float(values[-1]), 1e-30))[::-1][:components]
    scaled = directions[:, kept] / np.sqrt(values[kept])
    basis = np.asarray(sample.T @ scaled, np.float32)
    return Compressed(basis, np.asarray(references @ basis, np.float32))
