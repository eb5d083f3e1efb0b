"""Samples: a few queries of a result with their images, so that a person sees what was matched with what."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

Images = NDArray[np.uint8]
"""(n, h, w) or (n, h, w, C)."""
ItemImages = Callable[[NDArray[np.int64]], Images]
"""Map items (n,) -> an image of each."""

MANY = 8
"""Queries in a sample."""
COLUMNS = ("query", "matched", "true")
"""Images of a query: its own, that of the item answered, that of the right item nearest to it."""


@dataclass(frozen=True, eq=False)
class Samples:
    """Images of some queries."""

    query: NDArray[np.int64]
    """(n,) which queries."""
    images: Images
    """(n, 3, h, w) or (n, 3, h, w, C) the images of COLUMNS; black where there is none."""

    @classmethod
    def of(cls, query: Sequence[int], images: NDArray[Any]) -> Self:
        """Samples as they were saved; ValueError where the parts do not fit."""
        chosen = np.array(query, np.int64)
        fits = images.dtype == np.uint8 and images.ndim in (4, 5) and images.shape[1] == len(COLUMNS)
        if not (fits and chosen.shape == images.shape[:1] and np.all(chosen >= 0)):
            raise ValueError(f"samples of shape {images.shape} for {chosen.shape} queries")
        return cls(chosen, images)


def choose(outcome: NDArray[np.int64], many: int = MANY) -> NDArray[np.int64]:
    """(at most `many`,) queries spread evenly over the drive, with outcomes (queries,) in turn.

    One of each stretch of the drive: the one nearest to its middle that came out as wanted. Right, wrong and
    rejected are wanted in turn; a stretch without the wanted one gives the next. Negative outcomes are not
    judged and never chosen.
    """
    kinds = np.minimum(outcome, 2)  # both sorts of rejected are one
    chosen = []
    for number, stretch in enumerate(np.array_split(np.arange(len(outcome)), many)):
        nearest_first = (
            stretch[np.argsort(np.abs(stretch - stretch.mean()), kind="stable")] if len(stretch) else stretch
        )
        for kind in ((number + step) % 3 for step in range(3)):
            found = nearest_first[kinds[nearest_first] == kind]
            if len(found):
                chosen.append(found[0])
                break
    return np.array(chosen, np.int64)


def pictures(query: Images, matched: NDArray[np.int64], true: NDArray[np.int64], of: ItemImages) -> Images:
    """(n, 3, ...) images `query` (n, ...) beside those of the items `matched`, `true` (n,); -1 for none."""
    shown = np.zeros((len(query), len(COLUMNS), *query.shape[1:]), np.uint8)
    shown[:, 0] = query
    for column, items in ((1, matched), (2, true)):
        known = items >= 0
        shown[known, column] = of(items[known])
    return shown
