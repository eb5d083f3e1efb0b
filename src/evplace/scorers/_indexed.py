"""Several descriptors' vectors side by side in one index, and what is usual told by a few references.

Scores of a descriptor become z-scores by the median and spread of a row, and these are told by every so
many-th reference of it (`core/zscores.py`): by some 2000 of them, however long the row. So z-scores need no
whole row. The sum of z-scores of all descriptors is one product of vectors that hold theirs side by side.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.zscores import ordered, robust_z, scale_of
from evplace.scorers import Content, Descriptor, Rows, Scored, Vectors
from evplace.scorers._compressed import Compressed
from evplace.searchers import array_of, damaged, kept, opened

TOLD = 64
"""References whose own rows tell how much the scores of a descriptor usually spread."""
LISTED = 1000
"""References that a row names where an index gives the best ones; all others count as usual."""
SPREADS = "spreads"


class Scale(NamedTuple):
    """What makes a z-score of what the descriptors score."""

    factors: tuple[float, ...]
    """What the score of each descriptor counts."""
    shift: float
    """What is taken off their sum."""


class _Asked(NamedTuple):
    """What an index is asked of an image."""

    pairs: tuple[tuple[Vectors, float], tuple[Vectors, float]]
    """(1, dimensions) for all descriptors, and what is taken off their scores to make z-scores; then the same
    for the first alone."""
    usual: tuple[Vectors, Vectors]
    """z-scores of the references that tell what is usual, by all descriptors and by the first."""


def scale(usual: list[Vectors], weights: list[float]) -> Scale:
    """From the scores (n,) of the references that tell what is usual, by each descriptor."""
    factors, total, shift = [], np.zeros(len(usual[0]), np.float32), 0.0
    for scores, weight in zip(usual, weights, strict=True):
        middle, spread = scale_of(scores)
        factor = weight / spread if spread else 0.0
        factors.append(factor)
        total += np.float32(factor) * (scores - middle)
        shift += factor * float(middle)
    middle, spread = scale_of(total)
    last = 1 / spread if spread else 0.0
    return Scale(tuple(factor * last for factor in factors), (shift + float(middle)) * last)


def indexed(found: Mapping[str, Compressed], weights: Mapping[str, float], searcher: str) -> dict[str, Any]:
    """The content of a map whose references are searched by an index."""
    items = len(next(iter(found.values())).vectors)
    usual = {name: one.vectors[ordered(items)] for name, one in found.items()}
    spreads = np.array([_spread(one.vectors, usual[name]) for name, one in found.items()], np.float32)
    counts = [weights[name] / spread for name, spread in zip(found, spreads, strict=True)]
    beside = [np.float32(count) * one.vectors for count, one in zip(counts, found.values(), strict=True)]
    part = families.make("searchers", searcher)
    content: dict[str, Any] = {SPREADS: spreads}
    for name, one in found.items():
        content |= {f"{name}_basis": one.basis, f"{name}_usual": usual[name]}
    return content | kept(part, part.build(np.concatenate(beside, axis=1)))


class IndexedRows:
    """See OpenScorer, ComparesSome and Verifies."""

    distances = False

    def __init__(
        self, parts: Mapping[str, Descriptor], weights: Mapping[str, float], content: Content, items: int
    ) -> None:
        """Over what `indexed` gave; PlaceMapError where it is not such, or not of so many items."""
        self._parts, self._items = parts, items
        self._weights = [weights[name] for name in parts]
        self._spreads = _floats(content, SPREADS, (len(parts),))
        self._bases = [_floats(content, f"{name}_basis", (None, None)) for name in parts]
        many = len(range(items)[ordered(items)])
        self._usual = [
            _floats(content, f"{name}_usual", (many, basis.shape[1]))
            for name, basis in zip(parts, self._bases, strict=True)
        ]
        self._search = opened(content, items, sum(basis.shape[1] for basis in self._bases))

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """See OpenScorer; of references that are not listed it says that they are usual, 0."""
        return self.scored(images).rows

    def some(self, images: NDArray[np.uint8], items: NDArray[np.int64]) -> Rows:
        """See ComparesSome."""
        return self.scored(images, items).rows

    def scored(self, images: NDArray[np.uint8], items: NDArray[np.int64] | None = None) -> Scored:
        """See Verifies."""
        asked = [self._asked(images[at : at + 1]) for at in range(len(images))]
        pairs = [self._row(one) if items is None else self._some(one, items) for one in asked]
        return Scored(*(np.stack(rows) for rows in zip(*pairs, strict=True)))

    def _some(self, asked: _Asked, items: NDArray[np.int64]) -> tuple[Vectors, Vectors]:
        """(len(items),) of all descriptors, and of the first."""
        row, verifying = (
            self._search.scores(query, items)[0] - np.float32(shift) for query, shift in asked.pairs
        )
        return row, verifying

    def _row(self, asked: _Asked) -> tuple[Vectors, Vectors]:
        """(items,) the same of all."""
        if self._search.compares_all:
            whole, alone = (self._search.rows(query)[0] - np.float32(shift) for query, shift in asked.pairs)
            return whole, alone
        row, verifying = np.zeros(self._items, np.float32), np.zeros(self._items, np.float32)
        row[ordered(self._items)], verifying[ordered(self._items)] = asked.usual
        (query, shift), (alone, alone_shift) = asked.pairs
        (items,), (scores,) = self._search.top(query, LISTED)
        row[items] = scores - np.float32(shift)
        verifying[items] = self._search.scores(alone, items)[0] - np.float32(alone_shift)
        return row, verifying

    def _asked(self, image: NDArray[np.uint8]) -> _Asked:
        described = [
            part.describe(image) @ basis
            for part, basis in zip(self._parts.values(), self._bases, strict=True)
        ]
        scores = [one.dot(usual.T)[0] for one, usual in zip(described, self._usual, strict=True)]
        by = scale(scores, self._weights)
        beside = [
            np.float32(factor * spread / weight) * one
            for factor, spread, weight, one in zip(
                by.factors, self._spreads, self._weights, described, strict=True
            )
        ]
        usual = sum(np.float32(factor) * one for factor, one in zip(by.factors, scores, strict=True))
        alone = scale(scores[:1], self._weights[:1])
        verifying = [np.zeros_like(one) for one in beside]
        verifying[0] = np.float32(alone.factors[0] * self._spreads[0] / self._weights[0]) * described[0]
        pairs = (np.concatenate(beside, axis=1), by.shift), (np.concatenate(verifying, axis=1), alone.shift)
        return _Asked(pairs, (np.asarray(usual - np.float32(by.shift), np.float32), robust_z(scores[0])))


def _spread(vectors: Vectors, usual: Vectors) -> float:
    """How much the scores of a descriptor usually spread; 1 where they do not."""
    some = vectors[:: max(len(vectors) // TOLD, 1)] @ usual.T
    return float(np.median([scale_of(row)[1] for row in some])) or 1.0


def _floats(content: Content, name: str, shape: tuple[int | None, ...]) -> Vectors:
    """A small array of a map, in memory; PlaceMapError where it is not such."""
    held = np.array(array_of(content, name, np.float32, len(shape)))
    if any(wanted not in (None, side) for side, wanted in zip(held.shape, shape, strict=True)):
        raise damaged(f"'{name}' of shape {held.shape} does not fit the references")
    if not np.isfinite(held).all():
        raise damaged(f"'{name}' holds NaN or infinity")
    return held
