"""Millions of real-like vectors: streets blended from descriptors of drives, and later drives through them.

A street of 200 references is a blend of two stretches of towns' day drives, number by number; a query of it
is the same blend of what two later drives (another day, rain, night, fog, dusk) saw at the same spots. So
neighbours are as alike as a drive's images are, vectors have the covariance that those of a drive have, and a
query differs from its place as a night differs from a day. Streets lie in districts, each of which has its
own mirror (signs of the principal components); without these each street would look like hundreds of others.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Vectors = NDArray[np.float32]

STREET = 200
"""References of a street, a metre each."""
DISTRICT = 100
"""Streets of a district."""
RIGHT = 20
"""References off at most, for a query to be found: metres."""


@dataclass(frozen=True)
class Drives:
    """What real drives gave: see `bench/streets.py`."""

    references: Vectors
    """(images, dimensions) of the day drives, in their order, by principal components."""
    town: NDArray[np.int64]
    """(images,) the town of each."""
    seen: NDArray[np.int64]
    """(pairs,) a reference that was seen again ..."""
    again: Vectors
    """(pairs, dimensions) ... and what was seen."""

    @classmethod
    def load(cls, file: Path) -> Drives:
        """From the file that `bench/bench_search.py --describe` writes."""
        with np.load(file) as arrays:
            return cls(arrays["references"], arrays["town"], arrays["seen"], arrays["again"])


class Streets:
    """References by their numbers: the same ones whenever they are asked for."""

    def __init__(self, drives: Drives, seed: int = 0) -> None:
        self._drives, self._seed, self._mean = drives, seed, drives.references.mean(axis=0)
        ends = np.flatnonzero(np.diff(drives.town)) + 1
        begins = np.concatenate([[0], ends])
        lengths = np.diff(np.append(begins, len(drives.town)))
        self._starts = np.concatenate(
            [np.arange(a, a + n - STREET) for a, n in zip(begins, lengths, strict=True)]
        )
        order = np.argsort(drives.seen, kind="stable")
        self._order = order
        self._first = np.searchsorted(drives.seen[order], np.arange(len(drives.town) + 1))

    def references(self, first: int, many: int) -> Vectors:
        """(many, dimensions) from a reference on; both whole numbers of streets."""
        assert first % STREET == 0
        assert many % STREET == 0
        streets = range(first // STREET, (first + many) // STREET)
        return np.concatenate([self._street(street) for street in streets])

    def queries(self, many: int, items: int, seed: int = 1) -> tuple[Vectors, NDArray[np.int64]]:
        """(many, dimensions) and the references (many,) that they see, among the first `items`."""
        rng = np.random.default_rng(seed)
        found, where = [], []
        while len(found) < many:
            item = int(rng.integers(items))
            one, other, mirror, share = self._blend(item // STREET)
            a, b = (self._seen(start + item % STREET, rng) for start in (one, other))
            if a is not None and b is not None:
                found.append(self._mixed(a, b, mirror, share))
                where.append(item)
        return np.asarray(found, np.float32), np.array(where)

    def _street(self, street: int) -> Vectors:
        one, other, mirror, share = self._blend(street)
        a, b = (self._drives.references[start : start + STREET] for start in (one, other))
        return self._mixed(a, b, mirror, share)

    def _mixed(self, one: Vectors, other: Vectors, mirror: Vectors, share: float) -> Vectors:
        """What all images have in common is neither blended nor mirrored; a blend is as long as its parts."""
        parts = np.cos(share) * (one - self._mean), np.sin(share) * (other - self._mean)
        mixed = self._mean + (parts[0] + parts[1]) * mirror
        squares = np.cos(share) ** 2 * np.square(one).sum(-1) + np.sin(share) ** 2 * np.square(other).sum(-1)
        return np.asarray(mixed * np.sqrt(squares / np.square(mixed).sum(-1))[..., None], np.float32)

    def _blend(self, street: int) -> tuple[int, int, Vectors, float]:
        """Two stretches by where they begin, the signs of the components, and how much each counts."""
        rng = np.random.default_rng((self._seed, street))
        one, other = rng.choice(self._starts, 2)
        signs = np.random.default_rng((self._seed, 1, street // DISTRICT))
        mirror = signs.choice(np.array([-1, 1], np.float32), self._drives.references.shape[1])
        return int(one), int(other), mirror, float(np.deg2rad(rng.uniform(25, 65)))

    def _seen(self, reference: int, rng: np.random.Generator) -> Vectors | None:
        """What a later drive saw of a reference; None where none did."""
        begin, end = self._first[reference], self._first[reference + 1]
        return None if begin == end else self._drives.again[self._order[rng.integers(begin, end)]]
