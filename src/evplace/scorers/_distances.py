"""How much images differ: every query against every reference, in blocks where the table is large.

Images are (images, ...) arrays of one size; each is taken as one row of pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import InputError

Images = NDArray[Any]
"""(images, ...) pixels, uint8 or floating point."""

Table = NDArray[np.float32]
"""(queries, references)"""

PIECE = 1 << 23
"""Pixels whose differences are summed in 32 bits."""

Measure = Callable[[Images, Images], Table]
"""sad, ssd or ncc."""


def sad(queries: Images, references: Images) -> Table:
    """Mean absolute difference of uint8 images (SeqSLAM), in grey levels; smaller is more alike."""
    q, r = _as_pixels(queries, references)
    if q.dtype != np.uint8 or r.dtype != np.uint8:
        raise InputError(f"sad takes uint8 images, these are {q.dtype} and {r.dtype}: use ssd or ncc")
    table = np.empty((len(q), len(r)), np.float32)
    _sad(np.ascontiguousarray(q), np.ascontiguousarray(r), table)
    return table


def ssd(queries: Images, references: Images) -> Table:
    """Sum of squared differences; smaller is more alike. Exact for uint8 images, then rounded to float32."""
    q, r = (_centred(pixels) for pixels in _as_pixels(queries, references))
    product = np.zeros((len(q), len(r)))
    # Centred uint8 products are below 2^14, so 1024 of them sum exactly in float32, at BLAS's float32 pace.
    for start in range(0, q.shape[1], 1024):
        part = slice(start, start + 1024)
        product += q[:, part] @ r[:, part].T
    squares = [np.einsum("ij,ij->i", pixels, pixels, dtype=np.float64) for pixels in (q, r)]
    product *= -2
    product += squares[0][:, None]
    product += squares[1]
    return np.maximum(product, 0, out=product).astype(np.float32)


def ncc(queries: Images, references: Images) -> Table:
    """Normalised correlation in [-1, 1]; LARGER is more alike. A flat image correlates with nothing: 0."""
    q, r = (_standardised(pixels) for pixels in _as_pixels(queries, references))
    table: Table = np.clip(q @ r.T, -1, 1)
    return table


def blocks(
    queries: Images, references: Images, measure: Measure = sad, limit_bytes: int = 1 << 26
) -> Iterator[Table]:
    """`measure(queries, references)` in blocks of rows, each of at most `limit_bytes` (64 MiB).

    A block has at least one row. Feed each to `Matcher.extend`: a table of 100,000 x 100,000 then never
    exists, and SeqSLAM, for one, keeps d_s rows of it.
    """
    rows = max(1, limit_bytes // (4 * max(1, len(references))))
    for start in range(0, len(queries), rows):
        yield measure(queries[start : start + rows], references)


@njit(cache=True, nogil=True)
def _sad(queries: NDArray[np.uint8], references: NDArray[np.uint8], table: Table) -> None:
    """A query stays in the first cache while eight references pass."""
    pixels = queries.shape[1]
    for first in range(0, references.shape[0], 8):
        for q in range(queries.shape[0]):
            for r in range(first, min(first + 8, references.shape[0])):
                total = 0
                for start in range(0, pixels, PIECE):
                    end = start + PIECE
                    total += _difference(queries[q][start:end], references[r][start:end])
                table[q, r] = total / pixels


@njit(cache=True, nogil=True)
def _difference(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> int:
    """In 32 bits throughout: only then does the compiler see a sum of absolute differences (psadbw)."""
    total = np.int32(0)
    for k in range(one.shape[0]):
        total = np.int32(total + np.int32(abs(np.int32(np.int32(one[k]) - np.int32(other[k])))))
    return int(total)


def _as_pixels(queries: Images, references: Images) -> tuple[Images, Images]:
    """Both as (images, pixels); InputError where they cannot be compared."""
    q, r = np.asarray(queries), np.asarray(references)
    for images in (q, r):
        if images.ndim < 2 or images.dtype.kind not in "fu" or 0 in images.shape[1:]:
            raise InputError(
                f"cannot compare images of shape {images.shape} and type {images.dtype}: give (images, ...) "
                "arrays of numbers"
            )
    if q.shape[1:] != r.shape[1:]:
        raise InputError(
            f"the queries are {q.shape[1:]} images, the references {r.shape[1:]}: resize them to one size"
        )
    pixels = int(np.prod(q.shape[1:]))
    return q.reshape(len(q), pixels), r.reshape(len(r), pixels)


def _centred(pixels: Images) -> NDArray[np.float32]:
    """uint8 pixels about their middle; a common shift changes no difference."""
    return pixels.astype(np.float32) - (128 if pixels.dtype == np.uint8 else 0)


def _standardised(pixels: Images) -> NDArray[np.float32]:
    """Each row with mean 0 and length 1; a flat one becomes zeros."""
    values = pixels.astype(np.float32)
    values -= values.mean(1, keepdims=True)
    values[np.ptp(pixels, axis=1) == 0] = 0
    length = np.linalg.norm(values, axis=1, keepdims=True)
    values /= np.where(length > 0, length, 1)
    return values
