"""What moves, and what is parked: other in every drive."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.drive import Drive, Pose
from evplace_lab.city.figures import STRIDES, car, person
from evplace_lab.city.mesh import Mesh, Primitives, join, placed, up
from evplace_lab.city.routes import STEP_M, Halt, Route
from evplace_lab.city.signals import CYCLE_S, RED_S, Signals
from evplace_lab.city.streets import KERB_M
from evplace_lab.city.town import Town

ONCOMING_M, MIDDLE_M = 3.8, 1.9
"""From the car's lane to the lane of those who come, and to the middle of the street, leftwards."""
CARS, PEOPLE = 24, 60
"""How many different cars and people there are."""
CROSSING_SPEED = 8.0


@dataclass(frozen=True)
class Traffic:
    """Everything that moves in one drive, as functions of time."""

    town: Town
    route: Route
    drive: Drive
    signals: Signals
    oncoming: NDArray[np.float64]
    """(A, 3) way at time 0, speed, which car."""
    leading: NDArray[np.float64]
    """(B, 4) ways between which a car drives ahead, the gap to it, which car."""
    walkers: NDArray[np.float64]
    """(C, 4) way at the time when the car passes, metres left of the lane, speed, who."""

    def around(self, pose: Pose, t_us: int) -> Iterator[Primitives]:
        """All that is near enough to be seen, in the world."""
        seconds = t_us * 1e-6
        yield from self._oncoming(pose, seconds)
        yield from self._leading(pose)
        yield from self._walkers(pose, seconds)
        yield from self._crossing(pose, seconds)

    def _oncoming(self, pose: Pose, seconds: float) -> Iterator[Primitives]:
        ways = self.oncoming[:, 0] - self.oncoming[:, 1] * seconds
        seen = (ways > pose.way - 5) & (ways < pose.way + 130) & (ways > 0) & (ways < self.route.length_m - 1)
        for k in np.flatnonzero(seen):
            position, yaw = self._beside(ways[k], ONCOMING_M)
            yield placed(_car(int(self.oncoming[k, 2])), position, yaw + math.pi)

    def _leading(self, pose: Pose) -> Iterator[Primitives]:
        for start, end, gap, who in self.leading:
            if start < pose.way < end:
                done = (pose.way - start) / (end - start)
                ahead = pose.way + gap + 60 * max(0.0, 0.15 - done) + 100 * max(0.0, done - 0.8)
                if ahead < self.route.length_m - 1:
                    yield placed(_car(int(who)), *self._beside(ahead, 0.0))

    def _walkers(self, pose: Pose, seconds: float) -> Iterator[Primitives]:
        speed = self.walkers[:, 2]
        ways = self.walkers[:, 0] + speed * (seconds - self.walkers[:, 0] / 9.0)
        seen = (ways > pose.way - 3) & (ways < pose.way + 70) & (ways > 0) & (ways < self.route.length_m - 1)
        for k in np.flatnonzero(seen):
            position, yaw = self._beside(ways[k], self.walkers[k, 1])
            stride = int(seconds * 1.9 * STRIDES + k) % STRIDES
            figure = _person(int(self.walkers[k, 3]), stride)
            yield placed(figure, position + up(KERB_M), yaw if speed[k] > 0 else yaw + math.pi)

    def _crossing(self, pose: Pose, seconds: float) -> Iterator[Primitives]:
        """Cars on the street across, while the car's own light is red."""
        for halt in self.route.halts:
            if -15 < halt.at_m - pose.way < 70 and self.signals.red(halt.crossing, halt.axis, seconds):
                green = RED_S - self.signals.until_green(halt.crossing, halt.axis, seconds)
                turn = int(seconds // CYCLE_S)
                yield from self._cross(halt, green, turn)

    def _cross(self, halt: Halt, seconds: float, turn: int) -> Iterator[Primitives]:
        """Up to two cars each way, `seconds` after their light turned green."""
        rng = np.random.default_rng([self.town.seed, *halt.crossing, turn])
        middle = np.array([self.town.streets.x[halt.crossing[0]], self.town.streets.y[halt.crossing[1]]])
        for way in (1.0, -1.0):
            ahead = np.array([0.0, way]) if halt.axis == 0 else np.array([way, 0.0])
            right = np.array([ahead[1], -ahead[0]])
            for late in (0.5, 3.5):
                draw, who = rng.random(), int(rng.integers(CARS))
                along = CROSSING_SPEED * (seconds - late) - 30.0
                if draw < 0.7 and -30.0 < along < 45.0:
                    x, y = middle + along * ahead + MIDDLE_M * right
                    yaw = self.town.terrain.heading(x, y, math.atan2(ahead[1], ahead[0]))
                    yield placed(_car(who), self.town.terrain.world(x, y), yaw)

    def _beside(self, way: float, left: float) -> tuple[NDArray[np.float64], float]:
        """World position on the ground and direction, `left` of the car's lane."""
        k = min(max(int(way / STEP_M), 0), len(self.route.position) - 2)
        here, there = self.route.position[k], self.route.position[k + 1]
        share = way / STEP_M - k
        yaw = math.atan2(there[1] - here[1], there[0] - here[0])
        side = np.array([-math.sin(yaw), math.cos(yaw), 0.0]) * left
        return here + (there - here) * share + side, yaw


def traffic_for(
    town: Town, route: Route, drive: Drive, signals: Signals, rng: np.random.Generator
) -> Traffic:
    """Draw who is about in one drive."""
    length = route.length_m
    oncoming = [
        (rng.uniform(0, 2.0 * length), rng.uniform(7, 11), rng.integers(CARS))
        for _ in range(int(length / 70))
    ]
    walkers = [
        (
            rng.uniform(0, length),
            MIDDLE_M + rng.choice([-1, 1]) * rng.uniform(5.8, 8.0),
            rng.choice([-1, 1]) * rng.uniform(0.9, 1.6),
            rng.integers(PEOPLE),
        )
        for _ in range(int(length / 9) + 1)
    ]
    return Traffic(
        town,
        route,
        drive,
        signals,
        np.array(oncoming, float).reshape(-1, 3),
        _leaders(drive, length, rng),
        np.array(walkers, float),
    )


def _leaders(drive: Drive, length: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Cars ahead for a while; each is gone before the car next stands still."""
    halts = drive.ways[1:][np.diff(drive.ways) == 0]
    rows = []
    for _ in range(int(length / 350) + 1):
        start, stretch = rng.uniform(0, length), rng.uniform(80, 250)
        gap, who = rng.uniform(14, 35), rng.integers(CARS)
        coming = halts[halts > start - 30]
        end = min(start + stretch, coming[0] - 30 if len(coming) else math.inf)
        if end - start > 40:
            rows.append((start, end, gap, who))
    return np.array(rows, float).reshape(-1, 4)


def parked_cars(town: Town, rng: np.random.Generator) -> Primitives:
    """Cars along the kerbs of every street, here denser, there sparser."""
    parts = [Mesh().primitives()]
    for along_y, axis, other in (
        (True, town.streets.x, town.streets.y),
        (False, town.streets.y, town.streets.x),
    ):
        for at in axis:
            for start, end in zip(other + 14, other[1:] - 14, strict=False):
                for side in (-1, 1):
                    parts += _parked_row(town, float(at), along_y, side, (float(start), float(end)), rng)
    return join(parts)


def _parked_row(
    town: Town, at: float, along_y: bool, side: int, stretch: tuple[float, float], rng: np.random.Generator
) -> list[Primitives]:
    parts = []
    density, along = rng.uniform(0.05, 0.6), stretch[0]
    while along < stretch[1]:
        if rng.random() < density:
            x, y = (at + side * 4.2, along) if along_y else (along, at + side * 4.2)
            forward = (side > 0) == along_y
            angle = (math.pi / 2 if along_y else 0.0) + (0.0 if forward else math.pi)
            yaw = town.terrain.heading(x, y, angle)
            parts.append(placed(_dark(_car(int(rng.integers(CARS)))), town.terrain.world(x, y), yaw))
        along += rng.uniform(5.6, 6.8)
    return parts


def _dark(parts: Primitives) -> Primitives:
    """The same car with its lights off at night."""
    look = parts.look.copy()
    look[:, 4] = np.minimum(look[:, 4], 0.02)
    return parts._replace(look=look)


@cache
def _car(number: int) -> Primitives:
    return car(number)


@cache
def _person(number: int, stride: int) -> Primitives:
    return person(number, stride)
