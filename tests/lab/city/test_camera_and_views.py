"""The colour camera, what a view leaves out, poses on the map, and the settings of a set."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import utm
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.sources.simulators.esim import PRESETS
from evplace_lab.city.camera import (
    ADAPTS_S,
    GAMMA,
    GREY,
    LEAST_GAIN,
    MOST_GAIN,
    READ,
    SHOT,
    ColourCamera,
    _mean,
)
from evplace_lab.city.conditions import CONDITIONS
from evplace_lab.city.culling import CELL_M, Groups, draw_groups, group, seen
from evplace_lab.city.drive import Pose
from evplace_lab.city.film import EAST, NORTH, TURN, ZONE, geo_pose, view_of
from evplace_lab.city.mesh import SPHERE, Mesh, Primitives, join
from evplace_lab.city.plan import CitySettings, drive_name, drive_number
from evplace_lab.city.raster import FAR_M, Buffers, View, clear, draw, is_hidden


def even(level: float, size: tuple[int, int] = (24, 32)) -> NDArray[np.float32]:
    return np.full((*size, 3), level, np.float32)


def exposed(level: float, most_gain: float = MOST_GAIN) -> ColourCamera:
    camera = ColourCamera([0], most_gain)
    camera.expose(even(level), 0)
    return camera


@given(st.floats(0.001, 5.0), st.floats(MOST_GAIN, 64.0))
def test_the_first_frame_is_exposed_to_grey_as_far_as_the_gain_goes(level: float, most_gain: float) -> None:
    gain = min(max(GREY / min(level, 2.0), LEAST_GAIN), most_gain)
    wanted = 255 * min(gain * level, 1.0) ** (1 / GAMMA)
    picture = exposed(level, most_gain).picture(even(level))
    assert picture.dtype == np.uint8
    np.testing.assert_allclose(picture.astype(float), wanted, atol=1.0)


def test_the_gain_follows_exponentially_in_time() -> None:
    """After one time constant 1 / e of the way, in logarithms, is left; frames between change nothing."""
    once, often = exposed(0.5), exposed(0.5)
    once.expose(even(0.2), int(ADAPTS_S * 1e6))
    for k in range(1, 11):
        often.expose(even(0.2), round(k * ADAPTS_S * 1e5))
    start, end = GREY / 0.5, GREY / 0.2
    wanted = end * (start / end) ** math.exp(-1)
    for camera in (once, often):
        assert camera._gain == pytest.approx(wanted, rel=1e-3)


def test_the_meter_looks_at_the_middle_and_cuts_lights_off() -> None:
    frame = even(0.1, (40, 60))
    whole = _mean(frame)
    assert whole == pytest.approx(0.1)
    frame[:4], frame[:, :6], frame[:, 55:] = 9.0, 9.0, 9.0
    assert _mean(frame) == pytest.approx(whole)
    frame[20:24, 20:24] = 1000.0
    assert whole < _mean(frame) < 0.2


def test_codes_rise_with_light_and_saturate() -> None:
    camera = exposed(GREY)  # at a gain of 1
    light = np.linspace(-0.5, 2.0, 501, dtype=np.float32)
    codes = camera.picture(np.repeat(light, 3).reshape(1, 501, 3))[0, :, 1].astype(int)
    assert np.all(np.diff(codes) >= 0)
    assert codes[light <= 0].max() == 0
    assert codes[light >= 1].min() == 255


@pytest.mark.parametrize("level", [0.05, 0.4])
def test_noise_is_as_strong_as_light_and_gain_make_it(level: float) -> None:
    """Measured where the code is steep enough for its steps not to matter; without noise beside it."""
    camera, size = ColourCamera([1], 16.0), (200, 200)
    camera.expose(even(level, size), 0)
    gain = camera._gain
    noisy = camera.noisy_picture(even(level, size)).astype(float) / 255
    signal = noisy**GAMMA
    wanted = math.sqrt(gain * level * SHOT * gain + (READ * gain) ** 2)
    assert signal.std() == pytest.approx(wanted, rel=0.03)
    assert signal.mean() == pytest.approx(gain * level, rel=0.02)
    clean = camera.picture(even(level, size))
    assert clean.std() == 0


def scattered(seed: int, count: int = 400, reach: float = 450.0) -> Primitives:
    mesh, rng = Mesh(), np.random.default_rng(seed)
    for k in range(count):
        x, y, z = rng.uniform((-reach, -reach, 0), (reach, reach, 8))
        if k % 5 == 0:
            mesh.sphere((x, y, z), rng.uniform(0.5, 4.0), 3, (1, 1, 1))
        else:
            mesh.quad((x, y, z), rng.normal(0, 6, 3), rng.normal(0, 6, 3), 3, (1, 1, 1))
    return mesh.primitives()


def crowded(seed: int) -> Primitives:
    """Houses, behind which most is hidden, and smaller things between them."""
    mesh, rng = Mesh(), np.random.default_rng(seed)
    for _ in range(30):
        middle = (*rng.uniform(-50, 50, 2), 0.0)
        mesh.box(middle, tuple(rng.uniform(3, 7, 2)), rng.uniform(4, 20), rng.uniform(0, 3), 3, (1, 1, 1))
    return join([mesh.primitives(), scattered(seed, 100, 50.0)])


def primitives_of(groups: Groups, chosen: NDArray[np.int64]) -> NDArray[np.int32]:
    return np.concatenate([groups.members[groups.start[g] : groups.start[g + 1]] for g in chosen])


@given(st.integers(0, 30))
def test_groups_hold_every_primitive_once_within_their_sphere(seed: int) -> None:
    parts = scattered(seed, 60)
    groups = group(parts)
    assert sorted(groups.members.tolist()) == list(range(60))
    assert groups.start[0] == 0
    assert groups.start[-1] == 60
    for g, ball in enumerate(groups.ball[:-1]):
        inside = groups.members[groups.start[g] : groups.start[g + 1]]
        o, u, v = (parts.frame[inside, k : k + 3] for k in (0, 3, 6))
        flat = parts.shape[inside] != SPHERE
        corners = np.concatenate([o[flat], (o + u)[flat], (o + v)[flat], (o + u + v)[flat]])
        assert np.all(np.linalg.norm(corners - ball[:3], axis=1) <= ball[3] + 1e-9)
        reach = np.linalg.norm(o[~flat] - ball[:3], axis=1) + u[~flat, 0]
        assert np.all(reach <= ball[3] * math.sqrt(3) + 1e-9)
        middles = np.concatenate([(o + (u + v) / 2)[flat], o[~flat]])[:, :2]
        assert len(np.unique(np.floor(middles / CELL_M), axis=0)) == 1


def front_of_each_alone(scene: Primitives, view: View) -> NDArray[np.int64]:
    """The largest key of all primitives at each sample, none of which ever hides another."""
    buffers, groups = Buffers.of((32, 24), len(scene.shape)), group(scene)
    fronts = []
    for rank, q in enumerate(groups.members):
        clear(buffers)
        draw(scene, int(q), rank, view, buffers)
        fronts.append(buffers.front.copy())
    return np.max(fronts, axis=0)


@settings(max_examples=30)
@given(st.floats(-3.1, 3.1), st.floats(-20, 20), st.floats(-20, 20), st.booleans())
def test_nothing_that_is_in_front_is_left_out(yaw: float, x: float, y: float, is_crowded: bool) -> None:
    scene = CROWDED if is_crowded else SCATTERED
    view = view_of(Pose(x, y, 1.5, yaw, 0.0, 0.0, 0.0, 0.0, 0.0), 19.0, (32, 24))
    buffers = Buffers.of((32, 24), len(scene.shape))
    draw_groups(scene, group(scene), view, buffers)
    np.testing.assert_array_equal(buffers.front, front_of_each_alone(scene, view))


SCATTERED, CROWDED = scattered(7), crowded(8)


def test_what_lies_behind_a_wall_is_hidden_but_not_beside_it() -> None:
    view = View((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), 19.0, 32, 24)
    mesh = Mesh()
    mesh.quad((5.0, 0.0, -9.0), (0.0, -9.0, 0.0), (0.0, 0.0, 18.0), 3, (1, 1, 1))
    scene, buffers = mesh.primitives(), Buffers.of((32, 24), 1)
    clear(buffers)
    draw(scene, 0, 0, view, buffers)
    assert is_hidden((33.0, 63.0, 0.0, 47.0), 1 / 5.01, buffers)
    assert not is_hidden((33.0, 63.0, 0.0, 47.0), 1 / 5, buffers)
    assert not is_hidden((31.0, 63.0, 0.0, 47.0), 1 / 5.01, buffers)


def test_of_two_in_one_place_the_first_of_the_groups_is_seen() -> None:
    mesh = Mesh()
    for _ in range(2):
        mesh.quad((5.0, 9.0, -9.0), (0.0, -18.0, 0.0), (0.0, 0.0, 18.0), 3, (1, 1, 1))
    scene = mesh.primitives()
    view = View((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), 19.0, 32, 24)
    for order in ([0, 1], [1, 0]):
        buffers = Buffers.of((32, 24), 2)
        groups = group(scene)._replace(members=np.array(order, np.int32))
        draw_groups(scene, groups, view, buffers)
        assert (buffers.owner == order[0]).all()


@pytest.mark.parametrize("side", [-1, 1])
def test_a_group_is_left_out_where_its_sphere_touches_no_part_of_the_view(side: int) -> None:
    def kept(middle: NDArray[np.float64], radius: float) -> bool:
        ball = np.array([[*middle, radius]])
        return len(seen(Groups(ball, np.array([0, 1], np.int32), np.array([7], np.int32)), view)) == 1

    view = View((0.0, 0.0, 1.5), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), 19.0, 32, 24)
    edge = np.array([19.0, 16.0 * side, 0.0]) / math.hypot(19.0, 16.0)
    outwards = np.array([-edge[1], edge[0], 0.0]) * side
    ahead = np.array(view.forward)
    for away, inside in ((0.99, True), (1.01, False)):
        assert kept(view.position + 30 * edge + 2.0 * away * outwards, 2.0) == inside
        assert kept(view.position + (FAR_M + 5.0 * away) * ahead, 5.0) == inside
        assert kept(view.position - 5.0 * away * ahead, 5.0) == inside


def test_most_of_a_town_is_left_out() -> None:
    view = View((0.0, 0.0, 1.5), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), 19.0, 32, 24)
    groups = group(SCATTERED)
    chosen = primitives_of(groups, seen(groups, view))
    assert 0 < len(chosen) < 0.5 * len(SCATTERED.shape)
    far = SCATTERED.frame[chosen, 0]
    assert far.min() > -40
    assert far.max() < FAR_M + 40


@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(-7, 7))
def test_a_pose_on_the_map_is_turned_and_moved(x: float, y: float, yaw: float) -> None:
    pose = geo_pose(Pose(x, y, 3.0, yaw, 0.1, 0.2, 0.0, 0.0, 0.0))
    east, north = pose.easting - EAST, pose.northing - NORTH
    assert math.hypot(east, north) == pytest.approx(math.hypot(x, y), abs=1e-6)
    assert math.remainder(pose.yaw - yaw - TURN, 2 * math.pi) == pytest.approx(0, abs=1e-9)
    assert -math.pi <= pose.yaw <= math.pi
    ahead = geo_pose(Pose(x + math.cos(yaw), y + math.sin(yaw), 3.0, yaw, 0.1, 0.2, 0.0, 0.0, 0.0))
    step = math.atan2(ahead.northing - pose.northing, ahead.easting - pose.easting)
    assert math.remainder(step - pose.yaw, 2 * math.pi) == pytest.approx(0, abs=1e-6)
    latitude, longitude = utm.to_latlon(pose.easting, pose.northing, ZONE, northern=True)
    assert (latitude, longitude) == (pytest.approx(37.35, abs=0.05), pytest.approx(-122.03, abs=0.1))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"sensors": ("dvs",)}, "unknown sensor 'dvs'"),
        ({"fps": 0}, "'fps' cannot be 0"),
        ({"width": -1}, "'width'"),
        ({"most_gain": 0.1}, "'most_gain' cannot be 0.1"),
        ({"conditions": ()}, "at least one condition"),
        ({"paths": ()}, "at least one condition and one path"),
        ({"paths": (0, 1)}, "numbered from 1"),
        ({"fps": 125}, "must be a multiple"),
        ({"dt": "1/5"}, "longer than the time between images"),
        ({"route_length_m": 30.0}, "60 at least"),
    ],
)
def test_sets_that_cannot_be_are_refused(values: dict[str, object], words: str) -> None:
    with pytest.raises(SettingsError, match=words):
        CitySettings(**values)  # type: ignore[arg-type]


def test_a_set_names_and_numbers_every_drive_once() -> None:
    settings = CitySettings(conditions=tuple(CONDITIONS), paths=(1, 2, 9))
    pairs = settings.drives()
    assert len(pairs) == 21
    assert len({drive_name(*pair) for pair in pairs}) == 21
    assert len({drive_number(*pair) for pair in pairs}) == 21
    assert settings.window_us == 33_333
    assert CitySettings(dt="1/60").window_us == 16_667
    assert set(settings.sensors) == set(PRESETS)


def test_only_which_drives_there_are_does_not_decide_what_is_in_one() -> None:
    plain = CitySettings()
    assert CitySettings(conditions=("fog",), paths=(7,)).of_drive() == plain.of_drive()
    changed = {
        "sensors": ("ideal",), "fps": 60, "width": 80, "height": 60, "image_hz": 5, "dt": "1/40",
        "most_gain": 8.0, "route_length_m": 90.0, "seed": 3, "keep_events": True,
    }  # fmt: skip
    fields = {field.name for field in dataclasses.fields(CitySettings)} - {"conditions", "paths"}
    assert set(changed) == fields
    for name, value in changed.items():
        assert dataclasses.replace(plain, **{name: value}).of_drive() != plain.of_drive(), name  # type: ignore[arg-type]
