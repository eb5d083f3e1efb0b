"""The lane along a path, red lights on it, and the car that follows it."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_town import made_town

from evplace_lab.city import drive as driving
from evplace_lab.city.drive import Drive, Pose, camera_axes, drive_along
from evplace_lab.city.routes import (
    LANE_M,
    PATHS,
    STEP_M,
    STOP_M,
    Halt,
    _board,
    _lane_line,
    _resampled,
    _straight,
    lay_route,
    nodes_of,
    smoothed,
)
from evplace_lab.city.signals import CYCLE_S, LEVELS, RED_S, Signals
from evplace_lab.city.streets import Streets
from evplace_lab.city.terrain import Terrain, Wave
from evplace_lab.city.town import Town

FLAT = Terrain(*(Wave(0.0, 100.0, 0.0) for _ in range(4)))
STREETS = Streets(np.arange(7) * 100.0, np.arange(7) * 100.0)


@pytest.fixture(scope="module")
def town() -> Town:
    return made_town()


@given(st.integers(3, 40), st.integers(0, 20))
def test_drawn_paths_go_from_crossing_to_crossing_and_never_turn_back(path: int, seed: int) -> None:
    nodes = np.array(nodes_of(path, STREETS, seed))
    steps = np.diff(nodes, axis=0)
    assert len(nodes) == 22
    assert nodes.min() >= 0
    assert nodes.max() <= 6
    np.testing.assert_array_equal(np.abs(steps).sum(1), 1)
    assert not np.any(np.all(steps[1:] == -steps[:-1], axis=1))


@pytest.mark.parametrize("path", PATHS)
def test_the_benchmarks_paths_follow_streets(path: int) -> None:
    for (i, j), (k, m) in itertools.pairwise(PATHS[path]):
        assert (i == k) != (j == m)
        assert {i, j, k, m} <= set(range(7))


@given(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.0, 80.0), st.floats(0, 7))
def test_points_on_a_straight_are_even_and_leave_out_its_ends(
    x: float, y: float, length: float, angle: float
) -> None:
    a = np.array([x, y])
    b = a + length * np.array([math.cos(angle), math.sin(angle)])
    points = np.array([a, *_straight(a, b), b])
    steps = np.hypot(*np.diff(points, axis=0).T)
    np.testing.assert_allclose(steps, length / len(steps), atol=1e-9)
    assert len(steps) in (max(int(length), 1), max(int(length - 1e-9), 1))


@given(st.sampled_from([1, 2, 3, 4, 5, 6]), st.floats(0.5, 3.0))
def test_the_lane_keeps_its_distance_to_the_middle_of_the_street(path: int, lane: float) -> None:
    """Away from crossings; and always on the right."""
    corners = _board(nodes_of(path, STREETS, 0), STREETS)
    line = _lane_line(corners, lane)
    ahead = np.gradient(line, axis=0)
    off = line - np.round(line / 100) * 100
    along_x = (np.abs(ahead[:, 0]) > 10 * np.abs(ahead[:, 1])) & (np.abs(off[:, 0]) > 20)
    along_y = (np.abs(ahead[:, 1]) > 10 * np.abs(ahead[:, 0])) & (np.abs(off[:, 1]) > 20)
    assert along_x.sum() > 30
    np.testing.assert_allclose(off[along_x, 1], -lane * np.sign(ahead[along_x, 0]), atol=1e-9)
    np.testing.assert_allclose(off[along_y, 0], lane * np.sign(ahead[along_y, 1]), atol=1e-9)
    assert np.hypot(*np.diff(line, axis=0).T).max() < 2.1


def test_a_straight_line_is_resampled_to_even_steps() -> None:
    points = np.column_stack([np.linspace(0, 40, 57) ** 1.0, np.zeros(57), np.linspace(0, 4, 57)])
    even = _resampled(points)
    np.testing.assert_allclose(np.diff(even[:, 0]), STEP_M, atol=1e-9)
    np.testing.assert_allclose(even[:, 2], even[:, 0] / 10, atol=1e-9)


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(0.3, 5.0))
def test_smoothing_keeps_lines_and_is_a_mean(slope: float, start: float, sigma_m: float) -> None:
    line = start + slope * np.arange(300)
    np.testing.assert_allclose(smoothed(line, sigma_m), line, atol=1e-6)


def test_smoothing_spreads_an_impulse_as_a_gaussian() -> None:
    impulse = np.zeros(401)
    impulse[200] = 1.0
    spread = smoothed(impulse, 2.0)
    at_m = (np.arange(401) - 200) * STEP_M
    assert spread.sum() == pytest.approx(1)
    assert math.sqrt((spread * at_m**2).sum()) == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize("path", PATHS)
def test_halts_lie_before_their_crossings_in_the_order_of_the_way(path: int) -> None:
    route = lay_route(path, STREETS, FLAT, 0, None)
    ways = [halt.at_m for halt in route.halts]
    assert ways == sorted(ways)
    assert len(ways) > 15
    for halt in route.halts:
        here = route.position[round(halt.at_m / STEP_M), :2]
        middle = np.array([STREETS.x[halt.crossing[0]], STREETS.y[halt.crossing[1]]])
        off = np.abs(here - middle)
        assert off[halt.axis] == pytest.approx(STOP_M, abs=0.2)
        assert off[1 - halt.axis] == pytest.approx(LANE_M.get(path, 1.9), abs=0.2)


def test_a_cut_route_is_the_start_of_the_whole(town: Town) -> None:
    whole, part = (lay_route(2, town.streets, town.terrain, 0, length) for length in (None, 250.0))
    np.testing.assert_array_equal(part.position, whole.position[: len(part.position)])
    assert part.halts == [halt for halt in whole.halts if halt.at_m < 250.0]


def test_lights_of_a_crossing_take_turns(town: Town) -> None:
    signals = Signals(town, np.random.default_rng(1))
    crossing = (int(town.signals[0, 0]), int(town.signals[0, 1]))
    seconds = np.arange(0, 3 * CYCLE_S, 0.25)
    red = np.array([[signals.red(crossing, axis, s) for s in seconds] for axis in (0, 1)])
    assert not np.any(red[0] & red[1]), "never both: half a cycle apart, each red for less than that"
    np.testing.assert_allclose(red.mean(1), RED_S / CYCLE_S, atol=0.01)
    np.testing.assert_array_equal(red[0, 48:], red[1, :-48])  # 48 quarters of a second: half a cycle


@given(seconds=st.floats(0, 200), axis=st.sampled_from([0, 1]))
def test_a_wait_ends_at_green(town: Town, seconds: float, axis: int) -> None:
    signals = Signals(town, np.random.default_rng(2))
    crossing = (int(town.signals[0, 0]), int(town.signals[0, 1]))
    wait = signals.until_green(crossing, axis, seconds)
    assert 0 <= wait <= RED_S
    assert (wait > 0) == signals.red(crossing, axis, seconds)
    assert not signals.red(crossing, axis, seconds + wait + 1e-6)


def test_without_lights_nobody_waits(town: Town) -> None:
    signals = Signals(town, np.random.default_rng(0))
    known = {(int(i), int(j)) for i, j in town.signals[:, :2]}
    bare = next(c for c in itertools.product(range(-1, 9), repeat=2) if c not in known)
    assert not any(signals.red(bare, 0, s) for s in np.arange(0, CYCLE_S, 0.5))
    assert signals.until_green(bare, 0, 3.0) == 0.0


def test_lamps_show_what_the_signals_say(town: Town) -> None:
    signals, look = Signals(town, np.random.default_rng(4)), town.scene.look.copy()
    for seconds in (0.0, 5.0, 11.0):
        signals.show(look, seconds)
        for i, j, axis, red, green in town.signals.astype(int):
            stop = int(signals.red((i, j), axis, seconds))
            assert look[red, 3:5].tolist() == [LEVELS[stop]] * 2
            assert look[green, 3:5].tolist() == [LEVELS[1 - stop]] * 2


class Lights:
    """Lights of which only one is red, until a time."""

    def __init__(self, halt: Halt, until: float) -> None:
        self._halt, self._until = halt, until

    def red(self, crossing: tuple[int, int], axis: int, seconds: float) -> bool:
        return (crossing, axis) == (self._halt.crossing, self._halt.axis) and seconds < self._until

    def until_green(self, crossing: tuple[int, int], axis: int, seconds: float) -> float:
        return max(self._until - seconds, 0.0) if self.red(crossing, axis, seconds) else 0.0


def test_a_car_keeps_its_limits_and_changes_its_speed_no_faster_than_it_may() -> None:
    limit = np.full(3001, 10.0)
    limit[1000:1100] = 4.0
    times = driving._passing_times(limit.copy(), [])
    speed = STEP_M / np.diff(times)
    way = (np.arange(3000) + 0.5) * STEP_M
    change = 2 * driving.SLOW_DOWN * np.maximum(100.0 - way, 0)
    change += 2 * driving.SPEED_UP * np.maximum(way - 109.9, 0)
    np.testing.assert_allclose(speed, np.minimum(np.sqrt(16 + change), 10.0), rtol=0.01)


def test_it_brakes_for_what_comes_and_stands_as_long_as_it_must() -> None:
    limit = np.full(3001, 10.0)
    free = driving._passing_times(limit.copy(), [])
    held = driving._passing_times(limit.copy(), [(1500, 4.0)])
    speed = STEP_M / np.diff(held)
    steps = np.arange(20, 150)  # away from the stop, where the car is not at its least speed
    for at, change in ((1499 - steps, driving.SLOW_DOWN), (1500 + steps, driving.SPEED_UP)):
        np.testing.assert_allclose(speed[at], np.sqrt(2 * change * (steps + 0.5) * STEP_M), rtol=1e-3)
    assert held[-1] - free[-1] > 4.0
    waited = driving._passing_times(limit.copy(), [(1500, 9.0)])
    np.testing.assert_allclose(waited[1500:] - held[1500:], 5.0)
    np.testing.assert_allclose(waited[:1500], held[:1500])


def test_a_red_light_holds_the_car_until_it_is_green() -> None:
    halt = Halt(120.0, (2, 3), 1)
    limit = np.full(3001, 8.0)
    times, ways = driving._timed(limit, [Halt(60.0, (1, 1), 0), halt], Lights(halt, 40.0))  # type: ignore[arg-type]
    still = np.flatnonzero(np.diff(ways) == 0)
    assert len(still) == 1
    assert ways[still[0]] == pytest.approx(120.0)
    assert times[still[0] + 1] == pytest.approx(40.0)
    assert times[still[0]] < 40.0
    assert np.all(np.diff(times) >= 0)
    assert np.all(np.diff(ways) >= 0)
    free, _ = driving._timed(limit, [halt], Lights(halt, 1.0))  # type: ignore[arg-type]
    assert len(free) == len(times) - 1


def test_shaking_has_its_strength_and_dies_down_at_a_stop(town: Town) -> None:
    shaking = driving._shaking(4000, np.random.default_rng(0))
    np.testing.assert_allclose(shaking.std(1), [driving.PITCH, driving.ROLL, driving.BOB_M])
    route = lay_route(1, town.streets, town.terrain, 0, 200.0)
    drive = drive_along(route, Signals(town, np.random.default_rng(0)), np.random.default_rng(0))
    still = dataclasses.replace(drive, ways=np.zeros_like(drive.ways))
    for t_us in range(0, drive.duration_us, 500_000):
        moving, standing = drive.pose(t_us), still.pose(t_us)
        assert standing.speed == 0
        if moving.speed > 4:
            assert standing.roll == pytest.approx(0.1 * moving.roll)
            assert standing.pitch - standing.slope == pytest.approx(0.1 * (moving.pitch - moving.slope))


@given(st.floats(1.0, 9.0))
def test_the_spline_passes_lines_through_and_smooths_corners(u: float) -> None:
    rows = np.array([np.arange(12.0), 3 - 2 * np.arange(12.0), np.ones(12)])
    np.testing.assert_allclose(driving._spline(rows, u), [u, 3 - 2 * u, 1], atol=1e-9)


def test_an_impulse_gives_the_b_splines_values() -> None:
    rows = np.zeros((1, 11))
    rows[0, 5] = 1.0
    values = [float(driving._spline(rows, u)[0]) for u in (3.0, 4.0, 4.5, 5.0, 5.5, 6.0, 7.0)]
    assert values == pytest.approx([0, 1 / 6, 23 / 48, 4 / 6, 23 / 48, 1 / 6, 0])


angles = st.floats(-1.4, 1.4)


@given(st.floats(-math.pi, math.pi), angles, angles)
def test_the_cameras_axes_are_a_right_handed_frame(yaw: float, pitch: float, roll: float) -> None:
    axes = camera_axes(Pose(0, 0, 0, yaw, pitch, roll, 0, 0, 0))
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    assert math.atan2(axes[2, 1], axes[2, 0]) == pytest.approx(yaw, abs=1e-9)
    assert math.asin(axes[2, 2]) == pytest.approx(pitch, abs=1e-9)
    level = camera_axes(Pose(0, 0, 0, yaw, pitch, 0, 0, 0, 0))
    assert level[0, 2] == 0
    np.testing.assert_allclose(level[1] @ axes[1], math.cos(roll), atol=1e-9)


def test_a_pose_lies_on_the_line_at_its_way(town: Town) -> None:
    route = lay_route(1, town.streets, town.terrain, 0, 150.0)
    drive: Drive = drive_along(route, Signals(town, np.random.default_rng(3)), np.random.default_rng(3))
    for t_us in range(0, drive.duration_us, 700_000):
        pose = drive.pose(t_us)
        near = drive.line[round(pose.way / STEP_M)]
        assert math.hypot(pose.x - near[0], pose.y - near[1]) <= STEP_M
        assert abs(pose.z - near[2] - driving.CAMERA_M) < 0.1
        assert pose.way == pytest.approx(drive.way_at(t_us))
    off = np.hypot(*(drive.line[:, :2] - route.position[:, :2]).T)
    assert off.std() < driving.WOBBLE_M < off.max()
    assert drive.duration_us == int(drive.times[-1] * 1e6)
