"""Light: closed forms for the sky, the sun, lamps and headlights, and the maps made once for a town."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_town import made_town

from evplace_lab.city.conditions import CONDITIONS, Condition
from evplace_lab.city.light import (
    Light,
    lamps_on_facade,
    lamps_on_ground,
    own_headlights,
    sky,
    sunlight,
    through_air,
)
from evplace_lab.city.lightmaps import LAMP_REACH_M, NEAREST, _lamplight, height_map, light_maps
from evplace_lab.city.materials import FACADE
from evplace_lab.city.town import Town

PLAIN = Condition(ambient=(0.1, 0.1, 0.1), zenith=(0.2, 0.4, 0.8), horizon=(1.0, 0.9, 0.7)).light()
NIGHT = CONDITIONS["night"].light()
UP, EAST = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
OPEN = np.full((8, 8), -1000.0, np.float32)
unit = st.floats(0.02, 1.0)


@pytest.fixture(scope="module")
def town() -> Town:
    return made_town()


@pytest.mark.parametrize("name", CONDITIONS)
def test_every_conditions_sun_is_a_unit_vector_above_the_horizon(name: str) -> None:
    light = CONDITIONS[name].light()
    assert np.linalg.norm(light.towards_sun) == pytest.approx(1)
    assert light.towards_sun[2] > 0
    same = {field.name for field in dataclasses.fields(Condition)} & set(Light._fields) - {"towards_sun"}
    assert {key: getattr(CONDITIONS[name], key) for key in same} == {key: getattr(light, key) for key in same}


@given(unit)
def test_a_clear_sky_goes_from_horizon_to_zenith_with_the_root_of_height(z: float) -> None:
    side = math.sqrt(1 - min(z, 1.0) ** 2)
    wanted = np.array(PLAIN.horizon) + (np.array(PLAIN.zenith) - PLAIN.horizon) * math.sqrt(z)
    np.testing.assert_allclose(sky(side, 0.0, z, PLAIN), wanted, atol=1e-12)
    np.testing.assert_allclose(sky(0.0, side, -z, PLAIN), PLAIN.horizon, atol=1e-12)


def test_the_sky_glows_about_the_sun_only() -> None:
    light = PLAIN._replace(sun=(3.0, 2.0, 1.0), towards_sun=(0.6, 0.0, 0.8), glow=2.0)
    at_sun, clear = sky(0.6, 0.0, 0.8, light), sky(0.6, 0.0, 0.8, PLAIN)
    np.testing.assert_allclose(np.subtract(at_sun, clear), [6.0, 4.0, 2.0])
    np.testing.assert_allclose(sky(-0.6, 0.0, 0.8, light), sky(-0.6, 0.0, 0.8, PLAIN))
    angle = math.acos(0.95)
    x, z = math.cos(math.atan2(0.8, 0.6) + angle), math.sin(math.atan2(0.8, 0.6) + angle)
    np.testing.assert_allclose(np.subtract(sky(x, 0.0, z, light), sky(x, 0.0, z, PLAIN))[0], 6.0 * 0.5**6)


def test_clouds_change_the_sky_above_the_horizon_only() -> None:
    cloudy = PLAIN._replace(clouds=1.0)
    around = np.linspace(0, 2 * math.pi, 40)
    changed = [
        sky(0.8 * math.cos(a), 0.8 * math.sin(a), 0.6, cloudy) != sky(0.8, 0.0, 0.6, PLAIN) for a in around
    ]
    assert 2 < sum(changed) < 40
    assert sky(1.0, 0.0, 0.005, cloudy) == sky(1.0, 0.0, 0.005, PLAIN)


def test_the_sun_shines_by_the_cosine_and_not_from_behind() -> None:
    light = PLAIN._replace(sun=(3.0, 2.0, 1.0), towards_sun=(0.6, 0.0, 0.8))
    at = (4.0, 4.0, 0.0)
    np.testing.assert_allclose(sunlight(at, UP, False, light, OPEN, (0.0, 0.0)), [2.4, 1.6, 0.8])
    np.testing.assert_allclose(sunlight(at, EAST, False, light, OPEN, (0.0, 0.0)), [1.8, 1.2, 0.6])
    assert sunlight(at, (-1.0, 0.0, 0.0), False, light, OPEN, (0.0, 0.0)) == (0.0, 0.0, 0.0)
    assert sunlight(at, UP, False, PLAIN, OPEN, (0.0, 0.0)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("soft", "dark", "lit"), [(False, -0.9, 0.3), (True, -6.0, -2.0)])
def test_shade_ends_a_little_about_its_height(soft: bool, dark: float, lit: float) -> None:
    light = PLAIN._replace(sun=(1.0, 1.0, 1.0), towards_sun=UP)
    shade = np.full((8, 8), 5.0, np.float32)
    got = [
        sunlight((4.0, 4.0, 5.0 + above), UP, soft, light, shade, (0.0, 0.0))[0]
        for above in (dark, (dark + lit) / 2, lit)
    ]
    assert got == pytest.approx([0.0, 0.5, 1.0], abs=1e-6)


@given(st.floats(-1, 1))
def test_lamps_light_level_ground_most(upness: float) -> None:
    lamplight = np.full((6, 6), 0.2, np.float32)
    r, g, b = lamps_on_ground((3.0, 3.0, 0.0), upness, NIGHT, lamplight, (0.0, 0.0))
    assert r == pytest.approx(0.2 * NIGHT.lamps * (0.35 + 0.65 * max(upness, 0.0)), rel=1e-6)
    assert (g / r, b / r) == pytest.approx((0.8, 0.52))


def test_each_lamp_lights_a_facade_from_its_own_side() -> None:
    lamps = np.array([[3.0, 0, 4, 1, 0.8, 0.5], [-3.0, 0, 4, 1, 1, 1], [2.0, 2, 6, 0.5, 0.4, 0.3]])
    near = np.array([[0, 1, 2, -1, -1, -1], [2, -1, 0, 0, 0, 0]], np.int32)
    at = np.array([0.0, 0.0, 1.0])

    def one(lamp: np.ndarray) -> np.ndarray:
        to = lamp[:3] - at
        squared = to @ to + 1
        level = max(to[0], 0.0) / squared**1.5 * NIGHT.lamps * (0.25 + 0.75 * to[2] / math.sqrt(squared))
        return np.asarray(level * lamp[3:])

    position = (0.0, 0.0, 1.0)
    both = lamps_on_facade(0, position, EAST, NIGHT, near, lamps)
    np.testing.assert_allclose(both, one(lamps[0]) + one(lamps[2]), atol=1e-12)
    np.testing.assert_allclose(
        lamps_on_facade(1, position, EAST, NIGHT, near, lamps), one(lamps[2]), atol=1e-12
    )


def test_headlights_are_a_cone_with_a_cut_off() -> None:
    camera, ahead, facing = (0.0, 0.0, 1.5), (1.0, 0.0, 0.0), (-1.0, 0.0, 0.0)

    def level(x: float, y: float, z: float) -> float:
        return float(own_headlights((x, y, z), facing, camera, ahead, NIGHT)[0])

    lamp_m = 0.65
    straight = level(20.0, 0.0, lamp_m)
    cut = 1 - 0.9 * 0.25**2 * 2.5  # the horizon lies a quarter of the way through the cut-off
    assert straight == pytest.approx(cut * NIGHT.headlights / (20.1**2 + 4), rel=1e-6)
    assert level(10.0, 0.0, lamp_m) > 3 * straight
    assert level(20.0, 18.0, lamp_m) == 0.0, "beside the cone"
    assert level(-20.0, 0.0, lamp_m) == 0.0
    assert level(20.0, 0.0, 3.0) < 0.15 * level(20.0, 0.0, 0.2)
    back = own_headlights((20.0, 0.0, lamp_m), (1.0, 0.0, 0.0), camera, ahead, NIGHT)
    assert back == (0.0, 0.0, 0.0)


@given(st.floats(0.0, 300.0), st.floats(0.0, 0.1))
def test_air_takes_the_horizons_colour_exponentially(distance: float, fog: float) -> None:
    light = PLAIN._replace(fog=fog)
    kept = math.exp(-fog * distance)
    wanted = kept * np.array([0.1, 0.2, 0.3]) + (1 - kept) * np.array(light.horizon)
    np.testing.assert_allclose(through_air((0.1, 0.2, 0.3), distance, light), wanted, atol=1e-12)


def test_lamplight_equals_a_sum_over_all_lamps(town: Town) -> None:
    lamps = town.lamps[:5]
    few = dataclasses.replace(town, lamps=lamps)
    low, high = lamps[:, :2].min(0) - 60, lamps[:, :2].max(0) + 60
    origin = np.floor(low)
    columns, rows = np.ceil(high - origin).astype(int)
    level = _lamplight(few, origin, rows, columns)
    for y, x in np.random.default_rng(0).integers(0, (rows, columns), (60, 2)):
        wanted = 0.0
        for lamp in lamps:
            dx, dy = x + 0.5 - (lamp[0] - origin[0]), y + 0.5 - (lamp[1] - origin[1])
            squared = dx * dx + dy * dy + 6.9**2
            if max(abs(dx), abs(dy)) < LAMP_REACH_M - 1:
                wanted += 6.9 / squared**1.5 * (0.25 + 0.75 * 6.9 / math.sqrt(squared)) * lamp[3]
        assert level[y, x] == pytest.approx(wanted, abs=0.15 * 6.9 / LAMP_REACH_M**3 + 1e-4)


def test_the_nearest_lamps_are_the_nearest(town: Town) -> None:
    near = light_maps(town, NIGHT, len(town.scene.shape) + 3).near_lamps
    assert near.shape == (len(town.scene.shape) + 3, NEAREST)
    assert np.all(near[-3:] == -1)
    assert np.all(near[: len(town.scene.shape)][town.scene.material != FACADE] == -1)
    frame = town.scene.frame
    for q in np.flatnonzero(town.scene.material == FACADE)[::97]:
        middle = frame[q, :2] + (frame[q, 3:5] + frame[q, 6:8]) / 2
        distance = np.hypot(*(town.lamps[:, :2] - middle).T)
        wanted = [k for k in np.argsort(distance, kind="stable")[:NEAREST] if distance[k] < 45]
        assert near[q][near[q] >= 0].tolist() == wanted


def test_houses_and_trees_stand_in_the_height_map(town: Town) -> None:
    ground = town.scene.frame[:, :2]
    origin = np.floor(ground.min(0)) - 60
    columns, rows = (np.ceil(ground.max(0)) - origin + 120).astype(int)
    heights = height_map(town, origin, rows, columns)
    for house in town.houses[::23]:
        middle = town.terrain.world((house.lot.x0 + house.lot.x1) / 2, (house.lot.y0 + house.lot.y1) / 2)
        x, y = (middle[:2] - origin).astype(int)
        assert heights[y, x] >= np.float32(house.top)
    for x, y, top, _ in town.trees[::31]:
        assert heights[int(y - origin[1]), int(x - origin[0])] >= np.float32(top)
    known = {np.float32(house.top) for house in town.houses} | {np.float32(tree[2]) for tree in town.trees}
    assert set(np.unique(heights).tolist()) <= {float(value) for value in known} | {-1000.0}
    assert 0.1 < (heights > 0).mean() < 0.5
