"""Blurring and reducing images of any size, as products with small matrices."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

GREY = np.array([0.299, 0.587, 0.114], np.float32)
"""Weights of red, green and blue (ITU-R BT.601)."""


def grey(images: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(n, h, w) or (n, h, w, C) -> (n, h, w): colours by their brightness, other channels by their mean."""
    values = images.astype(np.float32)
    if values.ndim == 3:
        return values
    return np.asarray(values @ GREY if values.shape[-1] == 3 else values.mean(-1), np.float32)


def small(images: NDArray[np.uint8], height: int, width: int) -> NDArray[np.float32]:
    """(n, h, w) or (n, h, w, C) -> (n, height, width) grey: each pixel the mean over its share of the image.

    Half as high and wide it is a quarter of the sum of four whole numbers, exact without a product, too.
    """
    if images.shape[1:] == (2 * height, 2 * width):
        pairs = images[:, ::2].astype(np.uint16) + images[:, 1::2]
        return np.asarray((pairs[:, :, ::2] + pairs[:, :, 1::2]) * np.float32(0.25), np.float32)
    values = grey(images)
    rows, columns = values.shape[1:]
    return _product(reduction(rows, height, 0.0), values, reduction(columns, width, 0.0))


def reduced(values: NDArray[np.float32], height: int, width: int) -> NDArray[np.float32]:
    """(n, h, w) -> (n, height, width) at most: the mean over each output's share of the pixels."""
    rows, columns = values.shape[1:]
    if rows <= height and columns <= width:
        return values
    return _product(
        reduction(rows, min(rows, height), 0.0), values, reduction(columns, min(columns, width), 0.0)
    )


def blurred(values: NDArray[np.float32], sigma: float) -> NDArray[np.float32]:
    """(n, h, w) under a Gaussian of `sigma` pixels with mirrored borders."""
    rows, columns = values.shape[1:]
    return _product(reduction(rows, rows, sigma), values, reduction(columns, columns, sigma))


def unit(values: NDArray[np.float32], flat: float) -> NDArray[np.float32]:
    """(n, ...) -> (n, dimensions) of mean 0 and length 1; what is no longer than `flat` becomes 0."""
    vectors = values.reshape(len(values), -1)
    vectors = vectors - vectors.mean(axis=1, keepdims=True)
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    out: NDArray[np.float32] = np.divide(vectors, length, out=np.zeros_like(vectors), where=length > flat)
    return out


@functools.cache
def reduction(n_in: int, n_out: int, sigma: float) -> NDArray[np.float32]:
    """(out, in): a Gaussian blur with mirrored borders, then the mean over each output's share."""
    edges = np.arange(n_out + 1) * n_in / n_out
    inputs = np.arange(n_in)
    overlap = np.minimum(edges[1:, None], inputs + 1) - np.maximum(edges[:-1, None], inputs)
    share = np.maximum(overlap, 0) * n_out / n_in
    return np.asarray(share @ _blur(n_in, sigma), np.float32)


def _product(rows: NDArray[Any], values: NDArray[np.float32], columns: NDArray[Any]) -> NDArray[np.float32]:
    out: NDArray[np.float32] = rows @ values @ columns.T
    return out


def _blur(n: int, sigma: float) -> NDArray[np.float64]:
    """(n, n): row i holds the weights of the Gaussian around i; cut at 4 sigma."""
    if sigma == 0 or n == 1:
        return np.eye(n)
    reach = int(min(4 * sigma + 0.5, n - 1))
    shifts = np.arange(-reach, reach + 1)
    kernel = np.exp(-0.5 * (shifts / sigma) ** 2)
    kernel /= kernel.sum()
    matrix = np.zeros((n, n))
    for shift, weight in zip(shifts, kernel, strict=True):
        source = np.abs(np.arange(n) + shift)
        source = np.where(source >= n, 2 * (n - 1) - source, source)
        matrix[np.arange(n), source] += weight
    return matrix
