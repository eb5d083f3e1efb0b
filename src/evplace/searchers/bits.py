"""One bit a number, compared by counting those that differ; the nearest are compared again, by bytes.

Of a million references of 256 numbers 32 MB are read for each query. The bytes, eight times as many, are read
for the nearest alone: they may stay on the disk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.searchers import Content, Found, Items, Vectors, array_of, best_of, damaged
from evplace.searchers._loops import CHUNK, nearest
from evplace.searchers._turned import Turned
from evplace.searchers._turned import bits as bits_of
from evplace.searchers.int8 import Int8Search, read, small_of

BITS = "index_bits"


@dataclass(frozen=True)
class Bits:
    """How many of the nearest are compared again."""

    candidates: int = 300
    """References that differ in the fewest bits and are compared by bytes, at least: of a million the best
    one was among so many in 99.9 % of the queries (ours)."""

    def __post_init__(self) -> None:
        if self.candidates < 1:
            raise SettingsError(f"'candidates' of bits is 1 or more, not {self.candidates}")

    def build(self, vectors: Vectors) -> BitsSearch:
        """See Searcher."""
        turned = Turned.of(vectors)
        small = small_of(turned, vectors)
        return BitsSearch(self, turned, small, _signs(small))

    def open(self, content: Content) -> BitsSearch:
        """See Searcher."""
        turned, small = read(content)
        signs = array_of(content, BITS, np.uint64, 2)
        if signs.shape != (len(small), -(-small.shape[1] // 64)):
            raise damaged("its bits do not fit its bytes")
        return BitsSearch(self, turned, small, signs)


class BitsSearch:
    """See Searching."""

    compares_all = False

    def __init__(
        self, settings: Bits, turned: Turned, small: NDArray[np.int8], signs: NDArray[np.uint64]
    ) -> None:
        self._settings, self._turned, self._signs = settings, turned, signs
        self._bytes = Int8Search(turned, small)
        self.items, self.dimensions = small.shape

    def rows(self, vectors: Vectors) -> Vectors:
        """See Searching."""
        return self._bytes.rows(vectors)

    def top(self, vectors: Vectors, many: int) -> Found:
        """See Searching."""
        many = min(many, self.items)
        near = [self._near(one, max(many, self._settings.candidates)) for one in self._signs_of(vectors)]
        found = [
            best_of(items[None], self.scores(one[None], items), many)
            for one, items in zip(vectors, near, strict=True)
        ]
        return Found(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def scores(self, vectors: Vectors, items: Items) -> Vectors:
        """See Searching."""
        return self._bytes.scores(vectors, items)

    def add(self, vectors: Vectors) -> None:
        """See Searching."""
        self._signs = np.concatenate([self._signs, _signs(small_of(self._turned, vectors))])
        self._bytes.add(vectors)
        self.items = self._bytes.items

    def content(self) -> Content:
        """See Searching."""
        return {**self._bytes.content(), BITS: self._signs}

    def _signs_of(self, vectors: Vectors) -> NDArray[np.uint64]:
        return bits_of(self._turned.references(vectors))

    def _near(self, signs: NDArray[np.uint64], many: int) -> Items:
        """The `many` references that differ in the fewest bits, in their order."""
        items, apart = np.empty(4 * many + CHUNK, np.int64), np.empty(4 * many + CHUNK, np.int32)
        counts, state = np.zeros(64 * len(signs) + 1, np.int64), np.array([0, 64 * len(signs) + 1])
        nearest(signs, self._signs, 0, many, items, apart, counts, state)
        return np.sort(items[: state[0]])


def _signs(small: NDArray[np.int8]) -> NDArray[np.uint64]:
    return bits_of(small)
