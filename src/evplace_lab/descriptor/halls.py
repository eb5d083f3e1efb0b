"""Halls: rooms full of furniture with a lap around them, for what is near and lies under a roof.

A hall is made of the city's own primitives and drawn by its own loops.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Size
from evplace_lab.city.culling import draw_groups, group
from evplace_lab.city.drive import CAMERA_M, Pose
from evplace_lab.city.film import view_of
from evplace_lab.city.light import Light, Maps
from evplace_lab.city.materials import CAR_SIDE, FENCE, LAMP, PAVEMENT, PLAIN, ROOF, SIGN
from evplace_lab.city.mesh import Mesh, Primitives, up
from evplace_lab.city.raster import Buffers
from evplace_lab.city.shading import Frame, shade_frame

STEPS = 2000
"""Points of the lap."""
MOVED = 0.12
"""Share of the furniture that stands elsewhere in each drive."""
Look = tuple[float, ...]


@dataclass(frozen=True)
class Hall:
    """What is the same in every drive."""

    half: tuple[float, float]
    """Half its length and its width, metres; its middle is the origin."""
    height: float
    lap: NDArray[np.float64]
    """(STEPS + 1, 2) x and y of the lap, the last point the first again."""
    furniture: list[tuple[float, float, float, float, float, float, int, Look]]
    """x, y, half length, half width, height, angle, material and look of each piece."""
    panels: list[tuple[int, float, float, int, Look]]
    """Side, start, width, material and look of each panel of the walls."""
    lamps: NDArray[np.float64]
    """(L, 2) x and y of the lamps under the roof."""

    @property
    def length_m(self) -> float:
        """Of the lap."""
        return float(np.hypot(*np.diff(self.lap, axis=0).T).sum())


def build_hall(rng: np.random.Generator) -> Hall:
    """A hall of 6 to 24 by 4 to 12 metres."""
    half = (float(rng.uniform(3, 12)), float(rng.uniform(2, 6)))
    height = float(rng.uniform(2.3, 4.5))
    lap = _lap(half, rng)
    lamps = rng.uniform(-0.8, 0.8, (int(rng.integers(1, 7)), 2)) * half
    return Hall(half, height, lap, _furniture(half, lap, rng), _panels(half, rng), lamps)


def _lap(half: tuple[float, float], rng: np.random.Generator) -> NDArray[np.float64]:
    """A bent oval around the middle."""
    angle = np.linspace(0, 2 * math.pi, STEPS + 1) * rng.choice([-1, 1]) + rng.uniform(0, 2 * math.pi)
    share = 0.62 + 0.1 * np.sin(2 * angle + rng.uniform(0, 6)) + 0.1 * np.sin(3 * angle + rng.uniform(0, 6))
    return np.stack([half[0] * share * np.cos(angle), half[1] * share * np.sin(angle)], 1)


def _furniture(
    half: tuple[float, float], lap: NDArray[np.float64], rng: np.random.Generator
) -> list[tuple[float, float, float, float, float, float, int, Look]]:
    """Boxes that leave the lap free."""
    pieces = []
    for _ in range(int(half[0] * half[1] * rng.uniform(1.0, 3.0)) + 8):
        size = float(rng.uniform(0.12, 0.7)), float(rng.uniform(0.1, 0.4))
        x, y = (float(rng.uniform(-side, side)) for side in half)
        if np.hypot(*(lap - (x, y)).T).min() > math.hypot(*size) + 0.35:
            kind, look = _surface(rng, 2 * size[0])
            pieces.append((x, y, *size, float(rng.uniform(0.2, 2.0)), float(rng.uniform(0, 3.1)), kind, look))
    return pieces


def _panels(half: tuple[float, float], rng: np.random.Generator) -> list[tuple[int, float, float, int, Look]]:
    """The four walls in panels of 0.4 to 3 m, and posters, boards and windows on some."""
    panels = []
    for side in range(4):
        reach, at = half[side % 2], -half[side % 2]
        while at < reach - 0.01:
            width = min(float(rng.uniform(0.4, 3.0)), reach - at)
            panels.append((side, at, width, *_surface(rng, width)))
            at += width
    return panels


def _surface(rng: np.random.Generator, width: float) -> tuple[int, Look]:
    """A material and how it looks."""
    kind = int(rng.choice([SIGN, FENCE, ROOF, CAR_SIDE, PLAIN], p=[0.3, 0.2, 0.15, 0.15, 0.2]))
    colour = tuple(np.clip(rng.uniform(0.08, 0.75) * rng.uniform(0.7, 1.3, 3), 0.03, 0.9))
    detail = {SIGN: 0.0, FENCE: width * rng.uniform(1, 6), ROOF: float(rng.integers(2, 9))}
    rest = (detail.get(kind, 0.0), 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, float(rng.integers(1 << 20)))
    return kind, (*map(float, colour), *map(float, rest))


class HallFilm:
    """A hall in one drive: in a light of its own, with a few things elsewhere."""

    def __init__(
        self, hall: Hall, dark: bool, size: Size, field_deg: float, rng: np.random.Generator
    ) -> None:
        """`size` is (width, height)."""
        self.hall = hall
        self._scene = _scene(hall, rng)
        self._groups = group(self._scene)
        self._light = _light(dark, rng)
        self._maps = _maps(hall, len(self._scene.shape), rng)
        self._size, (width, height) = size, size
        self._focal = 0.5 * width / math.tan(math.radians(field_deg) / 2)
        self._buffers = Buffers.of(size, len(self._scene.shape))
        self._frame = Frame(
            np.empty((height, width, 3)), np.empty((height, width)), np.empty((height, width))
        )

    def pose_at(self, way_m: float) -> Pose:
        """On the lap, looking along it; where the lap ends it begins again."""
        at = way_m / self.hall.length_m % 1.0 * STEPS
        k = min(int(at), STEPS - 1)
        step = self.hall.lap[k + 1] - self.hall.lap[k]
        x, y = self.hall.lap[k] + step * (at - k)
        after = self.hall.lap[(k + 2) % STEPS] - self.hall.lap[(k + 1) % STEPS]
        bend = math.remainder(math.atan2(after[1], after[0]) - math.atan2(step[1], step[0]), 2 * math.pi)
        yaw = math.atan2(step[1], step[0]) + bend * (at - k)
        return Pose(float(x), float(y), CAMERA_M, yaw, 0.0, 0.0, 1.0, 0.0, way_m)

    def seen_from(self, pose: Pose) -> NDArray[np.float32]:
        """(H, W, 3) linear light."""
        view = view_of(pose, self._focal, self._size)
        draw_groups(self._scene, self._groups, view, self._buffers)
        shade_frame(self._scene, view, self._buffers, self._light, self._maps, self._frame)
        return self._frame.radiance.astype(np.float32)


def _scene(hall: Hall, rng: np.random.Generator) -> Primitives:
    mesh = Mesh()
    a, b = hall.half
    floor = (*rng.uniform(0.15, 0.5, 3), 0.0, 0.0, 2 * a, 2 * b)
    mesh.quad((-a, -b, 0), (2 * a, 0, 0), (0, 2 * b, 0), PAVEMENT, floor)
    mesh.quad((-a, b, hall.height), (2 * a, 0, 0), (0, -2 * b, 0), ROOF, (0.6, 0.6, 0.58, 12.0))
    for x, y in hall.lamps:
        mesh.quad((x, y + 0.2, hall.height - 0.02), (0.9, 0, 0), (0, -0.3, 0), LAMP, (1, 1, 0.9, 2.0, 6.0))
    for side, start, width, kind, look in hall.panels:
        corner, along = _on_wall(hall.half, side, start, width)
        mesh.quad(corner, along, up(hall.height), kind, look)
    for x, y, length, wide, height, angle, kind, look in hall.furniture:
        moved = rng.random() < MOVED
        shift = rng.uniform(-1.0, 1.0, 2) * moved
        mesh.box(
            (x + shift[0], y + shift[1], 0.0), (length, wide), height, angle + 2 * moved, kind, look, PLAIN
        )
    return mesh.primitives()


def _on_wall(
    half: tuple[float, float], side: int, start: float, width: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The lower corner of a panel and its edge along the wall, seen from inside."""
    a, b = half
    turn = side * math.pi / 2
    ahead = np.array([-math.cos(turn), -math.sin(turn), 0.0])
    out = np.array([-math.sin(turn), math.cos(turn), 0.0]) * (b if side % 2 == 0 else a)
    return out + ahead * start, ahead * width


def _light(dark: bool, rng: np.random.Generator) -> Light:
    """Daylight from one side, or lamps in the dark."""
    angle, level = rng.uniform(0, 2 * math.pi), math.exp(rng.uniform(math.log(0.15), math.log(0.8)))
    if dark:
        level = math.exp(rng.uniform(math.log(0.004), math.log(0.06)))
    sun = 0.0 if dark else level * float(rng.uniform(0.0, 2.5))
    grey = (level, level, level)
    rise = float(rng.uniform(0.2, 1.5))
    length = math.hypot(1.0, rise)
    return Light(
        night=float(dark),
        sun=(sun, sun, sun),
        towards_sun=(math.cos(angle) / length, math.sin(angle) / length, rise / length),
        ambient=grey,
        zenith=grey,
        horizon=grey,
        fog=0.0,
        wet=0.0,
        snow=0.0,
        headlights=float(rng.choice([0.0, 1.0])) if dark else 0.0,
        lamps=float(rng.uniform(0.5, 4.0)) if dark else 0.0,
        windows=0.0,
        clouds=0.0,
        glow=0.0,
    )


def _maps(hall: Hall, count: int, rng: np.random.Generator) -> Maps:
    """The light of those lamps that are on, on a grid of metres."""
    a, b = hall.half
    columns, rows = math.ceil(2 * a) + 2, math.ceil(2 * b) + 2
    v, u = np.mgrid[:rows, :columns] + 0.5
    on = hall.lamps[rng.random(len(hall.lamps)) < 0.6]
    level = np.zeros((rows, columns), np.float32)
    for x, y in on:
        squared = (u - 1 - a - x) ** 2 + (v - 1 - b - y) ** 2 + hall.height**2
        level += np.float32(hall.height) / squared**1.5
    shadow = np.full((2, 2), -1e3, np.float32)
    near = np.full((count, 6), -1, np.int32)
    return Maps((-a - 1.0, -b - 1.0), shadow, level.astype(np.float32), np.zeros((0, 6)), near)
