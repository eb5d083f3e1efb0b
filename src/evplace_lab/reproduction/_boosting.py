"""Gradient boosting of symmetric trees: a sum that tells right from wrong, of branches that ask alike.

Each tree is fitted to what those before it leave over, by Newton's step (Friedman 2001); all branches of a
level ask the same question (as in Prokhorenkova et al. 2018), so that a tree is a few numbers and has no
structure to be stored. Libraries that do this bring a hundred megabytes and more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.matchers._known import Trees

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bins = NDArray[np.uint8]

TREES, DEPTH = 150, 4
RATE = 0.1
"""What a tree counts of its step."""
BINS = 64
"""Limits of a feature that are tried: its quantiles."""
RIDGE = 10.0
"""Penalty on what a leaf says."""
LEAST = 50.0
"""Weight that both sides of a branch need: about four answers of which nothing is known weigh 1."""


def boosted(features: Floats, right: Floats) -> Trees:
    """The sum of trees that tells (n,) 0 or 1 from (n, features)."""
    limits = [np.unique(np.quantile(column, np.linspace(0, 1, BINS + 1)[1:-1])) for column in features.T]
    bins = np.stack(
        [np.searchsorted(of, column) for of, column in zip(limits, features.T, strict=True)], axis=1
    ).astype(np.uint8)
    start = float(np.log(right.mean() / (1 - right.mean())))
    said = np.full(len(right), start)
    trees = [_tree(bins, limits, right, said) for _ in range(TREES)]
    feature, limit, says = (np.array(one) for one in zip(*trees, strict=True))
    return Trees(start, feature, limit, says)


def _tree(bins: Bins, limits: list[Floats], right: Floats, said: Floats) -> tuple[Ints, Floats, Floats]:
    """One more: its features, its limits, and what its leaves say, which is added to `said`."""
    likely = 1 / (1 + np.exp(-said))
    slope, bend = right - likely, likely * (1 - likely)
    leaf = np.zeros(len(right), np.int64)
    asked = []
    for level in range(DEPTH):
        feature, at = _question(bins, leaf, slope, bend, level, limits)
        leaf += (1 << level) * (bins[:, feature] > at)
        asked.append((feature, limits[feature][at]))
    sums = [np.bincount(leaf, values, minlength=1 << DEPTH) for values in (slope, bend)]
    says = RATE * sums[0] / (sums[1] + RIDGE)
    said += says[leaf]
    feature_of, limit_of = zip(*asked, strict=True)
    return np.array(feature_of), np.array(limit_of), says


def _question(
    bins: Bins, leaf: Ints, slope: Floats, bend: Floats, level: int, limits: list[Floats]
) -> tuple[int, int]:
    """The feature and the number of its limit that leave least over, in all branches together."""
    slopes, bends = _sums(bins, leaf, slope, bend, 1 << level)
    below = [np.cumsum(sums, axis=2) for sums in (slopes, bends)]
    whole = [sums[:, :, -1:] for sums in below]
    above = [all_ - low for all_, low in zip(whole, below, strict=True)]
    gains = _gain(*below) + _gain(*above) - _gain(*whole)
    gains[(below[1] < LEAST) | (above[1] < LEAST)] = 0
    total = gains.sum(axis=1)
    for feature, of in enumerate(limits):
        total[feature, len(of) :] = -1
    best = int(total.argmax())
    return best // total.shape[1], best % total.shape[1]


def _gain(slopes: Floats, bends: Floats) -> Floats:
    return np.asarray(slopes**2 / (bends + RIDGE), np.float64)


@njit(cache=True, nogil=True)
def _sums(bins: Bins, leaf: Ints, slope: Floats, bend: Floats, leaves: int) -> tuple[Floats, Floats]:
    """(features, leaves, BINS) the sums of slopes and of bends in each bin."""
    n, features = bins.shape
    slopes, bends = np.zeros((features, leaves, BINS)), np.zeros((features, leaves, BINS))
    for i in range(n):
        for feature in range(features):
            at = bins[i, feature]
            slopes[feature, leaf[i], at] += slope[i]
            bends[feature, leaf[i], at] += bend[i]
    return slopes, bends
