from __future__ import annotations

import numpy as np
import pytest

from evplace.core.errors import InputError
from evplace.scorers._seqslam_images import grey, normalise_patches, prepare

COLOUR = np.random.default_rng(0).integers(0, 256, (90, 160, 3), np.uint8)


def test_grey_weighs_the_channels_and_keeps_grey_images() -> None:
    pure = np.eye(3, dtype=np.uint8)[None] * 255
    assert grey(pure).tolist() == [[76, 150, 29]]
    assert grey(COLOUR[:, :, 0]) is not None
    np.testing.assert_array_equal(grey(COLOUR[:, :, 0]), COLOUR[:, :, 0])


def test_prepare_crops_resizes_and_normalises() -> None:
    assert prepare(COLOUR).shape == (32, 64)
    whole = prepare(COLOUR, size=(160, 60), crop=(0, 0, 160, 60), patch=None)
    np.testing.assert_array_equal(whole, grey(COLOUR)[:60])
    np.testing.assert_array_equal(prepare(COLOUR), normalise_patches(prepare(COLOUR, patch=None)))


def test_patches_in_a_stack_flat_ones_and_the_remainder() -> None:
    images = np.random.default_rng(1).integers(0, 256, (3, 20, 18), np.uint8)
    images[1, :8, 8:16] = 40
    for mode in ("deviation", "range"):
        stack = normalise_patches(images, 8, mode)
        np.testing.assert_array_equal(stack[2], normalise_patches(images[2], 8, mode))
        assert (stack[1, :8, 8:16] == 0).all()
        np.testing.assert_array_equal(stack[:, 16:], images[:, 16:])
        np.testing.assert_array_equal(stack[:, :, 16:], images[:, :, 16:])


def test_bad_images_are_refused() -> None:
    with pytest.raises(InputError, match="an image is uint8"):
        prepare(COLOUR.astype(np.float32))
    with pytest.raises(InputError, match="does not lie in an image of 160 x 90"):
        prepare(COLOUR, crop=(0, 0, 161, 90))
    with pytest.raises(InputError, match="no contrast"):
        normalise_patches(COLOUR[:, :, 0], 1)
