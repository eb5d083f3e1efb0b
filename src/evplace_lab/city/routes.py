"""Routes through the town: the two overlapping paths of the benchmark, and more by seed."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace_lab.city.streets import Streets
from evplace_lab.city.terrain import Terrain

Node = tuple[int, int]
"""A crossing: (street along y, street along x)."""

PATHS: dict[int, list[Node]] = {
    1: [(0, 1), (3, 1), (3, 3), (5, 3), (5, 1), (6, 1), (6, 5), (3, 5), (3, 4), (1, 4), (1, 6)],
    2: [
        (0, 0),
        (1, 0),
        (1, 1),
        (3, 1),
        (3, 3),
        (5, 3),
        (5, 2),
        (6, 2),
        (6, 4),
        (4, 4),
        (4, 5),
        (3, 5),
        (3, 4),
        (2, 4),
        (2, 6),
    ],
}
"""The two paths; about 60 per cent of path 2 runs along path 1."""
LANE_M = {1: 1.9, 2: 1.3}
"""From the middle of the street to the car; path 2 keeps 0.6 m further left."""
STEP_M = 0.1
STOP_M = 12.0
"""A car that waits has its camera so far from the middle of the crossing."""
CORNER_M = 7.0


@dataclass(frozen=True)
class Halt:
    """A place where a red light may stop the car."""

    at_m: float
    """Way along the route."""
    crossing: Node
    axis: int
    """0 where the car goes along x, 1 along y."""


@dataclass(frozen=True)
class Route:
    """The middle of the car's lane, every 0.1 m."""

    position: NDArray[np.float64]
    """(N, 3) world metres on the ground."""
    halts: list[Halt]

    @property
    def length_m(self) -> float:
        """Length of the route."""
        return (len(self.position) - 1) * STEP_M


def nodes_of(path: int, streets: Streets, seed: int) -> list[Node]:
    """The crossings of a path: 1 and 2 are the benchmark's, any higher number is drawn by seed."""
    if path < 1:
        raise SettingsError(f"unknown path {path}: paths are numbered from 1")
    if path in PATHS:
        return PATHS[path]
    rng = np.random.default_rng([seed, 1, path])
    node = (int(rng.integers(1, len(streets.x) - 1)), int(rng.integers(1, len(streets.y) - 1)))
    nodes, before = [node], (0, 0)
    while len(nodes) < 22:
        steps = [s for s in ((1, 0), (-1, 0), (0, 1), (0, -1)) if s != (-before[0], -before[1])]
        step = steps[int(rng.integers(len(steps)))]
        following = (node[0] + step[0], node[1] + step[1])
        if 0 <= following[0] < len(streets.x) and 0 <= following[1] < len(streets.y):
            node, before = following, step
            nodes.append(node)
    return nodes


def lay_route(path: int, streets: Streets, terrain: Terrain, seed: int, length_m: float | None) -> Route:
    """The lane along a path, at most `length_m` long (None: the whole path)."""
    nodes = nodes_of(path, streets, seed)
    lane = LANE_M.get(path, 1.9)
    points = terrain.world(*_lane_line(_board(nodes, streets), lane).T)
    position = _resampled(points)
    if length_m is not None:
        position = position[: int(length_m / STEP_M) + 1]
    return Route(position, _halts(nodes, streets, terrain, lane, position))


def _board(nodes: list[Node], streets: Streets) -> NDArray[np.float64]:
    return np.array([(streets.x[i], streets.y[j]) for i, j in nodes])


def _lane_line(corners: NDArray[np.float64], lane: float) -> NDArray[np.float64]:
    """(M, 2) drawing-board points of the lane: straights every metre, corners as parabolas."""
    ahead = np.sign(np.diff(corners, axis=0))
    right = np.stack([ahead[:, 1], -ahead[:, 0]], 1)
    bends = [corners[0] + right[0] * lane + ahead[0] * 6]
    for k in range(1, len(corners) - 1):
        turn = right[k - 1] if np.allclose(right[k - 1], right[k]) else right[k - 1] + right[k]
        bends.append(corners[k] + lane * turn)
    bends.append(corners[-1] + right[-1] * lane - ahead[-1] * 6)
    t = np.linspace(0, 1, 60)[:, None]
    line = [bends[0]]
    for k in range(1, len(bends) - 1):
        a, b, c = bends[k] - ahead[k - 1] * CORNER_M, bends[k], bends[k] + ahead[k] * CORNER_M
        line += [*_straight(line[-1], a), *((1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c)]
    return np.array([*line, *_straight(line[-1], bends[-1]), bends[-1]])


def _straight(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points about a metre apart between `a` and `b`, without both."""
    count = max(int(np.hypot(*(b - a))), 1)
    return a + (b - a) * (np.arange(1, count) / count)[:, None]


def _resampled(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same line with a point every STEP_M of its level length, its kinks smoothed away."""
    way = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    at = np.arange(0, way[-1], STEP_M)
    return np.stack([smoothed(np.interp(at, way, points[:, k]), 0.8) for k in range(3)], 1)


def smoothed(values: NDArray[np.float64], sigma_m: float) -> NDArray[np.float64]:
    """`values`, given every STEP_M, under a Gaussian of `sigma_m` metres."""
    reach = int(4 * sigma_m / STEP_M)
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) * STEP_M / sigma_m) ** 2)
    padded = np.pad(values, reach, mode="reflect", reflect_type="odd")
    return np.convolve(padded, weights / weights.sum(), "valid")


def _halts(
    nodes: list[Node], streets: Streets, terrain: Terrain, lane: float, position: NDArray[np.float64]
) -> list[Halt]:
    """Where the car would wait before each crossing on its way."""
    halts = []
    for (i, j), (k, m) in itertools.pairwise(nodes):
        ahead = np.sign([k - i, m - j])
        right = np.array([ahead[1], -ahead[0]])
        for step in range(1, max(abs(k - i), abs(m - j)) + 1):
            crossing = (i + int(ahead[0]) * step, j + int(ahead[1]) * step)
            board = _board([crossing], streets)[0] - ahead * STOP_M + right * lane
            away = np.hypot(*(position[:, :2] - terrain.world(*board)[:2]).T)
            if away.min() < 1.0:
                halts.append(Halt(float(np.argmin(away)) * STEP_M, crossing, 0 if ahead[0] else 1))
    return halts
