"""Light that is worked out once for a town: shadows of the sun, light of the street lamps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.jit import compiled
from evplace_lab.city.light import Light, Maps
from evplace_lab.city.materials import FACADE
from evplace_lab.city.town import Town

LAMP_REACH_M = 40
NEAREST = 6
TALLEST_M = 60.0


def light_maps(town: Town, light: Light, capacity: int) -> Maps:
    """The maps of a town under a light; `capacity` is the number of primitives a frame may hold."""
    ground = town.scene.frame[:, :2]
    origin = np.floor(ground.min(0)) - 60.0
    columns, rows = (np.ceil(ground.max(0)) - origin + 120.0).astype(int)
    shadow = np.full((2, 2), -1e3, np.float32)
    if light.sun[0] > 0:
        shadow = _shadows(height_map(town, origin, rows, columns), np.array(light.towards_sun))
    lamplight, near = np.zeros((2, 2), np.float32), np.full((capacity, NEAREST), -1, np.int32)
    if light.night > 0:
        lamplight = _lamplight(town, origin, rows, columns)
        near[: len(town.scene.shape)] = _nearest_lamps(town)
    return Maps((float(origin[0]), float(origin[1])), shadow, lamplight, town.lamps, near)


def height_map(town: Town, origin: NDArray[np.float64], rows: int, columns: int) -> NDArray[np.float32]:
    """(rows, columns) height of the roof or tree top over each square metre, -1000 where there is none."""
    heights = np.full((rows, columns), -1e3, np.float32)
    for house in town.houses:
        lot = house.lot
        x, y = np.meshgrid(np.arange(lot.x0, lot.x1, 0.5), np.arange(lot.y0, lot.y1, 0.5))
        cells = (town.terrain.world(x, y)[..., :2] - origin).astype(int).reshape(-1, 2)
        np.maximum.at(heights, (cells[:, 1], cells[:, 0]), house.top)
    for x, y, top, radius in town.trees:
        u, v = np.meshgrid(*(np.arange(-radius, radius, 0.5),) * 2)
        inside = u * u + v * v < radius * radius
        i, j = (x + u[inside] - origin[0]).astype(int), (y + v[inside] - origin[1]).astype(int)
        np.maximum.at(heights, (j, i), top)
    return heights


@compiled
def _shadows(heights: NDArray[np.float32], sun: NDArray[np.float64]) -> NDArray[np.float32]:
    """Height of the shade over each square metre: the highest thing towards the sun, less the sun's rise."""
    rows, columns = heights.shape
    shade = np.empty((rows, columns), np.float32)
    level = math.sqrt(sun[0] * sun[0] + sun[1] * sun[1])
    dx, dy, rise = sun[0] / level, sun[1] / level, sun[2] / level
    for y in range(rows):
        for x in range(columns):
            best = -1000.0
            for k in range(1, 240):
                d = k * 0.7
                i, j = int(x + 0.5 + dx * d), int(y + 0.5 + dy * d)
                if i < 0 or j < 0 or i >= columns or j >= rows or TALLEST_M - d * rise < best:
                    break
                best = max(best, heights[j, i] - d * rise)
            shade[y, x] = best
    return shade


def _lamplight(town: Town, origin: NDArray[np.float64], rows: int, columns: int) -> NDArray[np.float32]:
    """Light of all lamps on level ground 6.9 m below them."""
    level = np.zeros((rows, columns), np.float32)
    for lamp in town.lamps:
        x, y = lamp[:2] - origin
        i, j = (slice(int(c) - LAMP_REACH_M, int(c) + LAMP_REACH_M) for c in (x, y))
        v, u = np.mgrid[j, i] + 0.5
        squared = (u - x) ** 2 + (v - y) ** 2 + 6.9**2
        down = 6.9 / np.sqrt(squared)
        level[j, i] += down / squared * (0.25 + 0.75 * down) * lamp[3]
    return level


def _nearest_lamps(town: Town) -> NDArray[np.int32]:
    """(N, 6) the nearest lamps within 45 m of each facade's middle."""
    near = np.full((len(town.scene.shape), NEAREST), -1, np.int32)
    frame = town.scene.frame
    middle = frame[:, :3] + 0.5 * (frame[:, 3:6] + frame[:, 6:9])
    for q in np.flatnonzero(town.scene.material == FACADE):
        distance = np.hypot(*(town.lamps[:, :2] - middle[q, :2]).T)
        order = np.argsort(distance, kind="stable")[:NEAREST]
        order = order[distance[order] < 45]
        near[q, : len(order)] = order
    return near
