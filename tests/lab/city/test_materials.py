"""What surfaces are made of: where paint and panes lie, and that nothing flickers or turns negative."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace_lab.city import materials
from evplace_lab.city.conditions import CONDITIONS
from evplace_lab.city.facades import facade
from evplace_lab.city.materials import Look

DAY, NIGHT = CONDITIONS["day"].light(), CONDITIONS["night"].light()
FINE = 1e-3
share = st.floats(0.0, 1.0)
footprints = st.floats(0.0, 3.0)


def look(*values: float) -> Look:
    return tuple(float(value) for value in (*values, *[0.0] * (16 - len(values))))


def tile(x: float, y: float, style: float = 0.5) -> Look:
    """A road tile of one metre at (x, y); the streets that cross are at 0."""
    return look(0.13, 0.13, 0.13, x, y, 1.0, 1.0, 0.0, 0.0, style, style)


def road_at(x: float, y: float, style: float = 0.5, snow: float = 0.0) -> float:
    return float(materials.road(tile(x, y, style), 0.0, 0.0, FINE, FINE, snow)[0])


def test_looks_go_by_value() -> None:
    looks = np.arange(48.0).reshape(3, 16)
    assert materials.look_of(looks, 1) == tuple(range(16, 32))
    assert materials.colour_of(look(0.1, 0.2, 0.3)) == (0.1, 0.2, 0.3)


@pytest.mark.parametrize("style", [0.1, 0.5, 0.9])
def test_the_middle_of_a_road_is_dashed_or_drawn_through(style: float) -> None:
    along = np.arange(20.0, 44.0, 0.25) + 0.1
    painted = np.array([road_at(0.0, y, style) > 0.5 for y in along])
    wanted = np.ones(len(along), bool) if style >= 0.7 else along % 6 < 3
    np.testing.assert_array_equal(painted, wanted)


@pytest.mark.parametrize(("style", "drawn"), [(0.1, False), (0.5, True)])
def test_edges_are_marked_on_some_streets(style: float, drawn: bool) -> None:
    for off in (-3.2, 3.2):
        assert (road_at(off, 30.0, style) > 0.5) == drawn
        assert road_at(off + 0.2, 30.0, style) < 0.4


def test_a_crossing_has_zebras_and_stop_lines() -> None:
    across = np.arange(-5.0, 5.0, 0.1) + 0.01
    zebra = np.array([road_at(x, 7.5) > 0.5 for x in across])
    wanted = (across % 1.1 < 0.55) & (np.abs(across) < 4.8)
    assert (zebra == wanted).mean() > 0.97
    stop = np.array([road_at(x, 10.2, 0.1) > 0.5 for x in across])
    np.testing.assert_array_equal(stop, (across > 0) & (across < 4.8))
    assert not any(road_at(x, 2.0) > 0.4 for x in across), "nothing is painted where streets meet"


def test_streets_along_x_are_marked_as_those_along_y() -> None:
    for off, along in ((0.0, 31.0), (3.2, 20.0), (1.0, 7.5), (2.0, 10.2)):
        paint = [(road_at(off, along) > 0.5), (road_at(along, off) > 0.5)]
        assert paint[0] == paint[1]


def test_snow_lies_where_no_wheel_has_been() -> None:
    white, track = road_at(2.0, 30.0, snow=1.0), road_at(1.15, 30.0, snow=1.0)
    assert white == pytest.approx(materials.WHITE[0])
    assert track < 0.4
    assert road_at(-2.65, 30.0, snow=1.0) == pytest.approx(track, abs=0.15)


@given(share, share, st.floats(1.0, 30.0))
def test_from_afar_a_road_is_nearly_even(s: float, t: float, footprint: float) -> None:
    """What is smaller than a pixel fades out: no grain, no slab, no dash is left."""
    colour = materials.road(tile(60.0, 40.0), s, t, footprint, footprint, 0.0)
    near = materials.road(tile(60.0, 40.0), s + 0.01, t, footprint, footprint, 0.0)
    assert abs(colour[0] - near[0]) < 0.02


@given(share, share)
def test_grain_has_faded_where_it_is_left_out(s: float, t: float) -> None:
    with_grain, without = (
        materials.road(tile(60.0, 40.0), s, t, footprint, footprint, 0.0)[0] for footprint in (1.999, 2.001)
    )
    assert abs(with_grain - without) < 0.003


def test_slabs_have_joints_every_nine_decimetres() -> None:
    plain = look(0.3, 0.3, 0.3, 0.0, 0.0, 9.0, 9.0)
    joints, slabs = (
        np.array([materials.pavement(plain, (0.9 * k + d) / 9, 0.05, FINE, FINE, 0.0)[0] for k in range(9)])
        for d in (0.03, 0.4)
    )
    assert np.all(joints < slabs)
    assert materials.pavement(plain, 0.3, 0.3, FINE, FINE, 1.0) == pytest.approx(materials.WHITE)


def test_a_car_is_dark_at_its_sill_and_light_at_its_shoulder() -> None:
    paint = look(0.5, 0.1, 0.1)
    sill, door, shoulder = (materials.car_side(paint, 0.3, t, FINE, FINE) for t in (0.05, 0.5, 0.77))
    assert sill[0] < 0.25 < door[0] < shoulder[0]
    assert door == pytest.approx((0.5, 0.1, 0.1))
    gap = materials.car_side(paint, 0.48, 0.5, FINE, FINE)
    assert gap[0] < 0.3


@given(share)
def test_a_lamp_goes_from_its_day_to_its_night(night: float) -> None:
    reflects, shines = materials.lamp(look(1.0, 0.8, 0.5, 0.1, 4.0), DAY._replace(night=night))
    np.testing.assert_allclose(shines, np.array([1.0, 0.8, 0.5]) * (0.1 + 3.9 * night))
    np.testing.assert_allclose(reflects, [0.3, 0.24, 0.15])


def test_bars_are_bars_and_a_hedge_is_leaves() -> None:
    bars, at = look(0.2, 0.2, 0.2, 8.0, 1.0), (0.0, 0.0, 0.0)
    levels = [materials.fence(bars, (0.4 * k + 0.2) / 8.0, FINE, at, FINE)[0] for k in range(20)]
    np.testing.assert_allclose(levels, [0.24, 0.1] * 10)
    assert materials.fence(bars, 0.31, 3.0, at, FINE)[0] == pytest.approx(0.17, abs=0.01)
    hedge = look(0.2, 0.3, 0.1, 8.0, 0.0)
    here, there = (materials.fence(hedge, 0.1, FINE, place, 0.0) for place in (at, (0.4, 0.2, 0.1)))
    assert here != there


def test_a_roof_has_its_rows_of_tiles() -> None:
    rows = look(0.4, 0.2, 0.1, 10.0)
    levels = np.array([materials.roof(rows, t, FINE)[0] for t in np.arange(0.0025, 1.0, 0.005)])
    assert np.isclose(levels, 0.28).mean() == pytest.approx(0.25, abs=0.03)
    assert np.isclose(levels, 0.4).mean() == pytest.approx(0.75, abs=0.03)


def test_glass_mirrors_the_sky_within_its_posts() -> None:
    pane = look(0.03, 0.035, 0.04, 0.0, 0.0, 0.5, 0.1, 0.1, 1.0)
    inside, shine = materials.glass(pane, 0.25, 0.5, FINE, FINE, DAY)
    assert inside == pytest.approx((0.03, 0.035, 0.04))
    np.testing.assert_allclose(shine, np.array(DAY.horizon) * 0.09)
    for s, t in ((0.02, 0.5), (0.5, 0.5), (0.25, 0.95)):
        post, none = materials.glass(pane, s, t, FINE, FINE, DAY)
        assert post == pytest.approx((0.5, 0.1, 0.1), abs=1e-6)
        assert max(none) == pytest.approx(0, abs=1e-6)
    without = (*pane[:8], 0.0, *pane[9:])
    assert materials.glass(without, 0.5, 0.5, FINE, FINE, DAY)[0] == pytest.approx((0.03, 0.035, 0.04))


def wall(style: int = 0, kind: float = 0.9, lit: float = 0.5, wide: float = 20.0, seed: int = 9) -> Look:
    return look(0.5, 0.45, 0.4, wide, 15.0, 3.2, 2.4, 0.5, 0.55, 3.8, seed, style, 0.6, lit, kind)


def shone(one: Look, s: np.ndarray, t: np.ndarray, light: object) -> np.ndarray:
    return np.array([[facade(one, a, b, FINE, FINE, light)[1][0] for a in s] for b in t])


def test_windows_shine_at_night_one_by_one_and_only_windows() -> None:
    """Every pane is lit or dark as a whole, at its own place in pitch and storey."""
    middles_u, middles_v = (np.arange(8) + 0.3) * 2.4 / 20, (3.8 + (np.arange(3) + 0.5) * 3.2) / 15
    lit = shone(wall(), middles_u, middles_v, NIGHT) > 0
    assert 0.2 < lit.mean() < 0.8
    np.testing.assert_array_equal(lit, shone(wall(), middles_u + 0.005, middles_v, NIGHT) > 0)
    between = shone(wall(), (np.arange(8) + 0.02) * 2.4 / 20, middles_v, NIGHT)
    assert between.max() == 0
    assert shone(wall(lit=0.0), middles_u, middles_v, NIGHT).max() == 0
    all_lit = shone(wall(lit=1.0), middles_u, middles_v, NIGHT) > 0
    assert all_lit.mean() > 0.8, "but for those that are bricked up"


def test_by_day_panes_mirror_the_zenith() -> None:
    s, t = (np.arange(8) + 0.3) * 2.4 / 20, np.array([(3.8 + 1.6) / 15])
    shine = shone(wall(), s, t, DAY)
    assert set(np.round(shine.ravel() / DAY.zenith[0], 4)) <= {0.0, 0.24}


def test_shops_have_fronts_and_houses_one_door() -> None:
    s = np.linspace(0.01, 0.99, 300)
    shop, house = (
        np.array([facade(wall(kind=kind), a, 1.5 / 15, FINE, FINE, DAY)[0] for a in s]) for kind in (0.1, 0.9)
    )
    narrow = np.array([facade(wall(kind=0.1, wide=4.0), a, 1.5 / 15, FINE, FINE, DAY)[0] for a in s])
    door = np.all(np.isclose(shop, (0.08, 0.07, 0.06)), axis=1)
    runs = np.diff(np.concatenate([[0], door.astype(int)])).clip(0).sum()
    assert runs == 3, "three fronts of 20 m / 3 each have a door"
    assert not np.allclose(shop, house)
    assert not np.any(np.all(np.isclose(narrow, (0.08, 0.07, 0.06)), axis=1)), "no shop fits 4 m"


@given(st.integers(0, 3), share, share, share, footprints, footprints, st.integers(1, 30000))
def test_a_facade_is_a_reflectance_and_never_darker_than_black(
    style: int, kind: float, s: float, t: float, fs: float, ft: float, seed: int
) -> None:
    for light in (DAY, NIGHT):
        colour, shine = facade(wall(style, kind, seed=seed), s, t, fs / 20, ft / 20, light)
        assert min(*colour, *shine) >= 0
        assert max(colour) < 1.2
        assert max(shine) < 3


@given(share, share, st.floats(0, 0.3), st.floats(0, 0.3))
def test_a_sign_is_lit_as_windows_are(s: float, t: float, fs: float, ft: float) -> None:
    board = look(0.6, 0.2, 0.1, 0.7, *[0.0] * 6, 5.0)
    colour, shine = materials.sign(board, s, t, fs, ft, NIGHT)
    np.testing.assert_allclose(shine, np.array(colour) * NIGHT.windows * 0.7, atol=1e-12)
    assert materials.sign(board, s, t, fs, ft, DAY)[1] == (0.0, 0.0, 0.0)
    assert materials.sign(board, 0.02, 0.5, FINE, FINE, DAY)[0] == pytest.approx((0.05, 0.05, 0.05))


def test_leaves_are_never_black() -> None:
    green = look(0.1, 0.2, 0.05, *[0.0] * 7, 3.0)
    rng = np.random.default_rng(0)
    levels = np.array(
        [materials.leaves(green, tuple(map(float, p)), 0.01)[1] for p in rng.uniform(-50, 50, (500, 3))]
    )
    assert levels.min() >= 0.2 * 0.08 - 1e-12
    assert levels.std() > 0.02
    far = np.array(
        [materials.leaves(green, tuple(map(float, p)), 20.0)[1] for p in rng.uniform(-50, 50, (200, 3))]
    )
    assert far.std() < 0.2 * levels.std()
