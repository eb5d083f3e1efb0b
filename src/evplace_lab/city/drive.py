"""One drive: where the car is at any time, with its speed, its stops and its shaking."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.routes import STEP_M, Halt, Route, smoothed
from evplace_lab.city.signals import Signals

TOP_SPEED = 10.0
"""Metres a second."""
SIDEWAYS = 2.2
"""Largest acceleration in a bend, m/s^2."""
SPEED_UP, SLOW_DOWN = 1.5, 2.0
"""m/s^2."""
CAMERA_M = 1.5
"""Height of the camera."""
WOBBLE_M = 0.25
"""Standard deviation of the car's way beside the lane."""
PITCH, ROLL, BOB_M = math.radians(0.15), math.radians(0.12), 0.008
"""Standard deviations of the car's shaking; without it level edges would give almost no events."""
SHAKES_HZ = 20.0


class Pose(NamedTuple):
    """Where the camera is and looks; world metres and radians."""

    x: float
    y: float
    z: float
    yaw: float
    """Counter-clockwise from +x."""
    pitch: float
    """Upwards."""
    roll: float
    speed: float
    """Metres a second."""
    slope: float
    """Pitch of the road itself."""
    way: float
    """Metres along the route."""


@dataclass(frozen=True)
class Drive:
    """The state of the car as functions of time and of the way."""

    line: NDArray[np.float64]
    """(N, 5) x, y, z, yaw and slope every STEP_M of the way."""
    times: NDArray[np.float64]
    ways: NDArray[np.float64]
    """(K,) seconds and metres: the way as a function of time; standing still is two times with one way."""
    shaking: NDArray[np.float64]
    """(3, M) pitch, roll and bob, SHAKES_HZ values a second."""

    @property
    def duration_us(self) -> int:
        """From the start to the end of the route."""
        return int(self.times[-1] * 1e6)

    def way_at(self, t_us: int) -> float:
        """Metres along the route at a time."""
        return float(np.interp(t_us * 1e-6, self.times, self.ways))

    def pose(self, t_us: int) -> Pose:
        """The camera at a time, microseconds from the start."""
        seconds = t_us * 1e-6
        way = self.way_at(t_us)
        speed = max(float(np.interp(seconds + 0.05, self.times, self.ways)) - way, 0.0) / 0.05
        at = min(way / STEP_M, len(self.line) - 1.001)
        k = int(at)
        x, y, z, yaw, slope = self.line[k] + (self.line[k + 1] - self.line[k]) * (at - k)
        pitch, roll, bob = _spline(self.shaking, seconds * SHAKES_HZ) * min(1.0, 0.1 + speed / 4.0)
        return Pose(x, y, z + CAMERA_M + bob, yaw, slope + pitch, roll, speed, slope, way)


def drive_along(route: Route, signals: Signals, rng: np.random.Generator) -> Drive:
    """A drive along a route that stops at red lights; `rng` draws its wobble and its speed."""
    line = _wobbled(route.position, rng)
    limit = _speed_limit(line, rng)
    times, ways = _timed(limit, route.halts, signals)
    count = int(times[-1] * SHAKES_HZ) + 50
    return Drive(line, times, ways, _shaking(count, rng))


def _wobbled(position: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """(N, 5) the lane with the driver's own wobble, its direction and its slope."""
    wobble = smoothed(rng.normal(size=len(position)), 12.0)
    wobble *= WOBBLE_M / wobble.std()
    yaw = _direction(position)
    x = position[:, 0] - np.sin(yaw) * wobble
    y = position[:, 1] + np.cos(yaw) * wobble
    z = smoothed(position[:, 2], 1.3)
    yaw = smoothed(_direction(np.stack([x, y], 1)), 0.8)
    return np.stack([x, y, z, yaw, np.arctan(np.gradient(z, STEP_M))], 1)


def _direction(points: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.unwrap(np.arctan2(np.gradient(points[:, 1]), np.gradient(points[:, 0])))


def _speed_limit(line: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Metres a second at each step: slower in bends, and as the driver likes."""
    mood = smoothed(rng.normal(size=len(line)), 25.0)
    top = TOP_SPEED * np.clip(0.93 + 0.08 * mood / mood.std(), 0.7, 1.05)
    bend = np.abs(np.gradient(line[:, 3], STEP_M))
    return np.asarray(np.maximum(np.minimum(top, np.sqrt(SIDEWAYS / np.maximum(bend, 1e-4))), 3.0))


def _timed(
    limit: NDArray[np.float64], halts: list[Halt], signals: Signals
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Time and way: at each crossing in turn, wait if its light is red when the car arrives."""
    stops: list[tuple[int, float]] = []
    times = _passing_times(limit, stops)
    for halt in halts:
        k = min(round(halt.at_m / STEP_M), len(limit) - 1)
        if signals.red(halt.crossing, halt.axis, times[k]):
            times = _passing_times(limit, [*stops, (k, 0.0)])
            wait = signals.until_green(halt.crossing, halt.axis, times[k])
            stops.append((k, wait))
            times = _passing_times(limit, stops)
    ways = (np.arange(len(limit)) * STEP_M).astype(np.float64)
    for k, wait in reversed(stops):
        times = np.insert(times, k, times[k] - wait)
        ways = np.insert(ways, k, ways[k])
    return times, ways


def _passing_times(limit: NDArray[np.float64], stops: list[tuple[int, float]]) -> NDArray[np.float64]:
    """When the car leaves each step, if it stands still at `stops` (step, seconds)."""
    squared = limit**2
    for k, _ in stops:
        squared[k] = 0.0
    way = np.arange(len(limit)) * STEP_M
    speeding = 2 * SPEED_UP * way
    squared = np.minimum.accumulate(squared - speeding) + speeding
    braking = 2 * SLOW_DOWN * way
    squared = np.minimum.accumulate((squared + braking)[::-1])[::-1] - braking
    speed = np.sqrt(np.maximum(squared, 0.09))
    times = np.concatenate([[0.0], np.cumsum(2 * STEP_M / (speed[1:] + speed[:-1]))])
    for k, wait in stops:
        times[k:] += wait
    return times


def _shaking(count: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """(3, count) smooth noise of the standard deviations PITCH, ROLL and BOB_M."""
    kernel = np.hanning(9)
    rows = []
    for amplitude in (PITCH, ROLL, BOB_M):
        row = np.convolve(rng.normal(size=count), kernel, "same")
        rows.append(row * amplitude / row.std())
    return np.array(rows)


def _spline(rows: NDArray[np.float64], u: float) -> NDArray[np.float64]:
    """The uniform cubic B-spline through `rows` (3, M) at position `u`."""
    i = min(max(int(u), 1), rows.shape[1] - 3)
    f = u - i
    weights = np.array(
        [(1 - f) ** 3, 3 * f**3 - 6 * f**2 + 4, -3 * f**3 + 3 * f**2 + 3 * f + 1, f**3],
    )
    return np.asarray(rows[:, i - 1 : i + 3] @ weights / 6)


def camera_axes(pose: Pose) -> NDArray[np.float64]:
    """(3, 3) rows: right, down and forward of the camera in the world."""
    cy, sy = math.cos(pose.yaw), math.sin(pose.yaw)
    cp, sp = math.cos(pose.pitch), math.sin(pose.pitch)
    forward = np.array([cy * cp, sy * cp, sp])
    right = np.array([sy, -cy, 0.0])
    down = np.cross(forward, right)
    cr, sr = math.cos(pose.roll), math.sin(pose.roll)
    return np.array([right * cr + down * sr, down * cr - right * sr, forward])
