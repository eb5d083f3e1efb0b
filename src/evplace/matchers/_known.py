"""Whether an answer is right, from what the answers around it looked like: a logistic regression.

Four signs of each answer are averaged over the images before it, and where the later ones are known, over
these too: how like the reference is, how far it leads over other places, whether the single image agrees with
the sequence, and how sure the filter is. What they are worth depends on how well the drive is recognised as a
whole, by night less than by day: so each also enters times the drive's usual likeness, and times its usual
agreement. Scores come as robust z-scores, which mean the same on any map and by any light; one set of weights
serves all. They are fitted on drives through other towns than the benchmark's (`evplace reproduce known`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from evplace.matchers._known_weights import LATE, LIVE

Floats = NDArray[np.float64]

SIGNS = 4
LIKENESS, AGREEMENT = 0, 2
"""Signs by their place."""
SPANS = (1e-3, 4.0, 12.0)
"""Over how many images, at ten a second and while the camera moves, each sign is averaged."""
USUAL_LIKENESS, USUAL_AGREEMENT = 5.5, 0.5
"""Where a drive begins."""


class Columns(NamedTuple):
    """Running means: of which sign, over how many images, from what value that counts as how many images."""

    sign: NDArray[np.int64]
    span: Floats
    start: Floats
    started: Floats
    where_agreed: NDArray[np.bool_]
    """Whether only images count that agree with the sequence."""


def _columns(spans: tuple[float, ...]) -> Columns:
    """Each sign over each span; the drive's usual likeness where images agree; its usual agreement."""
    many = SIGNS * len(spans)
    return Columns(
        np.array([*np.repeat(np.arange(SIGNS), len(spans)), LIKENESS, AGREEMENT]),
        np.array([*spans * SIGNS, 100.0, 60.0]),
        np.array([*[0.0] * many, USUAL_LIKENESS, USUAL_AGREEMENT]),
        np.array([*[0.0] * many, 10.0, 10.0]),
        np.array([*[False] * many, True, False]),
    )


BEFORE, AHEAD = _columns(SPANS), _columns(SPANS[1:])
"""What is averaged of the images up to an answer, and of those from it on."""


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
    """The means of BEFORE, image by image."""

    def __init__(self) -> None:
        self._sums = BEFORE.start * BEFORE.started
        self._weights = BEFORE.started.copy()

    def add(self, signs: Floats, weight: float) -> Floats:
        """(columns,) the means with one more image; one that says nothing changes nothing."""
        _add(self._sums, self._weights, signs, weight, BEFORE)
        return self._sums / self._weights


@njit(cache=True, nogil=True)
def _add(sums: Floats, weights: Floats, signs: Floats, weight: float, columns: Columns) -> None:
    for c in range(len(sums)):
        own = weight * signs[AGREEMENT] if columns.where_agreed[c] else weight
        keep = np.exp(-own / columns.span[c])
        sums[c] = sums[c] * keep + signs[columns.sign[c]] * own
        weights[c] = weights[c] * keep + own + 1e-9


@njit(cache=True, nogil=True)
def means_of(signs: Floats, weights: Floats, columns: Columns) -> Floats:
    """(n, columns) the running means of a drive (n, SIGNS), each up to its image."""
    out = np.empty((len(signs), len(columns.span)))
    sums, totals = columns.start * columns.started, columns.started.copy()
    for i in range(len(signs)):
        _add(sums, totals, signs[i], weights[i], columns)
        out[i] = sums / totals
    return out


def means_ahead(signs: Floats, weights: Floats) -> Floats:
    """(n, columns of AHEAD) the means of a drive (n, SIGNS), each from its image on."""
    ahead: Floats = means_of(signs[::-1].copy(), weights[::-1].copy(), AHEAD)[::-1]
    return ahead


def features(before: Floats, ahead: Floats | None = None) -> Floats:
    """(..., features) what the weights are of, from the means before an answer and, if known, those ahead."""
    means, usual = before[..., :-2], before[..., -2:]
    if ahead is not None:
        means = np.concatenate([means, ahead[..., :-2]], axis=-1)
        usual = (usual + ahead[..., -2:]) / 2
    parts = [means]
    for at, middle in enumerate((USUAL_LIKENESS, USUAL_AGREEMENT)):
        off = usual[..., at : at + 1] - middle
        parts += [off, means * off]
    return np.concatenate(parts, axis=-1)


def of_drive(signs: Floats, weights: Floats, late: bool) -> Floats:
    """(n, features) of all answers (n, SIGNS) of a drive."""
    before = means_of(signs, weights, BEFORE)
    return features(before, means_ahead(signs, weights) if late else None)


def probability(of: Floats) -> Floats:
    """(...,) that the answers are right, from their features (..., features) live or late."""
    weights = LIVE if of.shape[-1] == len(LIVE) - 1 else LATE
    return np.asarray(1 / (1 + np.exp(-(weights[0] + of @ weights[1:]))), np.float64)
