"""Houses: walls on the bent board, flat or pitched roofs, signs and awnings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.facades import SHOP
from evplace_lab.city.materials import FACADE, PLAIN, ROOF, SIGN
from evplace_lab.city.mesh import Mesh, up
from evplace_lab.city.terrain import Terrain

WALLS = np.array(
    [
        (0.42, 0.20, 0.13),
        (0.55, 0.48, 0.38),
        (0.62, 0.60, 0.55),
        (0.30, 0.31, 0.33),
        (0.66, 0.55, 0.33),
        (0.48, 0.33, 0.25),
        (0.38, 0.45, 0.48),
        (0.60, 0.42, 0.36),
        (0.70, 0.68, 0.62),
        (0.25, 0.17, 0.13),
    ]
)
ROOFS = np.array([(0.30, 0.12, 0.08), (0.16, 0.15, 0.16), (0.24, 0.16, 0.12)])


@dataclass(frozen=True)
class Lot:
    """A piece of ground on the drawing board; its street is at `side`: 0 south, 1 east, 2 north, 3 west."""

    x0: float
    x1: float
    y0: float
    y1: float
    side: int

    @property
    def corners(self) -> list[tuple[float, float]]:
        """Counter-clockwise from south-west; edge k runs along side k."""
        return [(self.x0, self.y0), (self.x1, self.y0), (self.x1, self.y1), (self.x0, self.y1)]

    @property
    def front(self) -> float:
        """Metres of frontage."""
        return self.x1 - self.x0 if self.side in (0, 2) else self.y1 - self.y0


@dataclass(frozen=True)
class House:
    """What the shadow map needs to know of a house."""

    lot: Lot
    top: float
    """Height of its roof, world metres."""


def build_house(mesh: Mesh, terrain: Terrain, lot: Lot, usual: float, rng: np.random.Generator) -> House:
    """A house on a lot, about `usual` metres high."""
    storey, ground = rng.uniform(2.8, 3.6), rng.uniform(3.4, 4.6)
    storeys = max(1, round((usual * rng.uniform(0.6, 1.6) - ground) / storey))
    height = ground + storeys * storey + 0.7
    if rng.random() < 0.05:
        height += rng.uniform(10, 25)
    feet = terrain.world(*np.transpose(lot.corners))
    base = float(feet[:, 2].min()) - 0.1
    feet[:, 2] = base
    shop = _walls(
        mesh,
        feet,
        lot,
        height + float(np.ptp(terrain.world(*np.transpose(lot.corners))[:, 2])),
        storey,
        ground,
        rng,
    )
    if storeys <= 2 and rng.random() < 0.7:
        _pitched_roof(mesh, feet + up(height), lot.side, rng)
    street = terrain.world(*np.mean([lot.corners[lot.side], lot.corners[(lot.side + 1) % 4]], axis=0))
    if shop:
        _hangings(mesh, feet, lot.side, float(street[2]), rng)
    return House(lot, base + height)


def _walls(
    mesh: Mesh,
    feet: NDArray[np.float64],
    lot: Lot,
    height: float,
    storey: float,
    ground: float,
    rng: np.random.Generator,
) -> bool:
    """Four facades; True where the front is a shop's."""
    colour = WALLS[rng.integers(len(WALLS))] * rng.uniform(0.8, 1.2)
    windows = (rng.uniform(1.7, 3.6), rng.uniform(0.35, 0.75), rng.uniform(0.42, 0.72))
    seed, style = int(rng.integers(1, 30000)), int(rng.integers(4))
    trim, lit, kind = rng.choice([0.75, 0.6, 0.1, 0.85]), rng.uniform(0.1, 0.5), rng.random()
    for k in range(4):
        along = feet[(k + 1) % 4] - feet[k]
        width = float(np.hypot(along[0], along[1]))
        ground_floor = kind if k == lot.side else 0.9
        look = (
            *colour,
            width,
            height,
            storey,
            *windows,
            ground,
            seed + k * 7,
            style,
            trim,
            lit,
            ground_floor,
        )
        mesh.quad(feet[k], along, (0, 0, height), FACADE, look)
    return bool(kind < SHOP)


def _pitched_roof(mesh: Mesh, eaves: NDArray[np.float64], side: int, rng: np.random.Generator) -> None:
    """Two slopes with the ridge along the street, and the two gables."""
    a, b, c, d = (eaves[(side + k) % 4] for k in range(4))
    rise = np.array([0, 0, rng.uniform(1.8, 3.2)])
    colour = ROOFS[rng.integers(len(ROOFS))] * rng.uniform(0.8, 1.2)
    tiles = (*colour, 12.0)
    mesh.quad(a, b - a, (d - a) / 2 + rise, ROOF, tiles)
    mesh.quad(c, d - c, (b - c) / 2 + rise, ROOF, tiles)
    for corner, other in ((b, c), (d, a)):
        mesh.quad(corner, other - corner, rise, PLAIN, colour * 1.3, taper=(0.5, 0.5))
    if rng.random() < 0.6:
        mesh.box((a + b + c + d) / 4 + rise * 0.5, (0.4, 0.4), float(rise[2]), 0.3, PLAIN, (0.35, 0.2, 0.15))


def _hangings(
    mesh: Mesh, feet: NDArray[np.float64], side: int, street: float, rng: np.random.Generator
) -> None:
    """A sign that hangs out over the pavement, an awning over the shop window."""
    a, b = feet[side].copy(), feet[(side + 1) % 4].copy()
    a[2] = b[2] = street
    along = (b - a) / np.linalg.norm(b - a)
    out = np.array([along[1], -along[0], 0.0])
    width = float(np.linalg.norm(b - a))
    if rng.random() < 0.7:
        foot = (a + b) / 2 + along * rng.uniform(-0.4, 0.4) * width + up(rng.uniform(2.8, 4.2))
        size, tall = out * rng.uniform(0.6, 1.2), (0, 0, rng.uniform(0.6, 2.2))
        look = (
            *rng.uniform(0.1, 0.8, 3),
            rng.choice([0, 2.0, 3.0]),
            0,
            0,
            0,
            0,
            0,
            0,
            int(rng.integers(1, 30000)),
        )
        mesh.quad(foot, size, tall, SIGN, look)
        mesh.quad(foot + size, -size, tall, SIGN, look)
    if rng.random() < 0.4:
        reach, colour = rng.uniform(0.3, 0.45) * width, rng.uniform(0.1, 0.7, 3)
        edge = (a + b) / 2 - along * reach + out * 1.2 + up(2.4)
        mesh.quad(edge, along * 2 * reach, (0, 0, 0.5) - out * 1.2, PLAIN, colour)
        mesh.quad(edge - up(0.3), along * 2 * reach, (0, 0, 0.3), PLAIN, colour * 0.7)
