"""The street grid and the ground: roads, pavements, kerbs and courtyards."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.materials import FACADE, HALF_ROAD_M, PAVEMENT, PLAIN, ROAD
from evplace_lab.city.mesh import Mesh
from evplace_lab.city.terrain import Terrain

KERB_M = 0.14
PAVEMENT_M = 3.2
EDGE_M = 90.0
"""How far the outermost blocks reach beyond the outermost streets."""
TILE_M = 8.0


@dataclass(frozen=True)
class Streets:
    """Where streets run on the drawing board, metres."""

    x: NDArray[np.float64]
    """Streets along y, by their x."""
    y: NDArray[np.float64]
    """Streets along x, by their y."""

    @classmethod
    def of(cls, rng: np.random.Generator, count: int = 7) -> Streets:
        """`count` streets each way, 78 to 112 m apart."""
        x, y = (np.concatenate([[0.0], np.cumsum(rng.uniform(78, 112, count - 1))]) for _ in range(2))
        return cls(x, y)

    def blocks(self) -> list[tuple[float, float, float, float]]:
        """Every block inside its kerbs: x0, x1, y0, y1."""
        columns, rows = (_gaps(axis) for axis in (self.x, self.y))
        return [(x0, x1, y0, y1) for x0, x1 in columns for y0, y1 in rows]


def _gaps(axis: NDArray[np.float64]) -> list[tuple[float, float]]:
    edges = [axis[0] - EDGE_M, *axis, axis[-1] + EDGE_M]
    return [(a + HALF_ROAD_M, b - HALF_ROAD_M) for a, b in itertools.pairwise(edges)]


def pave(
    mesh: Mesh,
    streets: Streets,
    terrain: Terrain,
    courts: dict[tuple[int, int], tuple[float, float, float]],
    rng: np.random.Generator,
) -> None:
    """Cover the board with tiles; `courts` gives the colour inside block (column, row)."""
    lines_x, lines_y = (_lines(axis) for axis in (streets.x, streets.y))
    styles_x, styles_y = rng.random(len(streets.x)), rng.random(len(streets.y))
    for x0, x1 in itertools.pairwise(lines_x):
        for y0, y1 in itertools.pairwise(lines_y):
            i, off_x = _nearest(streets.x, (x0 + x1) / 2)
            j, off_y = _nearest(streets.y, (y0 + y1) / 2)
            tail = (x0, y0, x1 - x0, y1 - y0, streets.x[i], streets.y[j], styles_x[i], styles_y[j])
            tile = (x0, x1, y0, y1)
            if min(off_x, off_y) < HALF_ROAD_M:
                _tile(mesh, terrain, tile, 0.0, ROAD, (0.13, 0.13, 0.135, *tail))
            elif min(off_x, off_y) < HALF_ROAD_M + PAVEMENT_M:
                _tile(mesh, terrain, tile, KERB_M, PAVEMENT, (0.30, 0.295, 0.285, *tail))
            else:
                column = int(np.searchsorted(streets.x, (x0 + x1) / 2))
                row = int(np.searchsorted(streets.y, (y0 + y1) / 2))
                _tile(mesh, terrain, tile, KERB_M, PLAIN, courts[column, row])
    for block_edges in streets.blocks():
        _kerbs(mesh, terrain, block_edges, lines_x, lines_y)


def close_vistas(mesh: Mesh, streets: Streets, terrain: Terrain, rng: np.random.Generator) -> None:
    """A house across the outer end of every street, so that no street runs into the void."""
    for along_y, axis, other in ((True, streets.x, streets.y), (False, streets.y, streets.x)):
        for at in axis:
            for end, outward in ((other[0] - EDGE_M, -1), (other[-1] + EDGE_M, 1)):
                a, b = at + 9.0 * outward, at - 9.0 * outward
                if along_y:
                    a, b = b, a
                ends = [terrain.world(u, end) if along_y else terrain.world(end, u) for u in (a, b)]
                tall = rng.uniform(10, 18)
                look = (
                    0.5,
                    0.45,
                    0.4,
                    18.0,
                    tall,
                    3.2,
                    2.4,
                    0.5,
                    0.55,
                    3.8,
                    int(rng.integers(1, 30000)),
                    2,
                    0.6,
                    0.3,
                    0.9,
                )
                mesh.quad(ends[0], ends[1] - ends[0], (0, 0, tall), FACADE, look)


def _lines(axis: NDArray[np.float64]) -> list[float]:
    """Where tiles end along one axis: at kerbs, at the backs of pavements, and every few metres."""
    lines: list[float] = []
    for a, b in _gaps(axis):
        inner = np.linspace(a + PAVEMENT_M, b - PAVEMENT_M, int((b - a) / TILE_M) + 1)
        lines += [a, *inner, b]
    middles = [float(street) for street in axis]
    return sorted(lines + middles)


def _nearest(axis: NDArray[np.float64], value: float) -> tuple[int, float]:
    index = int(np.argmin(np.abs(axis - value)))
    return index, abs(float(axis[index]) - value)


def _tile(
    mesh: Mesh,
    terrain: Terrain,
    tile: tuple[float, float, float, float],
    lift: float,
    material: int,
    look: tuple[float, ...],
) -> None:
    x0, x1, y0, y1 = tile
    corner, right, up = terrain.world([x0, x1, x0], [y0, y0, y1], lift)
    mesh.quad(corner, right - corner, up - corner, material, look)


def _kerbs(
    mesh: Mesh,
    terrain: Terrain,
    block: tuple[float, float, float, float],
    lines_x: list[float],
    lines_y: list[float],
) -> None:
    """Four rows of kerb stones, counter-clockwise, so that they face the road."""
    x0, x1, y0, y1 = block
    xs = [x for x in lines_x if x0 <= x <= x1]
    ys = [y for y in lines_y if y0 <= y <= y1]
    ring = (
        [(x, y0) for x in xs]
        + [(x1, y) for y in ys]
        + [(x, y1) for x in xs[::-1]]
        + [(x0, y) for y in ys[::-1]]
    )
    feet = terrain.world([x for x, _ in ring], [y for _, y in ring])
    for a, b in itertools.pairwise(feet):
        if np.hypot(*(b - a)[:2]) > 0.1:
            mesh.quad(a, b - a, (0, 0, KERB_M), PLAIN, (0.33, 0.33, 0.33))
