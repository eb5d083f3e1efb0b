"""Whether an answer is right, from what the answers around it looked like.

Signs of each answer are averaged over the images before it, and where the later ones are known, over these
too: how like the reference is, by all descriptors and by the one that verifies, how far it leads over other
places, how sure the filter is, how far off it believes the camera may be, and how sure it is of the speed.
Scores come as robust z-scores, which mean the same on any map and by any light, so that one set of weights
serves all. They are fitted on drives through other towns than the benchmark's (`evplace reproduce known`).

Where images follow one another quickly, a sum of small trees judges. Those of a slow camera tell less of how
it moves, and are less like those of the towns: they are judged by a logistic regression.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.storage import read_json

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

WEIGHTS = Path(__file__).parent / "_known.json"
LATE_SIGNS = 5
"""Signs of an answer that is given late."""
SIGNS = 6
"""Those of a live one: how sure the filter is of the speed is known as well."""
SPANS = np.array([1e-3, 3.0, 8.0, 20.0])
"""Over how many images, at ten a second and while the camera moves, each sign is averaged; an image counts
for one at most, however long ago the last one was."""
LONGER = np.array([sign * len(SPANS) + span for sign in range(LATE_SIGNS) for span in range(1, len(SPANS))])
"""Where the means over the longer spans stand, of late answers."""
LEAST_AHEAD = 0.5
"""Images that must be ahead, by their weights, for these to have a mean."""
ASKED = np.array([1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3, 1.0])
"""Shares of false accepts for which it is known what other towns need."""
TINY = 1e-3
"""What keeps log-odds finite."""


class Trees(NamedTuple):
    """A sum of trees of a depth; all branches of a level ask the same: whether a feature is above a limit."""

    start: float
    """The log-odds before any."""
    feature: Ints
    """(trees, depth)."""
    limit: Floats
    """(trees, depth)."""
    says: Floats
    """(trees, 2 ** depth) what the answers, as bits, the first the lowest, add to the log-odds."""

    def log_odds(self, features: Floats) -> Floats:
        """(n, features) -> (n,)."""
        out = np.full(len(features), self.start)
        add_trees(np.ascontiguousarray(features), self.feature, self.limit, self.says, out)
        return out


class Judges(NamedTuple):
    """What judges live answers, or late ones."""

    quick: Trees
    """Of images that follow one another quickly."""
    slow: Floats
    """(1 + features,) of others: the weights of 1 and of the features."""
    usual: Floats
    """(2, ASKED) log-odds above which so many images of places never seen lie in other towns, of a quick
    camera and of a slow one."""


def signs_of(read: Floats, speeds: Floats | None = None) -> Floats:
    """(LATE_SIGNS,) from what `read` of the filter gives: belief, likeness, best elsewhere, the likeness that
    verifies, metres; with the belief in each speed (speeds,), (SIGNS,).
    """
    belief = min(max(read[0], 0.0), 1.0)
    signs = [
        min(max(read[1], -1.0), 12.0),
        min(max(read[1] - read[2], -6.0), 8.0),
        np.log((belief + TINY) / (1 - belief + TINY)),
        min(max(read[3], -1.0), 12.0),
        np.log1p(read[4]),
    ]
    if speeds is not None:
        shares = speeds / max(float(speeds.sum()), 1e-300)
        signs.append(-float(shares @ np.log(shares + 1e-9)))
    return np.array(signs)


class Means:
    """Running means of signs, image by image."""

    def __init__(self, signs: int = SIGNS) -> None:
        self._sums = np.zeros((signs, len(SPANS)))
        self._weights = np.zeros(len(SPANS))

    def add(self, signs: Floats, weight: float) -> Floats:
        """(signs * SPANS + 1,) the means with one more image, and how much was seen, up to the longest span.

        An image that says nothing changes nothing.
        """
        weight = min(weight, 1.0)
        keep = np.exp(-weight / SPANS)
        self._sums = self._sums * keep + signs[:, None] * weight
        self._weights = self._weights * keep + weight + 1e-9
        return np.append((self._sums / self._weights).reshape(-1), self._weights[-1])


@njit(cache=True, nogil=True)
def means_of(signs: Floats, weights: Floats, spans: Floats) -> Floats:
    """(n, signs * spans + 1) as `Means` of a drive (n, signs), each up to its image."""
    n, many = signs.shape
    out = np.empty((n, many * len(spans) + 1))
    sums, total = np.zeros((many, len(spans))), np.zeros(len(spans))
    for i in range(n):
        weight = min(weights[i], 1.0)
        for s in range(len(spans)):
            keep = np.exp(-weight / spans[s])
            total[s] = total[s] * keep + weight + 1e-9
            for k in range(many):
                sums[k, s] = sums[k, s] * keep + signs[i, k] * weight
                out[i, k * len(spans) + s] = sums[k, s] / total[s]
        out[i, -1] = total[-1]
    return out


@njit(cache=True, nogil=True)
def add_trees(features: Floats, feature: Ints, limit: Floats, says: Floats, out: Floats) -> None:
    """What each of some trees says of (n, features) is added to `out` (n,)."""
    for i in range(len(features)):
        for tree in range(len(feature)):
            leaf = 0
            for level in range(feature.shape[1]):
                if features[i, feature[tree, level]] > limit[tree, level]:
                    leaf += 1 << level
            out[i] += says[tree, leaf]


def means_ahead(signs: Floats, weights: Floats) -> Floats:
    """(n, ...) the means of a drive (n, LATE_SIGNS), each from its image on, over the longer spans.

    NaN where nothing that is ahead says anything, as at a long stop.
    """
    ahead: Floats = means_of(signs[::-1].copy(), weights[::-1].copy(), SPANS[1:])[::-1]
    silent = np.cumsum(weights[::-1])[::-1] < LEAST_AHEAD
    ahead[silent] = np.nan
    return ahead


def joined(before: Floats, ahead: Floats) -> Floats:
    """(..., features) the means before and ahead; where these are not known, those before stand for them.

    Of the two sides the worse comes first, whichever it is: an answer is right where both look right, and it
    is all the same on which side a drive enters the map or leaves it. How much was seen on each comes last.
    """
    past, seen, to_come = before[..., LONGER], before[..., -1:], ahead[..., -1:]
    ahead = np.where(np.isnan(ahead[..., :-1]), past, ahead[..., :-1])
    least = before[..., :-1].copy()
    least[..., LONGER] = np.minimum(past, ahead)
    return np.concatenate([least, np.maximum(past, ahead), seen, np.nan_to_num(to_come)], axis=-1)


def of_live(signs: Floats, weights: Floats) -> Floats:
    """(n, features) what live answers (n, SIGNS) of a drive are judged by."""
    return np.asarray(means_of(signs, weights, SPANS), np.float64)


def of_late(signs: Floats, live: Floats, weights: Floats) -> Floats:
    """(n, features) the same of late answers (n, LATE_SIGNS); `live` (n, SIGNS) are those of live ones."""
    sides = joined(means_of(signs, weights, SPANS), means_ahead(signs, weights))
    return np.concatenate([sides, of_live(live, weights)], axis=1)


def probability(features: Floats, slow: Bools | bool) -> Floats:
    """(n,) that answers are right, from their features (n, features), live or late, and whether each is of a
    slow camera (n,).
    """
    live, late = judges()
    return said(live if features.shape[1] == len(live.slow) - 1 else late, features, slow)


def said(by: Judges, features: Floats, slow: Bools | bool) -> Floats:
    """(n,) the same, of what some weights say."""
    linear = by.slow[0] + features @ by.slow[1:]
    log_odds = np.where(slow, linear, by.quick.log_odds(features))
    return np.asarray(1 / (1 + np.exp(-log_odds)), np.float64)


def limit(unknown: Floats, by: Judges, slow: bool, false_accept: float) -> float:
    """The probability above which no more than a share of images of places never seen is.

    Halfway, by the log-odds, between what the map's own places tell that are cut out, (n,) sorted, and what
    other towns need: a map has few stretches, and knows one light.
    """
    own = min(max(float(np.quantile(unknown, 1 - false_accept)), 1e-9), 1 - 1e-9)
    usual = float(np.interp(np.log(false_accept), np.log(ASKED), by.usual[int(slow)]))
    return float(1 / (1 + np.exp(-(np.log(own / (1 - own)) + usual) / 2)))


@functools.cache
def judges() -> tuple[Judges, Judges]:
    """Of live answers and of late ones."""
    fitted = read_json(WEIGHTS, "the weights that tell right answers from wrong ones")
    live, late = (
        Judges(
            Trees(
                float(one["start"]),
                np.array(one["feature"], np.int64),
                np.array(one["limit"], np.float64),
                np.array(one["says"], np.float64),
            ),
            np.array(one["slow"], np.float64),
            np.array(one["usual"], np.float64),
        )
        for one in (fitted["live"], fitted["late"])
    )
    return live, late
