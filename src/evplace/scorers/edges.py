"""What the edges of an image look like, without training: made for places that look otherwise by night.

An image is described twice: by its values against their own surroundings (local contrast), and by the
directions of its edges in small cells (histograms of oriented gradients, Dalal and Triggs 2005). Both forget
how strong the light was, which is what differs between day and night.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import SettingsError
from evplace.scorers._reduction import blurred, grey, reduced, reduction, unit

Values = NDArray[np.float32]
"""(n, h, w)."""
FEW_PIXELS = 600
"""An image of fewer has none to spare: it is not smoothed, and its cells are half as long (ours)."""
FLAT = 1e-4
"""An image whose values, from 0 to 1, differ by less has no contrast but rounding."""
SURROUNDINGS = 10.0
"""Standard deviation in reduced pixels of what a pixel is compared with."""


@dataclass(frozen=True)
class Edges:
    """How images are described; scores go from -1 to 1."""

    pixels: int = 3600
    """Pixels that an image is reduced to, its shape kept: 80x45 of 160x90; smaller ones stay as they are
    (ours)."""
    orientations: int = 6
    """Directions of an edge that are told apart (ours)."""
    cell: int = 4
    """Side in pixels of the cells whose edges are counted together (ours)."""

    def __post_init__(self) -> None:
        if min(self.pixels, self.cell) < 1 or self.orientations < 2:
            raise SettingsError(
                "the settings of edges need pixels and cell of 1 or more, and 2 orientations or more"
            )

    def describe(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(n, dimensions): contrast and directions, each of length 1/sqrt(2), or 0 without any contrast."""
        height, width = self._size(*images.shape[1:3])
        values = np.sqrt(reduced(grey(images), height, width) / np.float32(255))
        few = height * width < FEW_PIXELS
        smooth, cell = (values, max(self.cell // 2, 1)) if few else (blurred(values, 0.7), self.cell)
        contrast, directions = unit(_contrast(smooth), 0.0), unit(self._directions(smooth, cell), 0.0)
        vectors = np.concatenate([contrast, directions], axis=1) * np.float32(np.sqrt(0.5))
        vectors[np.ptp(values, axis=(1, 2)) < FLAT] = 0
        return vectors

    def _size(self, height: int, width: int) -> tuple[int, int]:
        """Rows and columns after the reduction."""
        scale = min(1.0, (self.pixels / (height * width)) ** 0.5)
        return max(round(height * scale), 1), max(round(width * scale), 1)

    def _directions(self, values: Values, cell: int) -> NDArray[np.float32]:
        """(n, orientations, rows, columns) how much of each cell's edges runs which way, around its mean."""
        down, across = (_slope(values, axis) for axis in (1, 2))
        length = np.hypot(down, across)
        at = np.arctan2(down, across) * np.float32(self.orientations / np.pi)
        shares = np.empty((len(values), self.orientations, *values.shape[1:]), np.float32)
        _share_out(at, length, shares)
        rows, columns = (_cells(side, cell) for side in values.shape[1:])
        histogram = rows @ shares @ columns.T
        strength = blurred(np.sqrt(np.square(histogram).sum(1)), 1.0)
        strength = strength + np.float32(0.02) * strength.mean((1, 2), keepdims=True) + np.float32(1e-6)
        root = np.sqrt(histogram / strength[:, None])
        return np.asarray(root - root.mean((2, 3), keepdims=True), np.float32)


def _contrast(values: Values) -> Values:
    """Each value minus the mean of its surroundings, over their deviation; reduced by half."""
    mean = blurred(values, SURROUNDINGS)
    deviation = np.sqrt(np.maximum(blurred(values * values, SURROUNDINGS) - mean * mean, 0))
    floor = np.float32(0.15) * deviation.mean((1, 2), keepdims=True) + np.float32(1e-3)
    rows, columns = values.shape[1:]
    return reduced((values - mean) / (deviation + floor), _half(rows), _half(columns))


def _slope(values: Values, axis: int) -> Values:
    """Central differences along an axis, one-sided ones at its ends; 0 along a side of one pixel."""
    slopes = np.zeros_like(values)
    if values.shape[axis] > 1:
        of, out = values.swapaxes(axis, 0), slopes.swapaxes(axis, 0)
        out[1:-1] = (of[2:] - of[:-2]) * np.float32(0.5)
        out[0], out[-1] = of[1] - of[0], of[-1] - of[-2]
    return slopes


def _cells(side: int, cell: int) -> NDArray[np.float32]:
    """(cells, side): the mean over each cell's pixels."""
    return reduction(side, max(side // cell, min(side, 4)), 0.0)


@njit(cache=True, nogil=True)
def _share_out(at: Values, length: Values, out: NDArray[np.float32]) -> None:
    """(n, bins, h, w) how much of an edge's length, whose direction is `at`, counts for each bin.

    The bins lie around half a turn, and a share is linear in how far away the bin is; `at` goes from -bins to
    bins. All in 32 bits.
    """
    turn, half = np.float32(out.shape[1]), np.float32(out.shape[1] / 2)
    for n in range(out.shape[0]):
        for b in range(out.shape[1]):
            for i in range(out.shape[2]):
                for j in range(out.shape[3]):
                    away = at[n, i, j] - np.float32(b) + half
                    away += turn if away < 0 else np.float32(0)
                    away += turn if away < 0 else np.float32(0)
                    away -= turn if away >= turn else np.float32(0)
                    out[n, b, i, j] = length[n, i, j] * max(np.float32(1) - abs(away - half), np.float32(0))


def _half(side: int) -> int:
    """Half a side, but no fewer than 16 pixels where there are so many."""
    return max(side // 2, min(side, 16))
