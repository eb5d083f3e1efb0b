"""Whether an answer is right, from what the answers around it looked like: a logistic regression.

Four signs of each answer are averaged over the images before it, and where the later ones are known, over
these too: how like the reference is, how far it leads over other places, whether the single image agrees with
the sequence, and how sure the filter is. Scores come as robust z-scores, which mean the same on any map and
by any light; so one set of weights serves all. They are fitted on drives through other towns than the
benchmark's (`evplace reproduce known`). What was said of an image live counts half beside what is said of it
later: by a light that is strange to the later weights it holds up better.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.matchers._known_weights import LATE, LIVE

Floats = NDArray[np.float64]

SIGNS = 4
SPANS = np.array([1e-3, 4.0, 12.0])
"""Over how many images, at ten a second and while the camera moves, each sign is averaged; an image counts
for one at most, however long ago the last one was."""
LONGER = np.array([sign * len(SPANS) + span for sign in range(SIGNS) for span in range(1, len(SPANS))])
"""Where the means over the longer spans stand."""
LEAST_AHEAD = 0.5
"""Images that must be ahead, by their weights, for these to have a mean."""


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
    """Running means of the signs, image by image."""

    def __init__(self) -> None:
        self._sums = np.zeros((SIGNS, len(SPANS)))
        self._weights = np.zeros(len(SPANS))

    def add(self, signs: Floats, weight: float) -> Floats:
        """(SIGNS * SPANS,) the means with one more image; one that says nothing changes nothing."""
        weight = min(weight, 1.0)
        keep = np.exp(-weight / SPANS)
        self._sums = self._sums * keep + signs[:, None] * weight
        self._weights = self._weights * keep + weight + 1e-9
        return np.asarray((self._sums / self._weights).reshape(-1), np.float64)


@njit(cache=True, nogil=True)
def means_of(signs: Floats, weights: Floats, spans: Floats) -> Floats:
    """(n, SIGNS * spans) the running means of a drive (n, SIGNS), each up to its image."""
    n, many = signs.shape
    out = np.empty((n, many * len(spans)))
    sums, total = np.zeros((many, len(spans))), np.zeros(len(spans))
    for i in range(n):
        weight = min(weights[i], 1.0)
        for s in range(len(spans)):
            keep = np.exp(-weight / spans[s])
            total[s] = total[s] * keep + weight + 1e-9
            for k in range(many):
                sums[k, s] = sums[k, s] * keep + signs[i, k] * weight
                out[i, k * len(spans) + s] = sums[k, s] / total[s]
    return out


def means_ahead(signs: Floats, weights: Floats) -> Floats:
    """(n, ...) the means of a drive (n, SIGNS), each from its image on, over the longer spans.

    NaN where nothing that is ahead says anything, as at a long stop.
    """
    ahead: Floats = means_of(signs[::-1].copy(), weights[::-1].copy(), SPANS[1:])[::-1]
    silent = np.cumsum(weights[::-1])[::-1] < LEAST_AHEAD
    ahead[silent] = np.nan
    return ahead


def joined(before: Floats, ahead: Floats) -> Floats:
    """(..., features) the means before and ahead; where these are not known, those before stand for them.

    Of the two sides the worse comes first, whichever it is: an answer is right where both look right, and it
    is all the same on which side a drive enters the map or leaves it.
    """
    past = before[..., LONGER]
    ahead = np.where(np.isnan(ahead), past, ahead)
    sides = [before.copy(), np.maximum(past, ahead)]
    sides[0][..., LONGER] = np.minimum(past, ahead)
    return np.concatenate(sides, axis=-1)


def of_live(signs: Floats, weights: Floats) -> Floats:
    """(n, features) what the weights are of, for all live answers (n, SIGNS) of a drive."""
    return np.asarray(means_of(signs, weights, SPANS), np.float64)


def of_late(signs: Floats, live: Floats, weights: Floats) -> Floats:
    """(n, features) the same of late answers (n, SIGNS), of images whose `live` ones had their own signs."""
    sides = joined(of_live(signs, weights), means_ahead(signs, weights))
    return np.concatenate([sides, of_live(live, weights)], axis=1)


def probability(features: Floats) -> Floats:
    """(...,) that the answers are right, from their features (..., features) live or late."""
    weights = LIVE if features.shape[-1] == len(LIVE) - 1 else LATE
    return np.asarray(1 / (1 + np.exp(-(weights[0] + features @ weights[1:]))), np.float64)
