"""Candidates for a lost graph matcher in a large map: references that share rare features with the query.

After the dimension hashing of Vysotska and Stachniss ("Relocalization under substantial appearance changes
using hashing", 2017): an inverted index over the bits of the features, votes weighted by their rarity.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from evplace.core.errors import ScoresError
from evplace.matchers import Row

Features = NDArray[Any]
"""(images, dimensions), one feature vector an image; the image's own pixels will do."""


class HashRelocaliser:
    """What `Graph.relocaliser` can be: looks at the query's feature, not at its scores."""

    def __init__(self, references: Features, queries: Features) -> None:
        if references.ndim != 2 or queries.ndim != 2 or references.shape[1] != queries.shape[1]:
            raise ScoresError(
                f"features are (images, dimensions) alike, not {references.shape} and {queries.shape}"
            )
        self._queries = queries
        self._members = np.ascontiguousarray(bits(references).T)
        count = self._members.sum(1)
        self._weight = np.log(len(references) / np.maximum(count, 1))

    def __call__(self, query: int, row: Row) -> NDArray[np.int64]:  # noqa: ARG002 - a Relocaliser's signature
        """The references whose votes lie in the upper 30 % of their range, rising."""
        dimensions = np.flatnonzero(bits(self._queries[query : query + 1])[0])
        votes = _votes(self._members, self._weight, dimensions)
        return np.flatnonzero(votes >= votes.min() + 0.7 * (votes.max() - votes.min()))


def bits(features: Features) -> NDArray[np.bool_]:
    """Which dimensions lie in the upper half of each vector's own range; a flat vector has none."""
    values = features.astype(np.float64)
    least, most = values.min(1, keepdims=True), values.max(1, keepdims=True)
    scaled = 255 * (values - least) / np.where(most > least, most - least, 1)
    high: NDArray[np.bool_] = np.floor(scaled) >= 127
    return high


@njit(cache=True)
def _votes(
    members: NDArray[np.bool_], weight: NDArray[np.float64], dimensions: NDArray[np.int64]
) -> NDArray[np.float64]:
    votes = np.zeros(members.shape[1])
    for dimension in dimensions:
        for reference in range(members.shape[1]):
            votes[reference] += weight[dimension] * members[dimension, reference]
    return votes
