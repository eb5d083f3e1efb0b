"""Weather's loops against plain twins, and what each must leave alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace_lab.city.texture import hash01
from evplace_lab.city.weather import BOX_M, _blend, _lens_drop, _streak, fall, lens_drops, mirror, veil

Image = NDArray[np.float64]
FOCAL = 30.0


def picture(seed: int = 0, height: int = 24, width: int = 32) -> Image:
    return np.random.default_rng(seed).random((height, width, 3))


def mirrored(image: Image, near: Image, ground: Image, tilt: float, wet: float) -> Image:
    """The same mirror, a pixel at a time and without a loop over its blur."""
    height, width = ground.shape
    horizon, out = height / 2 + tilt, image.copy()
    for y in range(height):
        below = y + 0.5 - horizon
        flat = 1 - min(max(below, 0) / FOCAL, 1)
        for x in range(width if below >= 1 else 0):
            row = horizon - below
            for _ in range(2):
                behind = near[np.clip(int(row), 0, height - 1), x]
                row = min(horizon - below + 3 * FOCAL * behind, horizon + 0.3 * below)
            reach = 1 + int(below * 0.08)
            rows = [np.clip(int(row + k * 1.6), 0, height - 1) for k in range(-reach, reach + 1)]
            share = wet * ground[y, x] * (0.12 + 0.75 * flat**3)
            out[y, x] += (image[rows, x].mean(0) - image[y, x]) * share
    return out


@pytest.mark.parametrize(("tilt", "wet"), [(0.0, 0.85), (-3.0, 0.4), (5.0, 1.0)])
def test_the_mirror_equals_its_twin(tilt: float, wet: float) -> None:
    rng, image = np.random.default_rng(1), picture()
    near, ground = rng.random((24, 32)) * 0.1, rng.integers(0, 2, (24, 32)).astype(float)
    out = np.empty_like(image)
    mirror(image, near, ground, FOCAL, tilt, wet, out)
    np.testing.assert_allclose(out, mirrored(image, near, ground, tilt, wet), atol=1e-12)


def test_only_the_road_below_the_horizon_mirrors() -> None:
    image, out = picture(2), np.empty((24, 32, 3))
    ground = np.ones((24, 32))
    ground[:, 16:] = 0
    mirror(image, np.zeros((24, 32)), ground, FOCAL, 0.0, 1.0, out)
    changed = np.any(out != image, axis=2)
    assert not changed[:, 16:].any()
    assert not changed[:12].any()
    assert changed[13:, :16].all()
    mirror(image, np.zeros((24, 32)), ground, FOCAL, 0.0, 0.0, out)
    np.testing.assert_array_equal(out, image)


def test_a_far_light_is_mirrored_as_far_below_the_horizon_as_it_stands_above_it() -> None:
    image, out = np.zeros((40, 8, 3)), np.empty((40, 8, 3))
    image[13:16, 3] = 1.0  # rows 4 to 7 above the horizon at 20
    mirror(image, np.zeros((40, 8)), np.ones((40, 8)), FOCAL, 0.0, 1.0, out)
    lit = np.flatnonzero(out[20:, 3, 0] > 0.2)
    assert lit.min() >= 2  # a blur of 1.6 rows lies about it
    assert lit.max() <= 8
    assert out[20:, [2, 4]].max() == 0


def blended(image: Image, row: int, column: int, opacity: float, white: float) -> Image:
    height = len(image)
    light = (image[max(row - height // 6, 0), column] + image[height // 5, column]) / 2
    light = light + (0.9 - light) * white
    return image[row, column] + (1.25 * light - image[row, column]) * opacity


@pytest.mark.parametrize("white", [0.0, 1.0])
def test_a_drop_takes_the_light_above_it(white: float) -> None:
    for row, column in ((0, 0), (3, 7), (23, 31)):
        image = picture(3)
        wanted = blended(image, row, column, 0.3, white)
        before = image.copy()
        _blend(image, row, column, 0.3, white)
        np.testing.assert_allclose(image[row, column], wanted, atol=1e-12)
        image[row, column] = before[row, column]
        np.testing.assert_array_equal(image, before)


def test_a_streak_joins_its_two_ends() -> None:
    image = np.full((60, 80, 3), 0.2)
    start, end = (0.3, -0.5, 2.0), (0.3, 0.5, 2.0)
    _streak(image, FOCAL * 2, start, end, 0.02, 1.0)
    changed = np.argwhere(image[..., 0] != 0.2)
    rows, columns = changed[:, 0], changed[:, 1]
    ends = [round(60 * y / 2.0 + 30) for y in (-0.5, 0.5)]
    assert (rows.min(), rows.max()) == tuple(ends)
    assert set(columns) <= {48, 49}
    assert set(rows) == set(range(ends[0], ends[1] + 1))


@pytest.mark.parametrize("end", [(0.3, 60.0, 2.0), (40.0, -0.5, 2.0)])
def test_a_streak_that_is_too_long_is_left_out(end: tuple[float, float, float]) -> None:
    image = picture(4)
    before = image.copy()
    _streak(image, FOCAL, (0.3, -0.5, 2.0), end, 0.02, 1.0)
    np.testing.assert_array_equal(image, before)


def test_what_falls_belongs_to_its_time_and_falls_through_the_box() -> None:
    def fallen(seconds: float, speed: float = 0.0) -> Image:
        image = picture(5)
        fall(image, FOCAL, seconds, speed, 0.008, 200, 7.0, 0.01, 0.0)
        return image

    np.testing.assert_array_equal(fallen(1.0), fallen(1.0))
    assert not np.array_equal(fallen(1.0), fallen(1.01))
    assert not np.array_equal(fallen(1.0), fallen(1.0, 9.0))
    image = picture(5)
    fall(image, FOCAL, 1.0, 0.0, 0.008, 0, 7.0, 0.01, 0.0)
    np.testing.assert_array_equal(image, picture(5))


def test_one_drop_is_where_its_hashes_put_it() -> None:
    """A flake that falls 1.6 m/s, alone: the middle of what changes is the middle of its streak."""
    seconds, speed, exposure = 2.0, 0.0, 0.008
    cycle = BOX_M[2] / 1.6
    phase = hash01(0, 1, 5) * cycle
    turn = math.floor((seconds + phase) / cycle)
    age = seconds + phase - turn * cycle
    x = (hash01(0, turn, 7) - 0.5) * BOX_M[0] + math.sin(age * 2.0) * 0.1
    z, y = 0.8 + BOX_M[1] * hash01(0, turn, 8), -0.6 * BOX_M[2] + 1.6 * age
    image = np.full((400, 600, 3), 0.2)
    fall(image, 100.0, seconds, speed, exposure, 1, 1.6, 0.05, 1.0)
    rows, columns = np.nonzero(image[..., 0] != 0.2)
    assert columns.mean() + 0.5 == pytest.approx(100 * x / z + 300, abs=1.0)
    assert rows.mean() + 0.5 == pytest.approx(100 * (y + 1.6 * exposure / 2) / z + 200, abs=1.0)


def test_a_drop_on_the_lens_shows_the_view_upside_down() -> None:
    image, spare = picture(6), picture(6)
    _lens_drop(image, spare, 15.5, 11.5, 5.0)
    changed = np.argwhere(np.any(image != spare, axis=2))
    assert np.hypot(*(changed + 0.5 - (11.5, 15.5)).T).max() < 5.7
    for row, column in ((11, 16), (10, 15), (13, 14)):  # deep inside: three quarters of the drop's view
        dy, dx = row + 0.5 - 11.5, column + 0.5 - 15.5
        seen = spare[int(11.5 - 3 * dy), int(15.5 - 3 * dx)]
        np.testing.assert_allclose(image[row, column], 0.25 * spare[row, column] + 0.75 * seen, atol=1e-9)


def test_drops_on_the_lens_stay_creep_and_go() -> None:
    def changed(seconds: float) -> NDArray[np.bool_]:
        image = picture(7, 60, 80)
        lens_drops(image, np.empty_like(image), seconds, 3)
        return np.any(image != picture(7, 60, 80), axis=2)

    one, same, later = changed(3.0), changed(3.02), changed(40.0)
    overlap = (one & same).sum() / (one | same).sum()
    assert overlap > 0.9
    assert (one & later).sum() / (one | later).sum() < 0.5
    assert 0 < one.mean() < 0.3


@pytest.mark.parametrize("free", [0.0, 0.5, 1.0])
def test_the_veil_is_as_strong_as_the_sun_is_free(free: float) -> None:
    image, near = np.zeros((24, 32, 3)), np.zeros((24, 32))
    column, row = 16.0, 8.0
    near[5:12, 13:20] = np.where(np.arange(49).reshape(7, 7) < 49 * (1 - free), 0.1, 0.0)
    free = float((near[5:12, 13:20] == 0).mean())
    colour = (3.0, 2.0, 1.0)
    veil(image, near, column, row, colour)
    y, x = np.mgrid[:24, :32]
    level = free * (0.05 + 0.5 * np.exp(-9 * np.hypot(x - column, y - row) / 32))
    np.testing.assert_allclose(image, level[..., None] * colour, atol=1e-12)


def test_a_sun_outside_the_image_veils_by_what_is_seen_around_it() -> None:
    for column, row, wanted in ((-40.0, 8.0, 0.0), (-1.0, 8.0, 21 / 49), (31.0, 23.0, 16 / 49)):
        image = np.zeros((24, 32, 3))
        veil(image, np.zeros((24, 32)), column, row, (1.0, 1.0, 1.0))
        y, x = np.mgrid[:24, :32]
        level = wanted * (0.05 + 0.5 * np.exp(-9 * np.hypot(x - column, y - row) / 32))
        np.testing.assert_allclose(image[..., 0], level, atol=1e-12)
