"""Images averaged with those shortly before."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.imaging.averaging import Averager, Averaging, averaged


def images(n: int, seed: int = 0) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (n, 4, 6), np.uint8)


def test_each_is_the_mean_of_itself_and_the_one_a_tenth_of_a_second_before() -> None:
    film, t_us = images(6), np.arange(6) * 100_000
    means = averaged(film, t_us, Averaging())
    wanted = (film[1:].astype(int) + film[:-1] + 1) // 2
    np.testing.assert_array_equal(means[0], film[0])
    np.testing.assert_array_equal(means[1:], wanted)


@pytest.mark.parametrize("rate", [20, 30, 50, 60])
def test_at_any_rate_the_same_two_images_are_taken(rate: int) -> None:
    film = images(rate, seed=rate)
    t_us = np.arange(rate) * 1_000_000 // rate
    means = averaged(film, t_us, Averaging())
    back = round(rate / 10)
    wanted = (film[back:].astype(int) + film[:-back] + 1) // 2
    np.testing.assert_array_equal(means[back:], wanted)


def test_images_far_apart_stand_alone() -> None:
    film = images(4)
    np.testing.assert_array_equal(averaged(film, np.arange(4) * 200_000, Averaging()), film)
    np.testing.assert_array_equal(averaged(film, np.zeros(4, np.int64), Averaging(images=1)), film)


def test_three_are_averaged_and_what_is_given_stays_as_it_was() -> None:
    film = images(5)
    averager = Averager(Averaging(images=3))
    for at, image in enumerate(film):
        given = image.copy()
        mean = averager.push(given, at * 100_000).copy()
        given[:] = 0  # a caller may reuse its array
        wanted = film[max(0, at - 2) : at + 1].mean(axis=0)
        np.testing.assert_allclose(mean, wanted, atol=0.51)


def test_memory_stays_flat() -> None:
    averager = Averager(Averaging())
    for at in range(5000):
        averager.push(np.zeros((2, 2), np.uint8), at * 1000)
    assert len(averager._before) <= 202
