"""What stands along a street: lamps, trees, signs, bins, shelters and traffic lights."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.materials import FENCE, HALF_ROAD_M, LAMP, LEAVES, PLAIN, SIGN
from evplace_lab.city.mesh import OVAL, Mesh, up
from evplace_lab.city.streets import KERB_M, Streets
from evplace_lab.city.terrain import Terrain

SODIUM, MERCURY = (1.0, 0.62, 0.28), (0.85, 0.92, 1.0)
POLE = (0.12, 0.13, 0.13)


@dataclass
class Furniture:
    """What later steps need to know of the things that were put up."""

    lamps: list[tuple[float, ...]] = field(default_factory=list)
    """x, y, z and colour of each street lamp."""
    trees: list[tuple[float, float, float, float]] = field(default_factory=list)
    """x, y, height of the top, radius."""
    signals: list[tuple[int, int, int, int, int]] = field(default_factory=list)
    """Street along y, street along x, axis (0: for cars along x), its red and its green primitive."""


def furnish(
    mesh: Mesh, streets: Streets, terrain: Terrain, kept: Furniture, rng: np.random.Generator
) -> None:
    """Put everything up along every street."""
    for along_y, axis, other in ((True, streets.x, streets.y), (False, streets.y, streets.x)):
        for at in axis:
            colour = SODIUM if rng.random() < 0.6 else MERCURY
            spacing, gap = rng.uniform(12, 17), rng.uniform(9, 17)
            for start, end in zip(other + 10, other[1:] - 10, strict=False):
                row = _Row(float(at), along_y, float(start), float(end))
                _lamp_row(mesh, terrain, row, colour, spacing, kept, rng)
                _small_things(mesh, terrain, row, gap, kept, rng)
    _traffic_lights(mesh, streets, terrain, kept, rng)


@dataclass(frozen=True)
class _Row:
    """One street between two crossings."""

    at: float
    along_y: bool
    start: float
    end: float

    def point(self, along: float, off: float) -> tuple[float, float]:
        """Drawing-board position `along` the street, `off` its middle."""
        return (self.at + off, along) if self.along_y else (along, self.at + off)

    def spot(self, terrain: Terrain, along: float, off: float) -> tuple[NDArray[np.float64], float]:
        """World position on the pavement, and the world direction across the street to its middle."""
        x, y = self.point(along, off)
        across = (math.pi if off > 0 else 0.0) if self.along_y else (-math.pi / 2 if off > 0 else math.pi / 2)
        return terrain.world(x, y, KERB_M), terrain.heading(x, y, across)


def _lamp_row(
    mesh: Mesh,
    terrain: Terrain,
    row: _Row,
    colour: tuple[float, float, float],
    spacing: float,
    kept: Furniture,
    rng: np.random.Generator,
) -> None:
    along, side = row.start + rng.uniform(0, 6), 1
    while along < row.end:
        foot, inward = row.spot(terrain, along, side * 5.9)
        kept.lamps.append((*_street_lamp(mesh, foot, inward, colour), *colour))
        along += spacing + rng.uniform(-2, 2)
        side = -side


def _street_lamp(
    mesh: Mesh, foot: NDArray[np.float64], inward: float, colour: tuple[float, float, float]
) -> tuple[float, float, float]:
    """A pole with an arm over the road; returns where its lamp is."""
    reach = np.array([math.cos(inward), math.sin(inward), 0.0])
    mesh.box(foot, (0.11, 0.11), 6.9, inward, PLAIN, POLE)
    mesh.box(foot + reach * 0.8 + up(6.9), (0.85, 0.1), 0.15, inward, PLAIN, POLE)
    head = foot + reach * 1.5 + up(6.8)
    mesh.box(head, (0.3, 0.24), 0.12, inward, LAMP, (*colour, 0.3, 25.0))
    x, y, z = (float(value) for value in head)
    side = np.array([-reach[1], reach[0], 0.0])
    corner = head - reach * 0.3 + side * 0.24
    mesh.quad(corner, reach * 0.6, -side * 0.48, LAMP, (*colour, 0.3, 25.0))
    return x, y, z


def _small_things(
    mesh: Mesh, terrain: Terrain, row: _Row, gap: float, kept: Furniture, rng: np.random.Generator
) -> None:
    """Trees, bins, signs and shelters on both pavements of a row."""
    avenue = rng.random() < 0.5
    for side in (-1, 1):
        along = row.start + rng.uniform(0, gap)
        while along < row.end:
            pick = rng.random()
            foot, inward = row.spot(terrain, along, side * 6.2)
            if avenue and pick < 0.6:
                plant(mesh, foot, rng, rng.uniform(0.6, 1.0), kept)
            elif pick < 0.68:
                mesh.box(foot, (0.25, 0.25), 1.06, inward, PLAIN, rng.uniform(0.05, 0.4, 3), top=PLAIN)
            elif pick < 0.74:
                _road_sign(mesh, foot, inward, rng)
            elif pick < 0.77:
                _shelter(mesh, *row.spot(terrain, along, side * 7.2), rng)
            along += gap * rng.uniform(0.6, 1.4)


def plant(
    mesh: Mesh, foot: NDArray[np.float64], rng: np.random.Generator, size: float, kept: Furniture
) -> None:
    """A tree: broad, slim or a conifer."""
    kind = rng.random()
    trunk = rng.uniform(2.0, 3.0) * size + 0.5
    green = np.array([0.10, 0.19, 0.05]) * rng.uniform(0.7, 1.3) + np.array([0.06, 0, 0]) * rng.random()
    mesh.box(foot, (0.14 * size, 0.14 * size), trunk + 0.8 * size, rng.random(), PLAIN, (0.13, 0.09, 0.06))
    if kind < 0.6:
        tufts = [(rng.normal(0, 0.85, 2), rng.uniform(0.2, 2.6), rng.uniform(0.35, 0.8)) for _ in range(20)]
    elif kind < 0.85:
        tufts = [(rng.normal(0, 0.2, 2), 0.45 * k, rng.uniform(0.45, 0.7)) for k in range(9)]
    else:
        tufts = [(rng.normal(0, 0.06, 2), 0.42 * k - 0.9, 1.15 - 0.12 * k) for k in range(9)]
    for off, rise, radius in tufts:
        centre = foot + np.array([off[0] * size, off[1] * size, trunk + (rise + 0.4) * size])
        look = (*(green * rng.uniform(0.75, 1.25)), 0, 0, 0, 0, 0, 0, 0, int(rng.integers(1, 30000)))
        mesh.sphere(centre, radius * size, LEAVES, look)
    kept.trees.append((float(foot[0]), float(foot[1]), float(foot[2]) + trunk + 2.8 * size, 1.4 * size))


def _road_sign(mesh: Mesh, foot: NDArray[np.float64], inward: float, rng: np.random.Generator) -> None:
    mesh.box(foot, (0.06, 0.06), 2.46, inward, PLAIN, (0.4, 0.4, 0.4))
    wide = np.array([math.cos(inward), math.sin(inward), 0.0]) * 0.7
    look = (*rng.uniform(0.1, 0.8, 3), 0.05, 0, 0, 0, 0, 0, 0, int(rng.integers(30000)))
    for way in (-1, 1):
        mesh.quad(foot + up(1.96) - way * wide / 2, way * wide, (0, 0, 0.7), SIGN, look)


def _shelter(mesh: Mesh, foot: NDArray[np.float64], inward: float, rng: np.random.Generator) -> None:
    look = (*rng.uniform(0.1, 0.6, 3), 0.8, 0, 0, 0, 0, 0, 0, int(rng.integers(30000)))
    mesh.box(foot, (0.7, 1.8), 2.36, inward, SIGN, look, top=PLAIN)


def hedge(mesh: Mesh, feet: NDArray[np.float64], rng: np.random.Generator) -> None:
    """A hedge or a fence around four corners (counter-clockwise)."""
    tall, bars = rng.uniform(0.9, 1.8), float(rng.random() < 0.5)
    colour = (0.35, 0.27, 0.2) if bars else (0.1, 0.17, 0.06)
    for k in range(4):
        along = feet[(k + 1) % 4] - feet[k]
        mesh.quad(feet[k], along, (0, 0, tall), FENCE, (*colour, float(np.linalg.norm(along)), bars))


def _traffic_lights(
    mesh: Mesh, streets: Streets, terrain: Terrain, kept: Furniture, rng: np.random.Generator
) -> None:
    """At half of the crossings: one light for each way of coming, on the far right corner."""
    for i, x in enumerate(streets.x):
        for j, y in enumerate(streets.y):
            if rng.random() < 0.5:
                continue
            for k in range(4):
                ahead = np.array([math.cos(k * math.pi / 2), math.sin(k * math.pi / 2)])
                right = np.array([ahead[1], -ahead[0]])
                spot = np.array([x, y]) + (ahead + right) * (HALF_ROAD_M + 0.7)
                heading = terrain.heading(spot[0], spot[1], k * math.pi / 2)
                foot = terrain.world(spot[0], spot[1], KERB_M)
                kept.signals.append((i, j, k % 2, *_signal(mesh, foot, heading)))


def _signal(mesh: Mesh, foot: NDArray[np.float64], heading: float) -> tuple[int, int]:
    """A post with three lights that face a driver who goes `heading`; returns its red and its green."""
    mesh.box(foot, (0.08, 0.08), 3.0, heading, PLAIN, (0.2, 0.2, 0.1))
    mesh.box(foot + up(3.0), (0.16, 0.2), 1.1, heading, PLAIN, (0.03, 0.03, 0.03), top=PLAIN)
    ahead = np.array([math.cos(heading), math.sin(heading), 0.0])
    right = np.array([ahead[1], -ahead[0], 0.0])
    found = []
    for colour, rise in (((1.0, 0.10, 0.05), 3.76), ((1.0, 0.6, 0.05), 3.42), ((0.1, 1.0, 0.4), 3.08)):
        found.append(len(mesh))
        corner = foot - ahead * 0.17 - right * 0.14 + up(rise)
        mesh.quad(corner, right * 0.28, (0, 0, 0.28), LAMP, (*colour, 0.05, 0.02), shape=OVAL)
    return found[0], found[2]
