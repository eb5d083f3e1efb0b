"""The drawing board, its bends and hills, and the ground that lies on it."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace_lab.city.materials import FACADE, HALF_ROAD_M, PAVEMENT, PLAIN, ROAD
from evplace_lab.city.mesh import Mesh, Primitives
from evplace_lab.city.streets import EDGE_M, KERB_M, PAVEMENT_M, Streets, close_vistas, pave
from evplace_lab.city.terrain import Terrain, Wave

metres = st.floats(-200.0, 900.0)
seeds = st.integers(0, 1000)


@given(st.floats(0.1, 9), st.floats(50, 400), st.floats(0, 7), metres)
def test_a_slope_is_the_waves_derivative(amplitude: float, length: float, phase: float, u: float) -> None:
    wave = Wave(amplitude, length, phase)
    step = 1e-4
    assert wave.slope(u) == pytest.approx((wave(u + step) - wave(u - step)) / (2 * step), abs=1e-5)
    assert wave(u + length) == pytest.approx(float(wave(u)), abs=1e-6)
    assert abs(wave(u)) <= amplitude


@given(seeds, metres, metres, st.floats(-200, 200), st.floats(-200, 200))
def test_every_rectangle_of_the_board_becomes_a_parallelogram(
    seed: int, x: float, y: float, wide: float, deep: float
) -> None:
    terrain = Terrain.of(np.random.default_rng(seed))
    (a, b), (c, d) = (terrain.world([x, x + wide], at, 0.3) for at in (y, y + deep))
    np.testing.assert_allclose(b - a, d - c, atol=1e-9)


@given(seeds, metres, metres, st.floats(-math.pi, math.pi))
def test_a_heading_is_where_a_step_on_the_board_leads(seed: int, x: float, y: float, angle: float) -> None:
    terrain = Terrain.of(np.random.default_rng(seed))
    step = 1e-4
    here, there = terrain.world([x, x + step * math.cos(angle)], [y, y + step * math.sin(angle)])
    dx, dy = (there - here)[:2]
    turned = math.remainder(terrain.heading(x, y, angle) - math.atan2(dy, dx), 2 * math.pi)
    assert turned == pytest.approx(0, abs=1e-4)


@given(seeds)
def test_streets_lie_apart_and_blocks_lie_between_them(seed: int) -> None:
    streets = Streets.of(np.random.default_rng(seed))
    for axis in (streets.x, streets.y):
        assert len(axis) == 7
        assert axis[0] == 0
        assert np.all((np.diff(axis) >= 78) & (np.diff(axis) <= 112))
    blocks = streets.blocks()
    assert len(set(blocks)) == 8 * 8
    for x0, x1, y0, y1 in blocks:
        assert x0 < x1
        assert y0 < y1
        assert not np.any((streets.x > x0 - HALF_ROAD_M + 1e-9) & (streets.x < x1 + HALF_ROAD_M - 1e-9))
        assert not np.any((streets.y > y0 - HALF_ROAD_M + 1e-9) & (streets.y < y1 + HALF_ROAD_M - 1e-9))
    roads = 8 * 2 * HALF_ROAD_M
    side = [axis[-1] - axis[0] + 2 * EDGE_M - roads for axis in (streets.x, streets.y)]
    area = sum((x1 - x0) * (y1 - y0) for x0, x1, y0, y1 in blocks)
    assert area == pytest.approx(side[0] * side[1])


FLAT = Terrain(*(Wave(0.0, 100.0, 0.0) for _ in range(4)))


def paved(terrain: Terrain, streets: Streets) -> Primitives:
    mesh = Mesh()
    courts = dict.fromkeys(itertools.product(range(8), range(8)), (0.2, 0.3, 0.1))
    pave(mesh, streets, terrain, courts, np.random.default_rng(1))
    return mesh.primitives()


@pytest.fixture(scope="module")
def streets() -> Streets:
    return Streets.of(np.random.default_rng(5))


@pytest.fixture(scope="module")
def ground(streets: Streets) -> Primitives:
    return paved(FLAT, streets)


def level(parts: Primitives) -> np.ndarray:
    """Which primitives lie flat: tiles, and no kerb stones."""
    return parts.normal[:, 2] > 0.5


def test_tiles_cover_the_board_once(ground: Primitives, streets: Streets) -> None:
    tiles = ground.frame[level(ground)]
    area = tiles[:, 3] * tiles[:, 7]
    side = [axis[-1] - axis[0] + 2 * EDGE_M - 2 * HALF_ROAD_M for axis in (streets.x, streets.y)]
    assert area.min() > 0
    assert area.sum() == pytest.approx(side[0] * side[1])
    assert len(np.unique(tiles[:, :2].round(6), axis=0)) == len(tiles)


def test_each_tile_is_what_its_distance_to_the_streets_makes_it(ground: Primitives, streets: Streets) -> None:
    tiles = level(ground)
    middle = ground.frame[tiles, :2] + 0.5 * (ground.frame[tiles, 3:5] + ground.frame[tiles, 6:8])
    off = np.min(
        [np.abs(middle[:, k, None] - axis).min(1) for k, axis in enumerate((streets.x, streets.y))], axis=0
    )
    wanted = np.where(off < HALF_ROAD_M, ROAD, np.where(off < HALF_ROAD_M + PAVEMENT_M, PAVEMENT, PLAIN))
    np.testing.assert_array_equal(ground.material[tiles], wanted)
    heights = ground.frame[tiles, 2]
    np.testing.assert_allclose(heights, np.where(wanted == ROAD, 0.0, KERB_M))


def test_a_road_tile_knows_the_streets_beside_it(ground: Primitives, streets: Streets) -> None:
    roads = ground.material == ROAD
    look, frame = ground.look[roads], ground.frame[roads]
    np.testing.assert_allclose(look[:, 3:5], frame[:, :2])
    np.testing.assert_allclose(look[:, 5], frame[:, 3])
    np.testing.assert_allclose(look[:, 6], frame[:, 7])
    middle = look[:, 3:5] + look[:, 5:7] / 2
    for k, axis in enumerate((streets.x, streets.y)):
        nearest = axis[np.abs(middle[:, k, None] - axis).argmin(1)]
        np.testing.assert_array_equal(look[:, 7 + k], nearest)


def test_kerbs_ring_every_block_and_face_the_road(ground: Primitives, streets: Streets) -> None:
    stones = ground.frame[~level(ground)]
    around = sum(2 * (x1 - x0) + 2 * (y1 - y0) for x0, x1, y0, y1 in streets.blocks())
    assert np.hypot(stones[:, 3], stones[:, 4]).sum() == pytest.approx(around)
    np.testing.assert_allclose(stones[:, 8], KERB_M)
    outwards = stones[:, :2] + stones[:, 3:5] / 2 + 0.2 * ground.normal[~level(ground), :2]
    for x, y in outwards[::37]:
        assert not any(x0 < x < x1 and y0 < y < y1 for x0, x1, y0, y1 in streets.blocks())


def _board_lines(streets: Streets) -> list[np.ndarray]:
    """Where tiles begin and end on the board, along x and along y."""
    tiles = paved(FLAT, streets).frame
    return [np.concatenate([tiles[:, k], tiles[:, k] + tiles[:, k + 3 + 3 * k]]).round(6) for k in (0, 1)]


def test_bent_ground_has_no_cracks(streets: Streets) -> None:
    """But for the border, every corner of a tile is a corner of three others, kerbs taken away."""
    parts = paved(Terrain.of(np.random.default_rng(2)), streets)
    tiles = parts.frame[level(parts)]
    tiles[:, 2] -= np.where(parts.material[level(parts)] == ROAD, 0.0, KERB_M)
    o, u, v = tiles[:, :3], tiles[:, 3:6], tiles[:, 6:9]
    _, counts = np.unique(np.concatenate([o, o + u, o + v, o + u + v]).round(6), axis=0, return_counts=True)
    columns, rows = (len(np.unique(ground_lines)) for ground_lines in _board_lines(streets))
    border = 2 * (columns + rows) - 8
    assert np.bincount(counts).tolist() == [0, 4, border, 0, columns * rows - border - 4]


def test_every_street_ends_at_a_house(streets: Streets) -> None:
    mesh = Mesh()
    close_vistas(mesh, streets, FLAT, np.random.default_rng(3))
    ends = mesh.primitives()
    assert len(mesh) == 2 * (len(streets.x) + len(streets.y))
    assert set(ends.material) == {FACADE}
    middle = ends.frame[:, :2] + ends.frame[:, 3:5] / 2
    centre = np.array([streets.x.mean(), streets.y.mean()])
    assert np.all(np.sum(ends.normal[:, :2] * (centre - middle), axis=1) > 0), "they face the town"
    assert np.all((ends.frame[:, 8] >= 10) & (ends.frame[:, 8] <= 18))
    found = {tuple(row) for row in middle.round(6)}
    wanted = {(x, y) for x in streets.x for y in (streets.y[0] - EDGE_M, streets.y[-1] + EDGE_M)}
    wanted |= {(x, y) for y in streets.y for x in (streets.x[0] - EDGE_M, streets.x[-1] + EDGE_M)}
    assert found == {(round(x, 6), round(y, 6)) for x, y in wanted}
