"""Blur, crop and resize as one sparse linear map for each axis, with exact integer weights.

Each of the three steps is linear and separable, so their composition is too: out = R_y I R_x^T, where a row
of R has a few neighbouring taps. Composed in whole numbers, over one denominator, the whole map is
exact for binary images: integer sums and one division at the end.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit

Taps = dict[int, int]
"""Input -> its weight in an output."""
Resize = Literal["area", "linear"]

BLUR = (1, 2, 1)
"""The 3x3 Gaussian for each axis, in quarters: OpenCV's kernel for size 3, sigma 0 (paper, section 3.2)."""


@dataclass(frozen=True)
class AxisMap:
    """A sparse row map from `n_in` inputs to `len(start)` outputs."""

    start: NDArray[np.int64]
    """(out,) first input that each output reads."""
    weights: NDArray[np.int64]
    """(out, taps) integer weights; zero beyond an output's own taps."""
    total: int
    """What the weights of every output sum to: divide by it."""


@functools.lru_cache(maxsize=64)  # a frame at a time, it would take longer than the frame
def axis_map(n_in: int, n_kept: int, n_out: int, blur: bool, resize: Resize) -> AxisMap:
    """Blur all `n_in` inputs, keep the first `n_kept`, resize them to `n_out`."""
    resized, total = _area(n_kept, n_out) if resize == "area" else _linear(n_kept, n_out)
    rows = [_blurred(taps, n_in) if blur else taps for taps in resized]
    total *= sum(BLUR) if blur else 1
    common = math.gcd(total, *(weight for taps in rows for weight in taps.values()))
    width = max(max(taps) - min(taps) + 1 for taps in rows)
    # Near the far edge the window of taps is moved back inside; the freed taps weigh nothing.
    start = np.array([min(min(taps), n_in - width) for taps in rows], np.int64)
    weights = np.zeros((n_out, width), np.int64)
    for out, taps in enumerate(rows):
        for index, weight in taps.items():
            weights[out, index - start[out]] = weight // common
    return AxisMap(start, weights, total // common)


def _area(n_in: int, n_out: int) -> tuple[list[Taps], int]:
    """Each output is the mean over its share of the inputs; with what an output's weights sum to.

    An input is `n_out` long, an output `n_in`.
    """
    rows = []
    for out in range(n_out):
        left, right = out * n_in, (out + 1) * n_in
        inputs = range(left // n_out, -(-right // n_out))
        rows.append({i: min(right, (i + 1) * n_out) - max(left, i * n_out) for i in inputs})
    return rows, n_in


def _linear(n_in: int, n_out: int) -> tuple[list[Taps], int]:
    """Each output is interpolated between the two inputs beside its centre; ends are held. The sum as above.

    Between two inputs lie 2 `n_out` steps.
    """
    step, rows = 2 * n_out, []
    for out in range(n_out):
        centre = min(max((2 * out + 1) * n_in - n_out, 0), (n_in - 1) * step)
        left, part = divmod(centre, step)
        rows.append({left: step - part, left + 1: part} if part else {left: step})
    return rows, step


def _blurred(taps: Taps, n_in: int) -> Taps:
    """The taps behind the blur; borders are mirrored without repeating the edge (reflect-101)."""
    spread: Taps = {}
    for index, weight in taps.items():
        for shift, share in zip((-1, 0, 1), BLUR, strict=True):
            source = _mirrored(index + shift, n_in)
            spread[source] = spread.get(source, 0) + weight * share
    return spread


def _mirrored(index: int, n: int) -> int:
    if n == 1:
        return 0
    if index < 0:
        return -index
    return 2 * (n - 1) - index if index >= n else index


class Resampler:
    """One map for each axis, with the scratch that its passes need."""

    def __init__(self, rows: AxisMap, columns: AxisMap) -> None:
        """From canvases (H, W) to images (h, w)."""
        self._rows, self._columns = rows, columns
        # The narrowest whole numbers that hold every sum: the narrower, the more of them fit a vector.
        kind = np.uint8 if rows.total < 1 << 8 else np.uint16 if rows.total < 1 << 16 else np.uint32
        self._bits = 16 if rows.total * columns.total < 1 << 16 else 32
        self._row_weights = rows.weights.astype(kind)
        self._column_weights = columns.weights.astype(np.uint64)
        self._scale = np.float32(1 / (rows.total * columns.total))

    def binary(self, canvas: NDArray[np.int8]) -> NDArray[np.float32]:
        """A canvas (H, W) of 0 and -1 (set) -> (h, w) float32 in [0, 1]; exact but for the last division."""
        if self._rows.total * self._columns.total >= 1 << 32:
            return self.values(-canvas.astype(np.float32))
        rows, columns, width = self._rows, self._columns, canvas.shape[1]
        out = np.empty((len(rows.start), len(columns.start)), np.float32)
        _resample_binary(
            canvas, rows.start, self._row_weights, columns.start, self._column_weights, self._bits,
            np.empty(width, self._row_weights.dtype), np.empty(width, np.uint64),
            np.empty(len(columns.start), np.uint64), self._scale, out,
        )  # fmt: skip
        return out

    def values(self, canvas: NDArray[np.float32]) -> NDArray[np.float32]:
        """A canvas (H, W) of any values -> (h, w) float32."""
        rows, columns = self._rows, self._columns
        lines = np.empty((len(rows.start), canvas.shape[1]), np.float64)
        _weighted_rows(canvas, rows.start, rows.weights / rows.total, lines)
        sums = np.empty((len(columns.start), len(rows.start)), np.float64)
        _weighted_rows(np.ascontiguousarray(lines.T), columns.start, columns.weights / columns.total, sums)
        return np.ascontiguousarray(sums.T, np.float32)


@njit(cache=True)
def _resample_binary(
    canvas: Any, row_start: Any, row_weights: Any, column_start: Any, column_weights: Any, bits: int,
    line: Any, words: Any, sums: Any, scale: Any, out: Any,
) -> None:  # fmt: skip
    """Two or four lines side by side in 64 bits, `bits` each, which no sum passes: they are added up as one.

    `line` and `words` (W,) and `sums` (w,) are room to work in, small enough for the first cache.
    """
    together, mask = 64 // bits, np.uint64((1 << bits) - 1)
    for first in range(0, out.shape[0], together):
        many = min(together, out.shape[0] - first)
        words[:] = 0
        for k in range(many):
            _masked_row(canvas, row_start[first + k], row_weights[first + k], line)
            _put_beside(line, np.uint64(bits * k), words)
        _weighted_words(words, column_start, column_weights, sums)
        for k in range(many):
            to, shift = out[first + k], np.uint64(bits * k)
            for j in range(len(sums)):
                to[j] = np.float32(sums[j] >> shift & mask) * scale


@njit(cache=True)
def _masked_row(canvas: Any, start: Any, weights: Any, line: Any) -> None:
    """-1 has all bits set: a mask costs less than a product, and keeps the sums as narrow as the weights."""
    line[:] = 0
    for tap in range(0, len(weights) - 1, 2):
        weight, source = weights[tap], canvas[start + tap]
        second, below = weights[tap + 1], canvas[start + tap + 1]
        for x in range(len(line)):
            line[x] += (weight & source[x]) + (second & below[x])
    if len(weights) % 2:
        weight, source = weights[-1], canvas[start + len(weights) - 1]
        for x in range(len(line)):
            line[x] += weight & source[x]


@njit(cache=True)
def _put_beside(line: Any, shift: Any, words: Any) -> None:
    for x in range(len(line)):
        words[x] |= np.uint64(line[x]) << shift


@njit(cache=True)
def _weighted_words(words: Any, start: Any, weights: Any, sums: Any) -> None:
    for j in range(len(sums)):
        first, total = np.uint64(start[j]), np.uint64(0)
        for tap in range(weights.shape[1]):
            total += weights[j, tap] * words[first + np.uint64(tap)]
        sums[j] = total


@njit(cache=True)
def _weighted_rows(canvas: Any, start: Any, weights: Any, out: Any) -> None:
    """Two taps at once halve how often a line is loaded and stored."""
    taps = weights.shape[1]
    for i in range(out.shape[0]):
        line = out[i]
        line[:] = 0
        for tap in range(0, taps - 1, 2):
            weight, source = weights[i, tap], canvas[start[i] + tap]
            second, below = weights[i, tap + 1], canvas[start[i] + tap + 1]
            for x in range(len(line)):
                line[x] += (weight * source[x]) + (second * below[x])
        if taps % 2:
            weight, source = weights[i, taps - 1], canvas[start[i] + taps - 1]
            for x in range(len(line)):
                line[x] += weight * source[x]
