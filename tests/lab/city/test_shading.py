"""One frame of a made-up scene: where each pixel's light comes from, worked out by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace_lab.city.conditions import Condition
from evplace_lab.city.culling import draw_groups, group
from evplace_lab.city.light import Light, Maps, sky
from evplace_lab.city.materials import LAMP, LEAVES, PAVEMENT, PLAIN, ROAD
from evplace_lab.city.mesh import (
    OVAL,
    QUAD,
    SPHERE,
    Mesh,
    Primitives,
    box_corners,
    join,
    placed,
    up,
)
from evplace_lab.city.raster import FAR_M, NEAR_M, Buffers, View, _cut, sample_offset, turned
from evplace_lab.city.shading import Frame, _share, _softened, _spot, shade_frame

WIDTH, HEIGHT, FOCAL = 32, 24, 20.0
VIEW = View((0.0, 0.0, 1.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), FOCAL, WIDTH, HEIGHT)
CLEAR = Condition(ambient=(0.5, 0.6, 0.7), zenith=(0.2, 0.4, 0.8), horizon=(1.0, 0.9, 0.7), fog=0.0).light()
NO_MAPS = Maps(
    (-100.0, -100.0),
    np.full((2, 2), -1000.0, np.float32),
    np.zeros((2, 2), np.float32),
    np.zeros((1, 6)),
    np.full((64, 6), -1, np.int32),
)


def shaded(scene: Primitives, light: Light = CLEAR, view: View = VIEW) -> tuple[Frame, Buffers]:
    shape = (view.height, view.width)
    buffers = Buffers.of((view.width, view.height), len(scene.shape) + 1)
    frame = Frame(np.empty((*shape, 3)), np.empty(shape), np.empty(shape))
    draw_groups(scene, group(scene), view, buffers)
    shade_frame(scene, view, buffers, light, NO_MAPS, frame)
    return frame, buffers


def wall(x: float, material: int = PLAIN, look: tuple[float, ...] = (0.4, 0.3, 0.2)) -> Primitives:
    """Across the whole view, `x` metres ahead, facing the camera."""
    mesh = Mesh()
    mesh.quad((x, 60.0, -60.0), (0.0, -120.0, 0.0), (0.0, 0.0, 120.0), material, look)
    return mesh.primitives()


NOTHING = Mesh().primitives()


def test_an_empty_scene_is_the_sky_at_each_pixel() -> None:
    frame, buffers = shaded(NOTHING)
    assert np.all(buffers.owner == -1)
    for row, column in ((0, 0), (5, 20), (11, 31), (23, 3)):
        ray = np.array([1.0, -(column + 0.5 - WIDTH / 2) / FOCAL, -(row + 0.5 - HEIGHT / 2) / FOCAL])
        ray /= np.linalg.norm(ray)
        np.testing.assert_allclose(frame.radiance[row, column], sky(*ray.tolist(), CLEAR), atol=0.02)
    assert frame.nearness.max() == 0
    assert frame.ground.max() == 0


def test_a_wall_reflects_the_light_from_all_sides() -> None:
    frame, _ = shaded(wall(8.0))
    np.testing.assert_allclose(frame.radiance[12, 16], np.array(CLEAR.ambient) * 0.81 * (0.4, 0.3, 0.2))
    np.testing.assert_allclose(frame.nearness, 1 / 8.0)


def test_a_wall_in_the_sun_reflects_that_too() -> None:
    sun = CLEAR._replace(sun=(2.0, 1.5, 1.0), towards_sun=(-0.8, 0.0, 0.6))
    frame, _ = shaded(wall(8.0), sun)
    wanted = (np.array(CLEAR.ambient) * 0.81 + np.array(sun.sun) * 0.8) * (0.4, 0.3, 0.2)
    np.testing.assert_allclose(frame.radiance[12, 16], wanted, rtol=1e-6)


@given(st.floats(1.0, 200.0), st.floats(0.001, 0.05))
def test_fog_hides_a_wall_by_its_distance(x: float, fog: float) -> None:
    frame, _ = shaded(wall(x), CLEAR._replace(fog=fog))
    bare = np.array(CLEAR.ambient) * 0.81 * (0.4, 0.3, 0.2)
    kept = math.exp(-fog * x)
    wanted = kept * bare + (1 - kept) * np.array(CLEAR.horizon)
    np.testing.assert_allclose(frame.radiance[12, 16], wanted, rtol=1e-6)


def test_a_lamp_shines_by_itself() -> None:
    lamp = wall(8.0, LAMP, (1.0, 0.5, 0.25, 2.0, 9.0))
    frame, _ = shaded(lamp)
    dark = np.array(CLEAR.ambient) * 0.81 * np.array([1.0, 0.5, 0.25]) * 0.3
    np.testing.assert_allclose(frame.radiance[12, 16], dark + np.array([2.0, 1.0, 0.5]))


def test_the_nearer_wall_is_seen_and_nothing_from_behind() -> None:
    both = join([wall(20.0), wall(8.0, look=(0.1, 0.9, 0.1))])
    frame, buffers = shaded(both)
    assert np.all(buffers.owner == 1)
    assert frame.radiance[12, 16, 1] > frame.radiance[12, 16, 0]
    away = Mesh()
    away.quad((8.0, -60.0, -60.0), (0.0, 120.0, 0.0), (0.0, 0.0, 120.0), PLAIN, (1.0, 1.0, 1.0))
    for scene in (away.primitives(), wall(NEAR_M / 2), wall(FAR_M + 5), wall(-8.0)):
        assert np.all(shaded(scene)[1].owner == -1)


def test_the_ground_is_road_below_the_horizon_and_wet_roads_are_darker() -> None:
    mesh = Mesh()
    tail = (-300.0, -300.0, 600.0, 600.0, -1000.0, -1000.0, 0.1, 0.1)
    mesh.quad((-300.0, -300.0, 0.0), (600.0, 0, 0), (0, 600.0, 0), ROAD, (0.13, 0.13, 0.13, *tail))
    road = mesh.primitives()
    frame, _ = shaded(road)
    np.testing.assert_array_equal(frame.ground[14:], 1.0)
    np.testing.assert_array_equal(frame.ground[:12], 0.0)
    row = 20
    depth = 1.0 / ((row + 0.5 - HEIGHT / 2) / FOCAL)
    assert frame.nearness[row, 16] == pytest.approx(1 / depth, rel=1e-3)
    wet, _ = shaded(road, CLEAR._replace(wet=1.0))
    np.testing.assert_allclose(wet.radiance[16:], 0.55 * frame.radiance[16:])
    assert shaded(road._replace(material=np.array([PAVEMENT], np.int32)))[0].ground.max() == 0


def test_snow_lies_on_what_faces_the_sky() -> None:
    mesh = Mesh()
    mesh.quad((2.0, -9.0, 0.0), (30.0, 0, 0), (0, 18.0, 0), PLAIN, (0.1, 0.1, 0.1))
    snowy = CLEAR._replace(snow=1.0)
    flat, upright = shaded(mesh.primitives(), snowy)[0], shaded(wall(8.0), snowy)[0]
    np.testing.assert_allclose(flat.radiance[20, 16], np.array(CLEAR.ambient) * (0.85, 0.86, 0.90), rtol=1e-6)
    np.testing.assert_allclose(upright.radiance, shaded(wall(8.0))[0].radiance)


def test_a_pixel_with_two_owners_is_their_mean() -> None:
    """The right half of the image is a wall; its edge falls through the middle of column 16."""
    mesh = Mesh()
    edge = -8.0 * 0.5 / FOCAL  # half a pixel right of the middle
    mesh.quad((8.0, edge, -60.0), (0.0, -60.0, 0.0), (0.0, 0.0, 120.0), PLAIN, (0.4, 0.3, 0.2))
    frame, buffers = shaded(mesh.primitives())
    whole = frame.radiance[12, 20]
    counts = (buffers.owner[24:26, 32:34] == 0).sum()
    background = np.array(sky(1.0, 0.0, 0.0, CLEAR))
    mixed = whole * counts / 4 + background * (4 - counts) / 4
    assert counts == 2
    np.testing.assert_allclose(frame.radiance[12, 16], mixed, atol=0.02)
    np.testing.assert_array_equal(buffers.owner[:, :32], -1)


@given(st.lists(st.integers(-1, 2), min_size=4, max_size=4), st.integers(0, 9), st.integers(0, 9))
def test_samples_of_one_owner_are_shaded_once(owners: list[int], x: int, y: int) -> None:
    four = (owners[0], owners[1], owners[2], owners[3])
    shares = [_share(four, k, x, y) for k in range(4)]
    assert sum(count for count, _, _ in shares) == 4
    for k, (count, column, row) in enumerate(shares):
        same = [n for n in range(4) if four[n] == four[k]]
        if same[0] != k:
            assert count == 0
            continue
        assert count == len(same)
        assert row == pytest.approx(np.mean([2 * y + n // 2 + 0.5 for n in same]))
        assert column == pytest.approx(np.mean([2 * x + n % 2 + sample_offset(n // 2) for n in same]))


def test_a_spot_is_where_the_ray_meets_the_parallelogram() -> None:
    scene = wall(8.0)
    _, buffers = shaded(scene)
    plane, normal = tuple(buffers.planes[0].tolist()), tuple(scene.normal[0].tolist())
    for column, row in ((31.3, 20.5), (10.75, 40.5), (60.0, 2.5)):
        spot = _spot(plane, normal, False, column, row, VIEW)
        ray = np.array([1.0, -(column - WIDTH) / (2 * FOCAL), -(row - HEIGHT) / (2 * FOCAL)])
        at = np.array(VIEW.position) + 8 * ray
        np.testing.assert_allclose(spot.at, at, atol=1e-9)
        assert spot.depth == pytest.approx(8.0)
        assert (spot.s, spot.t) == pytest.approx(((60 - at[1]) / 120, (at[2] + 60) / 120))
        assert (spot.fs, spot.ft) == pytest.approx((8 / FOCAL / 120, 8 / FOCAL / 120))
        assert spot.size == pytest.approx(8 / FOCAL)


def test_a_ball_has_the_normals_of_a_ball() -> None:
    mesh = Mesh()
    mesh.sphere((6.0, 0.0, 1.0), 1.5, LEAVES, (0.1, 0.2, 0.05))
    scene = mesh.primitives()
    _, buffers = shaded(scene)
    plane = tuple(buffers.planes[0].tolist())
    middle = _spot(plane, (0.0, 0.0, 1.0), True, float(WIDTH), float(HEIGHT), VIEW)
    np.testing.assert_allclose(middle.normal, (-1.0, 0.0, 0.0), atol=1e-6)
    above = _spot(plane, (0.0, 0.0, 1.0), True, float(WIDTH), HEIGHT - 2 * FOCAL * 0.75 / 6, VIEW)
    assert above.normal[2] == pytest.approx(0.5, abs=0.02)
    assert np.linalg.norm(above.normal) == pytest.approx(1, abs=1e-9)
    assert _softened(LEAVES, (1.0, 0.0, 0.0)) == (0.6, 0.0, 0.4)
    assert _softened(PLAIN, (1.0, 0.0, 0.0)) == (1.0, 0.0, 0.0)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-9, 0), st.floats(0, 9))
def test_a_cut_span_is_where_the_line_is_not_negative(slope: float, value: float, a: float, b: float) -> None:
    low, high = _cut((a, b), slope, value)
    for x in np.linspace(a, b, 41):
        inside = low <= x <= high
        height = value + slope * x
        if abs(height) > 1e-9:
            assert inside == (height > 0)


@given(st.floats(-3.2, 3.2), st.floats(-9, 9), st.floats(-9, 9))
def test_placing_turns_and_moves(angle: float, x: float, y: float) -> None:
    mesh = Mesh()
    mesh.quad((1, 0, 0), (2, 0, 0), (0, 0, 1), PLAIN, (1, 1, 1))
    mesh.sphere((0, 3, 1), 0.5, PLAIN, (1, 1, 1))
    parts = placed(mesh.primitives(), (x, y, 2.0), angle)
    c, s = math.cos(angle), math.sin(angle)
    np.testing.assert_allclose(parts.frame[0], [x + c, y + s, 2, 2 * c, 2 * s, 0, 0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(parts.frame[1], [x - 3 * s, y + 3 * c, 3, 0.5, 0, 0, 0, 0, 0], atol=1e-12)
    np.testing.assert_allclose(parts.normal[0], [s, -c, 0], atol=1e-12)
    back = placed(parts, (0, 0, 0), -angle)
    np.testing.assert_allclose(np.linalg.norm(back.frame[0, 3:6]), 2)


def test_a_box_is_closed_and_faces_outwards() -> None:
    mesh = Mesh()
    mesh.box((3.0, 2.0, 0.5), (2.0, 1.0), 1.5, 0.4, PLAIN, (1, 1, 1), top=PLAIN)
    parts = mesh.primitives()
    assert len(mesh) == 5
    middle = np.array([3.0, 2.0, 0.5 + 0.75])
    faces = parts.frame[:, :3] + (parts.frame[:, 3:6] + parts.frame[:, 6:9]) / 2
    assert np.all(np.sum(parts.normal * (faces - middle), axis=1) > 0)
    flux = np.cross(parts.frame[:, 3:6], parts.frame[:, 6:9])
    np.testing.assert_allclose(flux.sum(0), [0, 0, 4 * 2], atol=1e-9)  # open below: the lid's area is left
    corners = box_corners((3.0, 2.0, 0.5), (2.0, 1.0), 0.4)
    np.testing.assert_allclose(corners.mean(0), (3.0, 2.0, 0.5))
    np.testing.assert_allclose(np.linalg.norm(np.diff(corners[:3], axis=0), axis=1), [4, 2])
    np.testing.assert_array_equal(up(2.5), [0, 0, 2.5])


def test_parts_join_in_their_order() -> None:
    both = join([wall(1.0), NOTHING, wall(2.0)])
    assert both.frame[:, 0].tolist() == [1.0, 2.0]
    assert [array.dtype for array in both] == [array.dtype for array in NOTHING]
    assert (QUAD, SPHERE, OVAL) == (0, 1, 2)


def brute(view: View, points: NDArray[np.float64]) -> NDArray[np.float64]:
    return (points - view.position) @ np.array([view.right, view.down, view.forward]).T


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-3, 3))
def test_the_camera_turns_vectors_by_its_axes(x: float, y: float, z: float) -> None:
    wanted = brute(VIEW, np.array([[x, y, z]]) + VIEW.position)[0]
    np.testing.assert_allclose(turned(VIEW, (x, y, z)), wanted, atol=1e-12)


def test_an_oval_is_its_rectangles_ellipse_and_a_trapezium_is_narrower_above() -> None:
    def area(shape: int, taper: tuple[float, float]) -> float:
        mesh = Mesh()
        mesh.quad((8.0, 3.0, -1.0), (0, -6.0, 0), (0, 0, 4.0), PLAIN, (1, 1, 1), taper, shape)
        return float((shaded(mesh.primitives())[1].owner == 0).mean())

    full = area(QUAD, (0.0, 0.0))
    assert full == pytest.approx(6 * 4 * (FOCAL / 8) ** 2 / (WIDTH * HEIGHT), rel=0.05)
    assert area(OVAL, (0.0, 0.0)) == pytest.approx(full * math.pi / 4, rel=0.05)
    assert area(QUAD, (0.25, 0.25)) == pytest.approx(full * 0.75, rel=0.05)
    assert area(QUAD, (1.0, 0.0)) == pytest.approx(full / 2, rel=0.05)
