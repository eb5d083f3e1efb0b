"""How often the places of unseen towns are found by a single image."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evplace_lab.descriptor.bursts import Bursts

NEAR_M = 8.0
"""An answer no further away is right; where no reference is so near, the nearest one is."""
Images = NDArray[np.uint8]


class Describing(Protocol):
    """What turns images (n, h, w) into vectors."""

    def describe(self, images: Images) -> NDArray[np.float32]:
        """See `evplace.scorers.Descriptor`."""


def recalls(descriptor: Describing, bursts: Bursts) -> Iterator[float]:
    """Recall at 1 in %, a number for each sensor and drive: a route's first drive is the map.

    An image is the mean of two neighbours.
    """
    for images, poses in zip(bursts.images, bursts.poses, strict=True):
        n_drives, _, n_sensors = images.shape[:3]
        vectors = [
            [descriptor.describe(_paired(images[drive, :, k])) for k in range(n_sensors)]
            for drive in range(n_drives)
        ]
        for drive in range(1, n_drives):
            right = _right(poses[drive, 1:], poses[0, 1:])
            for query, reference in zip(vectors[drive], vectors[0], strict=True):
                yield _recall(query @ reference.T, right)


def _paired(images: Images) -> Images:
    """(n - 1, h, w) of (n, h, w): the mean of each image and the one before, rounded half up."""
    wide = images.astype(np.uint16)
    return ((wide[1:] + wide[:-1] + 1) // 2).astype(np.uint8)


def _right(query: NDArray[np.float32], reference: NDArray[np.float32]) -> NDArray[np.bool_]:
    """(queries, references) from poses (n, 3)."""
    across, along = (query[:, None, k] - reference[None, :, k] for k in (0, 1))
    apart = np.hypot(across, along)
    return np.asarray(apart <= np.maximum(NEAR_M, apart.min(axis=1, keepdims=True)))


def _recall(scores: NDArray[np.float32], right: NDArray[np.bool_]) -> float:
    return float(100 * right[np.arange(len(scores)), scores.argmax(axis=1)].mean())
