"""Which references a query's vector is like: one small interface, whatever the references are kept as."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Search(Protocol):
    """Compares vectors with those of all references."""

    def rows(self, vectors: NDArray[np.float32]) -> NDArray[np.float32]:
        """(n, dimensions) -> (n, items) scores, larger is better."""


class Exact:
    """Products with all references, which stay as they are."""

    def __init__(self, references: NDArray[np.float32]) -> None:
        """Over the references' vectors (items, dimensions)."""
        self._references = references

    def rows(self, vectors: NDArray[np.float32]) -> NDArray[np.float32]:
        """See Search."""
        rows: NDArray[np.float32] = vectors @ self._references.T
        return rows
