"""How often unseen places are found."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace_lab.descriptor.bursts import Bursts
from evplace_lab.descriptor.judging import recalls


class Pixels:
    """Images as they are."""

    def describe(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        flat = images.reshape(len(images), -1).astype(np.float32)
        return flat / np.linalg.norm(flat, axis=1, keepdims=True)


def bursts(step_m: float) -> Bursts:
    """One route, three drives that see the same, two sensors."""
    places = np.random.default_rng(0).integers(0, 256, (1, 1, 6, 2, 45, 80), np.uint8)
    poses = np.zeros((1, 3, 6, 3), np.float32)
    poses[..., 0] = step_m * np.arange(6)
    return Bursts(np.repeat(places, 3, axis=1), poses)


def test_the_same_images_are_found() -> None:
    assert list(recalls(Pixels(), bursts(20))) == [100.0] * 4


def test_others_are_not() -> None:
    turned = bursts(20)
    turned.images[:, 1:] = turned.images[:, 1:, ::-1]
    found = list(recalls(Pixels(), turned))
    assert found == pytest.approx([20.0] * 4)  # of five pairs the middle one is the same


def test_where_nothing_is_near_the_nearest_is_right() -> None:
    aside = bursts(50)
    aside.poses[:, 1:, :, 1] = 20
    assert list(recalls(Pixels(), aside)) == [100.0] * 4


def test_what_is_near_is_right() -> None:
    turned = bursts(1)
    turned.images[:, 1:] = turned.images[:, 1:, ::-1]
    assert list(recalls(Pixels(), turned)) == [100.0] * 4
