"""Products with all references, which stay as they are: four bytes a number, all read for each query."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from evplace.searchers import Content, Found, Items, Vectors, array_of, best_of, damaged

VECTORS = "index_vectors"


@dataclass(frozen=True)
class Exact:
    """There are no settings."""

    def build(self, vectors: Vectors) -> ExactSearch:
        """See Searcher."""
        return ExactSearch(vectors)

    def open(self, content: Content) -> ExactSearch:
        """See Searcher."""
        vectors = array_of(content, VECTORS, np.float32, 2)
        if not np.isfinite(vectors).all():
            raise damaged("it holds NaN or infinity")
        return ExactSearch(vectors)


class ExactSearch:
    """See Searching."""

    compares_all = True

    def __init__(self, vectors: Vectors) -> None:
        self._vectors = vectors
        self.items, self.dimensions = vectors.shape

    def rows(self, vectors: Vectors) -> Vectors:
        """See Searching."""
        return np.asarray(vectors @ self._vectors.T, np.float32)

    def top(self, vectors: Vectors, many: int) -> Found:
        """See Searching."""
        return top_of(self.rows(vectors), many)

    def scores(self, vectors: Vectors, items: Items) -> Vectors:
        """See Searching."""
        return np.asarray(vectors @ self._vectors[items].T, np.float32)

    def add(self, vectors: Vectors) -> None:
        """See Searching."""
        self._vectors = np.concatenate([self._vectors, vectors])
        self.items = len(self._vectors)

    def content(self) -> Content:
        """See Searching."""
        return {VECTORS: self._vectors}


def top_of(rows: Vectors, many: int) -> Found:
    """The best of whole rows (n, items)."""
    many = min(many, rows.shape[1])
    items = np.argpartition(-rows, many - 1, axis=1)[:, :many]
    return best_of(items, np.take_along_axis(rows, items, 1), many)
