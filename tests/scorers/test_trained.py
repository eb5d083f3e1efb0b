"""The shipped descriptor: what it takes, what it gives, and that its file is the one that is meant."""

from __future__ import annotations

import hashlib
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.core.errors import TraverseError
from evplace.scorers.trained import ABOUT, DIMENSIONS, FOLDER, WEIGHTS, Trained

MOST_BYTES = 5_000_000


def images(n: int, *shape: int, seed: int = 0) -> NDArray[np.uint8]:
    """Sparse ones, as of events."""
    rng = np.random.default_rng(seed)
    return (rng.integers(0, 256, (n, *shape)) * (rng.random((n, *shape)) < 0.2)).astype(np.uint8)


def test_the_shipped_file_is_the_one_described_and_small() -> None:
    content, about = (FOLDER / WEIGHTS).read_bytes(), json.loads((FOLDER / ABOUT).read_text())
    assert hashlib.sha256(content).hexdigest() == about["sha256"] == Trained().version
    assert len(content) <= MOST_BYTES
    assert about["licence"] == "Apache-2.0"
    assert {"version", "seed", "recipe"} <= set(about)


@pytest.mark.parametrize("shape", [(90, 160), (45, 80), (80, 80), (260, 346), (3, 2), (1, 1), (32, 64)])
def test_images_of_any_size_become_unit_vectors(shape: tuple[int, int]) -> None:
    vectors = Trained().describe(images(3, *shape))
    assert vectors.shape == (3, DIMENSIONS)
    assert vectors.dtype == np.float32
    length = np.linalg.norm(vectors, axis=1)
    assert all(np.isclose(one, 1, atol=1e-5) or one == 0 for one in length)
    assert length.any() == (shape != (1, 1))


@given(st.permutations(range(6)))
def test_a_vector_does_not_depend_on_the_batch(order: list[int]) -> None:
    stack = images(6, 90, 160)
    together = Trained().describe(stack[order])
    for place, number in enumerate(order):
        np.testing.assert_array_equal(together[place], Trained().describe(stack[number : number + 1])[0])


@pytest.mark.parametrize("level", [0, 7, 255])
def test_an_image_without_contrast_is_like_nothing(level: int) -> None:
    flat = np.full((2, 90, 160), level, np.uint8)
    np.testing.assert_array_equal(Trained().describe(flat), np.zeros((2, DIMENSIONS), np.float32))


def test_none_gives_none() -> None:
    assert Trained().describe(images(0, 90, 160)).shape == (0, DIMENSIONS)


def test_colours_are_seen_as_grey() -> None:
    grey = images(2, 90, 160)
    colour = np.repeat(grey[..., None], 3, axis=-1)
    np.testing.assert_allclose(Trained().describe(colour), Trained().describe(grey), atol=1e-3)


def test_brighter_is_the_same_place() -> None:
    """Twice the events a pixel is no other place."""
    dim = images(1, 90, 160) // 2
    assert (Trained().describe(dim) @ Trained().describe(2 * dim).T).item() > 0.99


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((2, 90, 160), np.float32), np.zeros((90, 160), np.uint8), np.zeros((2, 0, 160), np.uint8),
        np.zeros((1, 2, 3, 4, 5), np.uint8),
    ],
)  # fmt: skip
def test_other_arrays_are_refused(wrong: NDArray[np.uint8]) -> None:
    with pytest.raises(TraverseError, match=r"images must be uint8 \(n, h, w\) or \(n, h, w, C\), these are"):
        Trained().describe(wrong)
