"""Who is about in a drive: where each car and walker is at any time."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from made_town import made_town

from evplace_lab.city.buildings import Lot
from evplace_lab.city.drive import Drive, drive_along
from evplace_lab.city.figures import STRIDES, car, person
from evplace_lab.city.materials import LAMP
from evplace_lab.city.mesh import SPHERE, Primitives
from evplace_lab.city.routes import STEP_M, Halt, lay_route
from evplace_lab.city.signals import CYCLE_S, RED_S, Signals
from evplace_lab.city.streets import KERB_M
from evplace_lab.city.town import DEPTH_M, Town, _lots, _shrunk
from evplace_lab.city.traffic import (
    CROSSING_SPEED,
    MIDDLE_M,
    ONCOMING_M,
    Traffic,
    _dark,
    _leaders,
    parked_cars,
    traffic_for,
)


@pytest.fixture(scope="module")
def town() -> Town:
    return made_town()


@pytest.fixture(scope="module")
def traffic(town: Town) -> Traffic:
    route = lay_route(1, town.streets, town.terrain, 0, 600.0)
    signals = Signals(town, np.random.default_rng(0))
    drive = drive_along(route, signals, np.random.default_rng(0))
    return traffic_for(town, route, drive, signals, np.random.default_rng(1))


def middle(parts: Primitives) -> np.ndarray:
    """Level middle of a figure."""
    corners = parts.frame[:, :2] + (parts.frame[:, 3:5] + parts.frame[:, 6:8]) / 2
    flat = parts.shape != SPHERE
    return np.asarray((corners[flat].min(0) + corners[flat].max(0)) / 2)


def test_a_place_beside_the_lane_is_as_far_off_as_asked(traffic: Traffic) -> None:
    position = traffic.route.position
    for way in (0.0, 33.37, 250.0, traffic.route.length_m - 1):
        on, yaw = traffic._beside(way, 0.0)
        k = int(way / STEP_M)
        assert np.linalg.norm(on - position[k]) <= np.linalg.norm(position[k + 1] - position[k]) + 1e-9
        for left in (-2.0, 3.8):
            off = traffic._beside(way, left)[0] - on
            assert np.hypot(*off[:2]) == pytest.approx(abs(left))
            assert off @ (-math.sin(yaw), math.cos(yaw), 0) == pytest.approx(left)


def test_oncoming_cars_come_towards_us_at_their_speed(traffic: Traffic) -> None:
    only = dataclasses.replace(traffic, oncoming=np.array([[200.0, 9.0, 3]]))
    pose = traffic.drive.pose(0)._replace(way=80.0)
    seen = [list(only._oncoming(pose, seconds)) for seconds in (2.0, 3.0)]
    places = [middle(parts[0]) for parts in seen]
    wanted = [only._beside(200.0 - 9.0 * seconds, ONCOMING_M)[0][:2] for seconds in (2.0, 3.0)]
    np.testing.assert_allclose(places, wanted, atol=0.6)
    _, yaw = only._beside(200.0 - 9.0 * 2.0, ONCOMING_M)
    assert seen[0][0].frame[0, 3:5] @ (math.cos(yaw), math.sin(yaw)) < -4, "its side runs from front to rear"
    assert list(only._oncoming(pose, 20.0)) == [], "it has passed us"
    assert list(only._oncoming(pose._replace(way=40.0), 0.0)) == [], "too far ahead"


def test_a_leading_car_keeps_its_gap_and_draws_away(traffic: Traffic) -> None:
    only = dataclasses.replace(traffic, leading=np.array([[100.0, 200.0, 20.0, 5]]))
    pose = traffic.drive.pose(0)
    gaps = {}
    for way in (99.0, 101.0, 150.0, 195.0, 201.0):
        cars = list(only._leading(pose._replace(way=way)))
        gaps[way] = [np.linalg.norm(middle(parts) - only._beside(way, 0.0)[0][:2]) for parts in cars]
    assert gaps[99.0] == gaps[201.0] == []
    assert gaps[150.0][0] == pytest.approx(20.0, abs=1.5)
    assert gaps[101.0][0] > gaps[150.0][0]
    assert gaps[195.0][0] > gaps[150.0][0]


def test_leaders_are_gone_before_the_car_stands_still(traffic: Traffic) -> None:
    """Drawn for a made drive that stands at 200 m and at 450 m."""
    ways = np.array([0.0, 200.0, 200.0, 450.0, 450.0, 900.0])
    drive = Drive(traffic.drive.line, np.arange(6.0), ways, traffic.drive.shaking)
    rows = np.concatenate([_leaders(drive, 900.0, np.random.default_rng(seed)) for seed in range(60)])
    assert len(rows) > 40
    assert np.all(rows[:, 1] - rows[:, 0] > 40)
    for start, end, gap, _ in rows:
        assert not np.any((ways[[1, 3]] > start - 30) & (ways[[1, 3]] < end + 30 - 1e-9))
        assert 14 <= gap <= 35


def test_walkers_walk_on_the_pavement_beside_the_road(traffic: Traffic, town: Town) -> None:
    pose = traffic.drive.pose(0)._replace(way=300.0)
    alone = dataclasses.replace(traffic, walkers=np.array([[310.0, MIDDLE_M + 7.0, 1.5, 4]]))
    passing_s = 310.0 / 9.0
    places = []
    for seconds in (passing_s, passing_s + 2.0):
        (figure,) = alone._walkers(pose, seconds)
        foot, _ = alone._beside(310.0 + 1.5 * (seconds - passing_s), MIDDLE_M + 7.0)
        np.testing.assert_allclose(middle(figure), foot[:2], atol=0.4)
        lowest = figure.frame[:, 2] + np.minimum(figure.frame[:, 5], 0) + np.minimum(figure.frame[:, 8], 0)
        assert lowest.min() == pytest.approx(foot[2] + KERB_M, abs=0.1)
        places.append(middle(figure))
    assert np.linalg.norm(places[1] - places[0]) == pytest.approx(3.0, abs=0.7)
    assert list(alone._walkers(pose._replace(way=400.0), passing_s)) == []
    off = traffic.walkers[:, 1] - MIDDLE_M
    assert np.all((np.abs(off) >= 5.8) & (np.abs(off) <= 8.0))


def test_cars_cross_only_while_our_light_is_red(traffic: Traffic, town: Town) -> None:
    crossing = (int(town.signals[0, 0]), int(town.signals[0, 1]))
    for axis in (0, 1):
        halt = Halt(100.0, crossing, axis)
        at_light = dataclasses.replace(traffic, route=dataclasses.replace(traffic.route, halts=[halt]))
        pose = traffic.drive.pose(0)._replace(way=90.0)
        seconds = np.arange(0, 20 * CYCLE_S, 0.5)
        cars = [len(list(at_light._crossing(pose, float(s)))) for s in seconds]
        red = np.array([traffic.signals.red(crossing, axis, float(s)) for s in seconds])
        assert not np.any(np.array(cars)[~red])
        assert np.any(np.array(cars)[red])
        assert max(cars) <= 4
        busy = float(seconds[np.argmax(cars)])
        for way in (20.0, 120.0):
            assert list(at_light._crossing(pose._replace(way=way), busy)) == [], "too far away"


def test_crossing_cars_keep_to_the_right_of_their_street(traffic: Traffic, town: Town) -> None:
    crossing = (3, 3)
    for axis in (0, 1):
        halt, found = Halt(100.0, crossing, axis), 0
        for turn in range(20):
            one, later = (list(traffic._cross(halt, seconds, turn)) for seconds in (4.5, 4.6))
            for before, after in zip(one, later, strict=False):
                moved = middle(after) - middle(before)
                if len(one) != len(later) or np.hypot(*moved) > 2 * 0.1 * CROSSING_SPEED:
                    continue
                found += 1
                assert np.hypot(*moved) == pytest.approx(0.1 * CROSSING_SPEED, rel=0.15)
                across = town.terrain.world(town.streets.x[3], town.streets.y[3])[:2] - middle(before)
                to_the_left = moved[0] * across[1] - moved[1] * across[0]
                assert to_the_left / np.hypot(*moved) == pytest.approx(MIDDLE_M, abs=1.5)
        assert found > 10
    assert RED_S < CYCLE_S / 2


def test_parked_cars_stand_at_kerbs_with_their_lights_off(town: Town) -> None:
    parts = parked_cars(town, np.random.default_rng(3))
    lamps = parts.material == LAMP
    assert lamps.sum() > 100
    assert parts.look[lamps, 4].max() <= 0.02
    again, other = (parked_cars(town, np.random.default_rng(seed)) for seed in (3, 4))
    np.testing.assert_array_equal(parts.frame, again.frame)
    assert len(other.shape) != len(parts.shape)
    one = car(0)
    np.testing.assert_array_equal(_dark(one).look[:, :4], one.look[:, :4])
    assert one.look[one.material == LAMP, 4].max() > 0.02, "the others keep theirs"


def test_everything_that_moves_is_near(traffic: Traffic) -> None:
    for t_us in range(0, traffic.drive.duration_us, 3_000_000):
        pose = traffic.drive.pose(t_us)
        for parts in traffic.around(pose, t_us):
            assert np.hypot(*(middle(parts) - (pose.x, pose.y))) < 140


@pytest.mark.parametrize("seed", range(12))
def test_every_car_is_as_wide_as_a_lane_allows_and_symmetric(seed: int) -> None:
    parts = car(seed)
    o, u, v = (parts.frame[:, k : k + 3] for k in (0, 3, 6))
    corners = np.concatenate([o, o + u, o + v, o + u + v])
    assert np.abs(corners[:, 0]).max() < 2.6
    assert 0.85 < np.abs(corners[:, 1]).max() < 0.95
    assert 1.4 <= corners[:, 2].max() <= 2.2
    assert corners[:, 1].max() == pytest.approx(-corners[:, 1].min(), abs=0.02)


def test_people_differ_and_their_legs_swing() -> None:
    standing = [person(4, stride).frame for stride in range(STRIDES)]
    assert len({frame.tobytes() for frame in standing}) > STRIDES // 2
    tops = [person(who, 0).frame[person(who, 0).shape == SPHERE, 2].max() for who in range(20)]
    assert 1.3 < min(tops) < max(tops) < 2.1
    np.testing.assert_array_equal(person(4, 0).frame, person(4, 0).frame)


@pytest.mark.parametrize("seed", range(5))
def test_lots_line_the_rim_of_a_block_without_overlap(seed: int) -> None:
    block = _shrunk((0.0, 90.0, 0.0, 80.0), 3.2)
    lots: list[Lot] = _lots(block, np.random.default_rng(seed))
    for lot in lots:
        assert block[0] <= lot.x0 < lot.x1 <= block[1]
        assert block[2] <= lot.y0 < lot.y1 <= block[3]
        assert min(lot.x1 - lot.x0, lot.y1 - lot.y0) <= DEPTH_M
    boxes = np.array([(lot.x0, lot.x1, lot.y0, lot.y1) for lot in lots])
    for k, (x0, x1, y0, y1) in enumerate(boxes):
        others = np.delete(boxes, k, axis=0)
        meets = (others[:, 0] < x1) & (others[:, 1] > x0) & (others[:, 2] < y1) & (others[:, 3] > y0)
        assert not meets.any()
