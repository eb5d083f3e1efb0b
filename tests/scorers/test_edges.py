"""The training-free descriptor."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.scorers import edges
from evplace.scorers.edges import Edges
from evplace.testing import check_descriptor


def street(seed: int = 0, shape: tuple[int, int] = (90, 160)) -> NDArray[np.uint8]:
    """A picture of blocks, as a street of houses is."""
    rng = np.random.default_rng(seed)
    image = np.zeros(shape)
    for _ in range(40):
        y, x = rng.integers(0, shape[0] - 9), rng.integers(0, shape[1] - 9)
        image[y : y + rng.integers(4, 30), x : x + rng.integers(4, 40)] = rng.uniform(20, 120)
    return image.astype(np.uint8)


def test_it_keeps_what_descriptors_promise() -> None:
    check_descriptor(Edges())


def test_a_darker_image_is_the_same_place() -> None:
    here, there = street(0), street(1)
    vectors = Edges().describe(np.stack([here, (here * 0.3).astype(np.uint8), there]))
    same, other = vectors[0] @ vectors[1], vectors[0] @ vectors[2]
    assert same > 0.9 > other + 0.3


def test_vectors_have_length_one_and_an_image_without_contrast_is_nothing() -> None:
    images = np.stack([street(), np.full((90, 160), 9, np.uint8), np.zeros((90, 160), np.uint8)])
    length = np.linalg.norm(Edges().describe(images), axis=1)
    np.testing.assert_allclose(length, [1, 0, 0], atol=1e-5)


@pytest.mark.parametrize("shape", [(7, 7), (1, 1), (1, 40), (45, 80), (240, 320), (33, 21)])
def test_images_of_any_size_are_described(shape: tuple[int, int]) -> None:
    image = np.random.default_rng(0).integers(0, 256, (2, *shape), np.uint8)
    vectors = Edges().describe(image)
    assert np.isfinite(vectors).all()
    assert np.linalg.norm(vectors, axis=1).max() <= 1 + 1e-5


def test_an_image_of_few_pixels_keeps_all_it_has() -> None:
    """Two pixels beside one another stay two: smoothed, they would be much alike."""
    few = np.zeros((2, 8, 8), np.uint8)
    few[0, 4, 3] = few[1, 4, 4] = 200
    many = np.zeros((2, 32, 32), np.uint8)
    many[0, 16, 15] = many[1, 16, 16] = 200
    alike = [float(vectors[0] @ vectors[1]) for vectors in (Edges().describe(few), Edges().describe(many))]
    assert alike[0] < 0.3 < 0.5 < alike[1]


def test_directions_are_those_of_the_edges() -> None:
    """Upright stripes have their edges in the first bin, lying ones in the middle."""
    upright = np.tile((np.arange(80) // 5 % 2 * 100).astype(np.uint8), (45, 1))
    part = Edges()
    for image, bin_ in ((upright, 0), (np.ascontiguousarray(upright.T[:45, :45]), 3)):
        values = np.sqrt(image[None].astype(np.float32) / 255)
        histogram = part._directions(values, part.cell) + 1e-3
        spread = histogram.std(axis=(2, 3))[0]
        assert spread.argmax() == bin_


def test_the_histogram_is_that_of_a_plain_loop() -> None:
    rng = np.random.default_rng(3)
    values = rng.uniform(0, 1, (1, 12, 16)).astype(np.float32)
    part = Edges(cell=4)
    down, across = np.gradient(values[0].astype(float), axis=0), np.gradient(values[0].astype(float), axis=1)
    plain = np.zeros((6, 4, 4))
    for y in range(12):
        for x in range(16):
            at = (np.arctan2(down[y, x], across[y, x]) % np.pi) / np.pi * 6
            low, share = int(at) % 6, at - int(at)
            length = np.hypot(down[y, x], across[y, x])
            plain[low, y // 3, x // 4] += length * (1 - share) / 12
            plain[(low + 1) % 6, y // 3, x // 4] += length * share / 12
    strength = np.sqrt((plain**2).sum(0))
    found = part._directions(values, part.cell)[0]
    from evplace.scorers._reduction import blurred

    smooth = blurred(strength[None].astype(np.float32), 1.0)[0]
    root = np.sqrt(plain / (smooth + 0.02 * smooth.mean() + 1e-6))
    np.testing.assert_allclose(found, root - root.mean((1, 2), keepdims=True), atol=2e-4)


def test_settings_that_cannot_be_are_refused() -> None:
    for wrong in ({"pixels": 0}, {"orientations": 1}, {"cell": 0}):
        with pytest.raises(SettingsError, match="settings of edges"):
            Edges(**wrong)


@pytest.mark.parametrize("orientations", [2, 5, 6])
def test_directions_are_shared_as_by_a_remainder(orientations: int) -> None:
    """To the bit: sums take whole turns off as `mod` does."""
    rng = np.random.default_rng(0)
    at = rng.uniform(-orientations, orientations, (2, 9, 9)).astype(np.float32)
    at[0, 0] = np.linspace(-orientations, orientations, 9)
    half, turn = np.float32(orientations / 2), np.float32(orientations)
    length, shares = rng.random(at.shape).astype(np.float32), np.empty((2, orientations, 9, 9), np.float32)
    edges._share_out(at, length, shares)
    for bin_, found in enumerate(shares.swapaxes(0, 1)):
        away = np.abs(np.mod(at - np.float32(bin_) + half, turn) - half)
        np.testing.assert_array_equal(found, length * np.maximum(1 - away, 0))


def test_slopes_are_numpys() -> None:
    values = np.random.default_rng(0).random((2, 5, 7)).astype(np.float32)
    for axis in (1, 2):
        np.testing.assert_array_equal(edges._slope(values, axis), np.gradient(values, axis=axis))
    assert (edges._slope(values[:, :1], 1) == 0).all()
