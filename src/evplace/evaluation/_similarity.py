"""The matrix of similarities between a drive and a map, small enough to look at and to keep."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

MOST = (320, 240)
"""Queries and groups of items that are shown at most."""
SPAN = 6.0
"""Robust deviations above a row's median that are white."""


def similarities(scores: NDArray[np.floating[Any]]) -> NDArray[np.uint8] | None:
    """(at most 320, at most 240) of scores (queries, items): how far each stands out in its row, 0 to 255.

    Some queries, evenly; of neighbouring items the best. A row without any difference is 0. None for none.
    """
    queries, items = scores.shape
    if not queries or not items:
        return None
    chosen = np.unique(np.linspace(0, queries - 1, min(queries, MOST[0])).astype(np.int64))
    starts = np.unique(np.linspace(0, items, min(items, MOST[1]), endpoint=False).astype(np.int64))
    rows = np.asarray(scores[chosen], np.float32)
    above = rows - np.median(rows, axis=1, keepdims=True)
    spread = np.median(np.abs(above), axis=1, keepdims=True)
    outstanding = np.divide(above, 1.4826 * spread, out=np.zeros_like(above), where=spread > 0)
    best = np.maximum.reduceat(outstanding, starts, axis=1)
    return np.round(255 * np.clip(best / SPAN, 0, 1)).astype(np.uint8)
