"""Vectors in small numbers: turned so that no direction holds more than another, then rounded.

Directions that differ much, as principal components do, would waste the numbers of those that differ little.
A turn changes no product; nor does what is taken off all references change which of them is largest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.searchers import Content, Vectors, array_of, damaged

STEPS = 127
"""The largest small number."""
SAMPLED = 20_000
"""Vectors that the mean and the largest number are taken from, about."""
MEAN, TURN, STEP = "index_mean", "index_turn", "index_step"


@dataclass(frozen=True, eq=False)
class Turned:
    """How the vectors of a map become small numbers."""

    mean: Vectors
    """(dimensions,) of the references."""
    turn: Vectors
    """(dimensions, dimensions) orthonormal."""
    step: float
    """What 1 stands for."""

    @classmethod
    def of(cls, vectors: Vectors) -> Turned:
        """Of references; the turn is drawn once and for all."""
        some = vectors[:: max(len(vectors) // SAMPLED, 1)].astype(np.float32)
        dimensions = some.shape[1]
        drawn = np.random.default_rng(0).standard_normal((dimensions, dimensions))
        mean, turn = some.mean(axis=0), np.asarray(np.linalg.qr(drawn)[0], np.float32)
        largest = float(np.abs((some - mean) @ turn).max())
        return cls(mean, turn, largest / STEPS if largest > 0 else 1.0)

    @classmethod
    def read(cls, content: Content) -> Turned:
        """What `content` gave; PlaceMapError where it is not such."""
        mean, turn = array_of(content, MEAN, np.float32, 1), array_of(content, TURN, np.float32, 2)
        step = array_of(content, STEP, np.float64, 1)
        if turn.shape != (len(mean), len(mean)) or not (np.isfinite(step).all() and step[0] > 0):
            raise damaged("its turn does not fit")
        return cls(np.array(mean), np.array(turn), float(step[0]))

    @property
    def content(self) -> dict[str, NDArray[np.floating]]:
        """What `read` needs."""
        return {MEAN: self.mean, TURN: self.turn, STEP: np.array([self.step])}

    def references(self, vectors: Vectors) -> Vectors:
        """(n, dimensions) turned, around what all have in common."""
        return np.asarray((vectors - self.mean) @ self.turn, np.float32)

    def small(self, vectors: Vectors) -> NDArray[np.int8]:
        """(n, dimensions) of references."""
        return rounded(self.references(vectors) / np.float32(self.step))

    def queries(self, vectors: Vectors) -> tuple[Vectors, Vectors]:
        """(n, dimensions) whose product with small numbers, and (n,) what must be added to it, is a score."""
        return np.asarray(vectors @ self.turn * self.step, np.float32), vectors @ self.mean


def rounded(values: Vectors) -> NDArray[np.int8]:
    """The nearest small numbers."""
    return np.clip(np.rint(values), -STEPS, STEPS).astype(np.int8)


def bits(turned: NDArray[Any]) -> NDArray[np.uint64]:
    """(n, words) the sign of each number as a bit, 0 beyond the last."""
    packed = np.packbits(turned > 0, axis=1)
    padded = np.zeros((len(packed), -(-packed.shape[1] // 8) * 8), np.uint8)
    padded[:, : packed.shape[1]] = packed
    return padded.view(np.uint64)
