"""Whether an answer is right, from what the answers around it looked like: a logistic regression.

Four signs of each answer are averaged over the images before it, and where the later ones are known, over
these too: how like the reference is, how far it leads over other places, whether the single image agrees with
the sequence, and how sure the filter is. Scores come as robust z-scores, which mean the same on any map and
by any light; so one set of weights serves all. They are fitted on drives through other towns than the
benchmark's.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

SIGNS = 4
SPANS = np.array([1e-3, 4.0, 12.0])
"""Over how many images, at ten a second and while the camera moves, the signs are averaged."""
LATER = (1, 2)
"""Of these, which also look ahead."""
LIVE = np.zeros(1 + SIGNS * len(SPANS))
"""Weights where nothing later is known: of 1, then for each sign its means over SPANS."""
LATE = np.zeros(1 + SIGNS * (len(SPANS) + len(LATER)))
"""Weights where what comes later is known, too: of 1, then for each sign its means, then those ahead."""


def signs_of(read: Floats) -> Floats:
    """(SIGNS,) from what `read` of the filter gives: belief, likeness, best elsewhere, agreement."""
    belief = min(max(read[0], 0.0), 1.0)
    return np.array(
        [
            min(max(read[1], -1.0), 12.0),
            min(max(read[1] - read[2], -6.0), 8.0),
            read[3],
            np.log((belief + 1e-3) / (1 - belief + 1e-3)),
        ]
    )


class Means:
    """Running means of the signs."""

    def __init__(self) -> None:
        self._sums = np.zeros((SIGNS, len(SPANS)))
        self._weights = np.zeros(len(SPANS))

    def add(self, signs: Floats, weight: float) -> Floats:
        """(SIGNS, SPANS) the means with one more image; one that says nothing changes nothing."""
        keep = np.exp(-weight / SPANS)
        self._sums = self._sums * keep + signs[:, None] * weight
        self._weights = self._weights * keep + weight + 1e-9
        return self._sums / self._weights


@njit(cache=True, nogil=True)
def means_ahead(signs: Floats, weights: Floats, spans: Floats) -> Floats:
    """(n, SIGNS, spans) means of each image (n, SIGNS) and those after it."""
    n, many = signs.shape
    out = np.empty((n, many, len(spans)))
    sums, total = np.zeros((many, len(spans))), np.zeros(len(spans))
    for i in range(n - 1, -1, -1):
        for s in range(len(spans)):
            keep = np.exp(-weights[i] / spans[s])
            total[s] = total[s] * keep + weights[i] + 1e-9
            for k in range(many):
                sums[k, s] = sums[k, s] * keep + signs[i, k] * weights[i]
                out[i, k, s] = sums[k, s] / total[s]
    return out


def features(signs: Floats, weight: Floats, late: bool) -> Floats:
    """(n, features) what the weights are of, for all answers (n, SIGNS) of a drive."""
    means = Means()
    before = np.array([means.add(one, w) for one, w in zip(signs, weight, strict=True)])
    parts = [before, means_ahead(signs, weight, SPANS[list(LATER)])] if late else [before]
    return np.concatenate(parts, axis=2).reshape(len(signs), -1)


def probability(features: Floats) -> Floats:
    """(n,) that the answers are right, from their features (n, ...) live or late."""
    weights = LIVE if features.shape[-1] == len(LIVE) - 1 else LATE
    return np.asarray(1 / (1 + np.exp(-(weights[0] + features @ weights[1:]))), np.float64)
