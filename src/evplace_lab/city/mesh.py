"""The primitives that everything is made of, and the list that collects them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

QUAD, SPHERE, OVAL = 0, 1, 2
"""Shapes: a parallelogram (or trapezium), a sphere, an ellipse within a parallelogram."""
LOOKS = 16
"""Numbers that describe how a primitive looks; the first three are its colour, the rest its material's."""

Vector = NDArray[np.float64]


class Primitives(NamedTuple):
    """N primitives as arrays, ready for the loops."""

    frame: NDArray[np.float64]
    """(N, 9) corner O, edges U and V, metres; for a sphere its centre, its radius and zeros."""
    shape: NDArray[np.int32]
    """(N,) QUAD, SPHERE or OVAL."""
    taper: NDArray[np.float64]
    """(N, 2) how much of U the left and the right side lose on the way to the end of V."""
    material: NDArray[np.int32]
    """(N,) see `materials`."""
    normal: NDArray[np.float64]
    """(N, 3) unit vectors; a primitive is seen from the side to which U x V points."""
    look: NDArray[np.float64]
    """(N, 16) see LOOKS."""


def join(parts: Sequence[Primitives]) -> Primitives:
    """All primitives of `parts` in one."""
    return Primitives(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


class Mesh:
    """A growing list of primitives."""

    def __init__(self) -> None:
        self._rows: list[tuple[Vector, int, tuple[float, float], int, Vector, Vector]] = []

    def __len__(self) -> int:
        return len(self._rows)

    def quad(
        self,
        corner: ArrayLike,
        along: ArrayLike,
        up: ArrayLike,
        material: int,
        look: Iterable[float],
        taper: tuple[float, float] = (0.0, 0.0),
        shape: int = QUAD,
    ) -> None:
        """A parallelogram, seen from the side to which along x up points."""
        o, u, v = (np.asarray(value, float) for value in (corner, along, up))
        normal = np.cross(u, v)
        length = float(np.linalg.norm(normal))
        self._add(np.concatenate([o, u, v]), shape, taper, material, normal / max(length, 1e-12), look)

    def sphere(self, centre: ArrayLike, radius: float, material: int, look: Iterable[float]) -> None:
        """A ball."""
        frame = np.concatenate([np.asarray(centre, float), [radius, 0, 0, 0, 0, 0]])
        self._add(frame, SPHERE, (0.0, 0.0), material, np.array([0.0, 0.0, 1.0]), look)

    def box(
        self,
        centre: ArrayLike,
        half: tuple[float, float],
        height: float,
        angle: float,
        material: int,
        look: Iterable[float],
        top: int | None = None,
    ) -> None:
        """Four upright walls around `centre` (x, y, z of the floor) and, if `top` is given, a lid of it."""
        look = tuple(look)
        corners = box_corners(centre, half, angle)
        for k in range(4):
            self.quad(corners[k], corners[(k + 1) % 4] - corners[k], (0, 0, height), material, look)
        if top is not None:
            lid = corners[0] + up(height)
            self.quad(lid, corners[1] - corners[0], corners[3] - corners[0], top, look)

    def primitives(self) -> Primitives:
        """What was collected, as arrays."""
        if not self._rows:
            return Primitives(*(np.empty((0, *s), t) for s, t in _FIELDS))
        columns = zip(*self._rows, strict=True)
        return Primitives(*(np.array(c, t) for c, (_, t) in zip(columns, _FIELDS, strict=True)))

    def _add(
        self,
        frame: Vector,
        shape: int,
        taper: tuple[float, float],
        material: int,
        normal: Vector,
        look: Iterable[float],
    ) -> None:
        looks = np.zeros(LOOKS)
        values = tuple(look)
        looks[: len(values)] = values
        self._rows.append((frame, shape, taper, material, normal, looks))


_FIELDS = (((9,), float), ((), np.int32), ((2,), float), ((), np.int32), ((3,), float), ((LOOKS,), float))


def up(metres: float) -> Vector:
    """The upright vector of that length."""
    return np.array([0.0, 0.0, metres])


def box_corners(centre: ArrayLike, half: tuple[float, float], angle: float) -> Vector:
    """(4, 3) floor corners of a turned box, counter-clockwise from back right."""
    c, s = math.cos(angle), math.sin(angle)
    ahead = np.array([c, s, 0.0]) * half[0]
    left = np.array([-s, c, 0.0]) * half[1]
    o = np.asarray(centre, float)
    return np.array([o - ahead - left, o + ahead - left, o + ahead + left, o - ahead + left])


def placed(parts: Primitives, position: ArrayLike, angle: float) -> Primitives:
    """`parts`, built at the origin facing +x, moved to `position` and turned by `angle` about z."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    turned = np.concatenate([parts.frame.reshape(-1, 3), parts.normal]) @ turn.T
    frame, normal = turned[: -len(parts.normal)].reshape(-1, 9), turned[-len(parts.normal) :]
    frame[:, 0:3] += position
    balls = parts.shape == SPHERE
    frame[balls, 3:6] = parts.frame[balls, 3:6]
    return parts._replace(frame=frame, normal=normal)
