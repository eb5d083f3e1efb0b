"""Comparing images, against the forms that these kernels had before: python bench/bench_kernels.py

OPENBLAS_NUM_THREADS=1. 10,000 references: SeqSLAM's 64x32 pixels and event images of 160x90.
"""

from __future__ import annotations

import platform
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from evplace.scorers import scorer_of
from evplace.scorers._distances import sad
from evplace.scorers._reduction import reduction
from evplace.scorers.cosine import Cosine
from evplace.scorers.ncc import FLAT, NCC
from harness import alternate, report

Images = NDArray[np.uint8]
ITEMS, MANY = 10_000, 100


@njit
def sad_64(queries: Images, references: Images) -> NDArray[np.float32]:
    """Sums in 64 bits."""
    pixels = queries.shape[1]
    table = np.empty((len(queries), len(references)), np.float32)
    for first in range(0, len(references), 8):
        for q in range(len(queries)):
            for r in range(first, min(first + 8, len(references))):
                total = 0
                for k in range(pixels):
                    total += abs(np.int32(queries[q, k]) - np.int32(references[r, k]))
                table[q, r] = total / pixels
    return table


def ncc_at_once(images: Images) -> NDArray[np.float32]:
    """All images by one product of three."""
    rows, columns = reduction(90, 22, 2.0), reduction(160, 40, 2.0)
    values = images.astype(np.float32)
    small = np.einsum("ih,nhw...,jw->nij...", rows, values, columns, optimize=True)
    flat = np.asarray(small, np.float32).reshape(len(small), -1)
    flat -= flat.mean(axis=1, keepdims=True)
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    return np.divide(flat, length, out=np.zeros_like(flat), where=length > FLAT)


def cosine_at_once(images: Images) -> NDArray[np.float32]:
    """All images, each step by itself."""
    flat = images.reshape(len(images), -1).astype(np.float32)
    return flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1)


def peak_mb(function: Callable[[], Any]) -> str:
    """What it needs at most, over what it leaves."""
    tracemalloc.start()
    kept = function()
    held, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    del kept
    return f"keeps {held / 1e6:.0f} MB, needs {peak / 1e6:.0f} MB: x{peak / held:.2f}"


def main() -> None:
    """Print times and memory."""
    print(platform.processor() or platform.machine())
    rng = np.random.default_rng(0)
    for pixels in (32 * 64, 90 * 160):
        images = rng.integers(0, 256, (ITEMS, pixels), np.uint8)
        query = images[7:8].copy()
        np.testing.assert_array_equal(sad(query, images), sad_64(query, images))
        forms = {
            "evplace": lambda q=query, i=images: sad(q, i),
            "64 bits": lambda q=query, i=images: sad_64(q, i),
        }
        report(f"SAD row, {ITEMS} references of {pixels} pixels", alternate(forms, 15), 1e-3, "ms")
        few = images[:50].copy()
        forms = {
            "evplace": lambda q=query, i=few: [sad(q, i) for _ in range(MANY)],
            "64 bits": lambda q=query, i=few: [sad_64(q, i) for _ in range(MANY)],
        }
        report(
            f"SAD row, 50 references of {pixels} pixels: none is fetched",
            alternate(forms, 9),
            MANY / 1e3,
            "ms",
        )
    images = images.reshape(ITEMS, 90, 160)
    content = {"references": images}
    for name, scorer, before in (("ncc", NCC(), ncc_at_once), ("cosine", Cosine(), cosine_at_once)):
        forms = {
            "evplace": lambda s=scorer: scorer_of(s).open(content),
            "at once": lambda b=before: b(images),
        }
        for form, function in forms.items():
            print(f"{name}, {form}: {peak_mb(function)}")
        report(f"{name}: a map of {ITEMS} is opened", alternate(forms, 2), 1.0, "s")
    one = images[:1].copy()
    forms = {
        "evplace": lambda: [NCC().describe(one) for _ in range(MANY)],
        "one product of three": lambda: [ncc_at_once(one) for _ in range(MANY)],
    }
    report("ncc: one image is described", alternate(forms, 9), 1e-3 * MANY, "ms")


if __name__ == "__main__":
    main()
