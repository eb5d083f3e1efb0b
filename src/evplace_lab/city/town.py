"""The town: everything that stands still and is the same in every drive."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.buildings import House, Lot, build_house
from evplace_lab.city.furniture import Furniture, furnish, hedge, plant
from evplace_lab.city.mesh import Mesh, Primitives
from evplace_lab.city.streets import KERB_M, PAVEMENT_M, Streets, close_vistas, pave
from evplace_lab.city.terrain import Terrain

DEPTH_M = 12.0
"""Depth of a lot."""
GRASS, YARD = (0.09, 0.16, 0.05), (0.25, 0.24, 0.22)


@dataclass(frozen=True)
class Town:
    """A town of one seed."""

    seed: int
    streets: Streets
    terrain: Terrain
    scene: Primitives
    houses: list[House]
    lamps: NDArray[np.float64]
    """(L, 6) x, y, z and colour of each street lamp."""
    trees: NDArray[np.float64]
    """(T, 4) x, y, top and radius of each tree, metres."""
    signals: NDArray[np.int64]
    """(S, 5) street along y, street along x, axis, and the primitives of the red and the green light."""


def build_town(seed: int) -> Town:
    """A town of seven streets each way with about a thousand houses; the same seed gives the same town."""
    rng = np.random.default_rng([seed, 0])
    streets, terrain = Streets.of(rng), Terrain.of(rng)
    mesh, kept = Mesh(), Furniture()
    houses: list[House] = []
    courts: dict[tuple[int, int], tuple[float, float, float]] = {}
    rows = len(streets.y) + 1
    for number, block in enumerate(streets.blocks()):
        inside = _shrunk(block, PAVEMENT_M)
        park = rng.random() < 0.10
        courts[divmod(number, rows)] = GRASS if park else YARD
        if park:
            _park(mesh, terrain, inside, kept, rng)
        else:
            houses += _houses(mesh, terrain, inside, kept, rng)
    furnish(mesh, streets, terrain, kept, rng)
    pave(mesh, streets, terrain, courts, rng)
    close_vistas(mesh, streets, terrain, rng)
    return Town(
        seed,
        streets,
        terrain,
        mesh.primitives(),
        houses,
        np.array(kept.lamps),
        np.array(kept.trees),
        np.array(kept.signals, np.int64).reshape(-1, 5),
    )


Block = tuple[float, float, float, float]


def _shrunk(block: Block, by: float) -> Block:
    x0, x1, y0, y1 = block
    return x0 + by, x1 - by, y0 + by, y1 - by


def _park(mesh: Mesh, terrain: Terrain, block: Block, kept: Furniture, rng: np.random.Generator) -> None:
    """Trees behind a low hedge."""
    x0, x1, y0, y1 = block
    for _ in range(26):
        foot = terrain.world(rng.uniform(x0 + 1, x1 - 1), rng.uniform(y0 + 1, y1 - 1), KERB_M)
        plant(mesh, foot, rng, rng.uniform(0.8, 1.5), kept)
    hedge(mesh, terrain.world([x0, x1, x1, x0], [y0, y0, y1, y1], KERB_M), rng)


def _houses(
    mesh: Mesh, terrain: Terrain, block: Block, kept: Furniture, rng: np.random.Generator
) -> list[House]:
    """Rows of houses on the four sides of a block, with a gap here and there."""
    usual = rng.uniform(6, 22)
    houses = []
    for lot in _lots(block, rng):
        if rng.random() < 0.09:
            _garden(mesh, terrain, lot, kept, rng)
        else:
            houses.append(build_house(mesh, terrain, lot, usual, rng))
    return houses


def _lots(block: Block, rng: np.random.Generator) -> list[Lot]:
    """Cut the rim of a block into lots of 7 to 22 m; some stand back from the pavement."""
    x0, x1, y0, y1 = block
    lots = []
    for side in range(4):
        start, end = (x0, x1) if side in (0, 2) else (y0 + DEPTH_M + 1, y1 - DEPTH_M - 1)
        while start < end - 4:
            width = min(rng.uniform(7, 22), end - start)
            if end - start - width < 5:
                width = end - start
            back = rng.choice([0, 0, 0, 0.6, 1.5, 3.0])
            a, b = start + 0.02, start + width - rng.choice([0.02, 0.02, 0.02, 1.5])
            lots.append(
                (
                    Lot(a, b, y0 + back, y0 + DEPTH_M, 0),
                    Lot(x1 - DEPTH_M, x1 - back, a, b, 1),
                    Lot(a, b, y1 - DEPTH_M, y1 - back, 2),
                    Lot(x0 + back, x0 + DEPTH_M, a, b, 3),
                )[side]
            )
            start += width
    return lots


def _garden(mesh: Mesh, terrain: Terrain, lot: Lot, kept: Furniture, rng: np.random.Generator) -> None:
    """An empty lot: a hedge or fence and three trees."""
    x, y = np.transpose(lot.corners)
    hedge(mesh, terrain.world(x, y, KERB_M), rng)
    for _ in range(3):
        x, y = rng.uniform((lot.x0 + 1, lot.y0 + 1), (lot.x1 - 1, lot.y1 - 1))
        plant(mesh, terrain.world(x, y, KERB_M), rng, rng.uniform(0.8, 1.3), kept)
