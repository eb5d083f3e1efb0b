"""Products with all references in numbers of one byte: a quarter of the memory, hardly less exact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.searchers import Content, Found, Items, Vectors, array_of, damaged
from evplace.searchers._loops import products
from evplace.searchers._turned import Turned
from evplace.searchers.exact import top_of

SMALL = "index_small"


@dataclass(frozen=True)
class Int8:
    """There are no settings."""

    def build(self, vectors: Vectors) -> Int8Search:
        """See Searcher."""
        turned = Turned.of(vectors)
        return Int8Search(turned, small_of(turned, vectors))

    def open(self, content: Content) -> Int8Search:
        """See Searcher."""
        return Int8Search(*read(content))


class Int8Search:
    """See Searching."""

    compares_all = True

    def __init__(self, turned: Turned, small: NDArray[np.int8]) -> None:
        self._turned, self._small = turned, small
        self.items, self.dimensions = small.shape

    def rows(self, vectors: Vectors) -> Vectors:
        """See Searching."""
        queries, more = self._turned.queries(vectors)
        out = np.empty((len(vectors), self.items), np.float32)
        for query, row in zip(queries, out, strict=True):
            products(query, self._small, row)
        return out + more[:, None]

    def top(self, vectors: Vectors, many: int) -> Found:
        """See Searching."""
        return top_of(self.rows(vectors), many)

    def scores(self, vectors: Vectors, items: Items) -> Vectors:
        """See Searching."""
        queries, more = self._turned.queries(vectors)
        return np.asarray(queries @ self._small[items].T.astype(np.float32) + more[:, None], np.float32)

    def add(self, vectors: Vectors) -> None:
        """See Searching."""
        self._small = np.concatenate([self._small, small_of(self._turned, vectors)])
        self.items = len(self._small)

    def content(self) -> Content:
        """See Searching."""
        return {**self._turned.content, SMALL: self._small}


BLOCK = 20_000
"""References that are turned at once."""


def small_of(turned: Turned, vectors: Vectors) -> NDArray[np.int8]:
    """(n, dimensions) of many references: hardly more memory is needed than is kept."""
    small = np.empty(vectors.shape, np.int8)
    for start in range(0, len(vectors), BLOCK):
        small[start : start + BLOCK] = turned.small(vectors[start : start + BLOCK])
    return small


def read(content: Content) -> tuple[Turned, NDArray[np.int8]]:
    """What was kept of small numbers; PlaceMapError where it is not such."""
    turned, small = Turned.read(content), array_of(content, SMALL, np.int8, 2)
    if small.shape[1] != len(turned.mean):
        raise damaged("its numbers do not fit its turn")
    return turned, small
