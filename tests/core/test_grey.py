"""Grey: against whole numbers, and against the two weightings' own definitions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from evplace.core.grey import BT601, MATLAB, luminance, to_grey

levels = st.integers(0, 255)


@given(levels, levels, levels)
def test_grey_is_the_exact_sum_rounded_half_up(r: int, g: int, b: int) -> None:
    exact = 299 * r + 587 * g + 114 * b
    got = int(to_grey(np.array([r, g, b], np.uint8)))
    if exact % 1000 == 500:  # a tie falls to either side in floats
        assert got in (exact // 1000, exact // 1000 + 1)
    else:
        assert got == (exact + 500) // 1000


@pytest.mark.parametrize("weights", [BT601, MATLAB])
def test_what_is_grey_already_stays_as_it_is(weights: tuple[float, float, float]) -> None:
    grey = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(to_grey(np.stack([grey] * 3, -1), weights), grey)
    assert sum(weights) == pytest.approx(1, abs=1e-6)


def test_matlabs_weights_are_the_inverse_of_its_colour_space() -> None:
    """rgb2gray takes the first row of the inverse of the NTSC primaries' matrix."""
    from_ntsc = np.array([[1, 0.956, 0.621], [1, -0.272, -0.647], [1, -1.106, 1.703]])
    np.testing.assert_allclose(np.linalg.inv(from_ntsc)[0], MATLAB, atol=1e-6)


def test_pillow_has_the_same_grey() -> None:
    image = np.random.default_rng(0).integers(0, 256, (40, 50, 3), np.uint8)
    apart = to_grey(image).astype(int) - np.asarray(Image.fromarray(image).convert("L"), int)
    assert np.abs(apart).max() <= 1
    assert (apart == 0).mean() > 0.95


def test_floats_keep_their_kind_and_shapes_their_front() -> None:
    light = np.random.default_rng(0).random((2, 5, 4, 3))
    for kind in (np.float32, np.float64):
        assert luminance(light.astype(kind)).dtype == kind
    np.testing.assert_allclose(luminance(light), np.einsum("nhwc,c->nhw", light, BT601), rtol=1e-14)
    assert luminance(light).shape == (2, 5, 4)
    assert luminance(np.zeros((4, 3), np.uint8)).dtype == np.float64
