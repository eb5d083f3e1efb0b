"""Leaving out what cannot be seen: still primitives in groups of neighbours, each with a sphere around."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.jit import compiled
from evplace_lab.city.mesh import SPHERE, Primitives
from evplace_lab.city.raster import (
    FAR_M,
    Buffers,
    View,
    clear,
    draw,
    find_owners,
    is_hidden,
    on_image,
    turned,
)

CELL_M = 12.0


class Groups(NamedTuple):
    """Neighbouring primitives, and as the last group those that move."""

    ball: NDArray[np.float64]
    """(G, 4) centre and radius of a sphere around each group."""
    start: NDArray[np.int32]
    """(G + 1,) where each group begins in `members`; the last group ends where a frame's primitives end."""
    members: NDArray[np.int32]
    """(N,) primitives, group by group."""


def group(parts: Primitives, moving: int = 0) -> Groups:
    """Primitives whose middles lie in one square of 12 m make a group; up to `moving` more, which come
    behind them, may be anywhere.
    """
    low, high = _extent(parts)
    cell = np.floor((low + high)[:, :2] / 2 / CELL_M).astype(np.int64)
    key = cell[:, 0] * 100_000 + cell[:, 1]
    order = np.argsort(key, kind="stable")
    _, start = np.unique(key[order], return_index=True)
    lowest = np.minimum.reduceat(low[order], start)
    highest = np.maximum.reduceat(high[order], start)
    radius = np.linalg.norm(highest - lowest, axis=1) / 2
    ball = np.column_stack([(lowest + highest) / 2, radius])
    count = len(order)
    members = np.append(order, np.arange(count, count + moving)).astype(np.int32)
    return Groups(
        np.append(ball, [[0.0, 0.0, 0.0, math.inf]], axis=0),
        np.append(start, [count, count]).astype(np.int32),
        members,
    )


def _extent(parts: Primitives) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 3) least and greatest coordinates of each primitive."""
    o, u, v = (parts.frame[:, k : k + 3] for k in (0, 3, 6))
    corners = np.stack([o, o + u, o + v, o + u + v])
    low, high = corners.min(0), corners.max(0)
    balls = parts.shape == SPHERE
    radius = parts.frame[balls, 3][:, None]
    low[balls], high[balls] = o[balls] - radius, o[balls] + radius
    return low, high


def draw_groups(scene: Primitives, groups: Groups, view: View, buffers: Buffers) -> None:
    """Fill `buffers` with what `view` sees: front to back, so that most is hidden when its turn comes."""
    clear(buffers)
    _draw_in_order(scene, groups, seen(groups, view), view, buffers)
    find_owners(buffers, groups.members)


def seen(groups: Groups, view: View) -> NDArray[np.int64]:
    """All groups whose sphere the view's left and right edges and its reach let in, those that end nearest
    first and what moves last.
    """
    ends = np.empty(len(groups.ball))
    _find_ends(groups, view, ends)
    found = np.flatnonzero(ends > -math.inf)
    return found[np.argsort(ends[found])]


@compiled
def _find_ends(groups: Groups, view: View, ends: NDArray[np.float64]) -> None:
    """How far ahead each group ends, -infinity where it is out of sight."""
    slope = 0.5 * view.width / view.focal
    edge = math.sqrt(1.0 + slope * slope)
    for g in range(len(groups.ball)):
        x, _, z, radius = _ball(groups.ball, g, view)
        out = z < -radius or z > FAR_M + radius or abs(x) - slope * z > radius * edge
        ends[g] = -math.inf if out else z + radius


@compiled
def _draw_in_order(
    scene: Primitives, groups: Groups, order: NDArray[np.int64], view: View, buffers: Buffers
) -> None:
    for g in order:
        if not _is_group_hidden(groups.ball, g, view, buffers):
            for k in range(groups.start[g], groups.start[g + 1]):
                draw(scene, groups.members[k], k, view, buffers)


@compiled
def _is_group_hidden(balls: NDArray[np.float64], g: int, view: View, buffers: Buffers) -> bool:
    """Whether all is hidden that may lie in a group's sphere, with room for rounding."""
    x, y, z, radius = _ball(balls, g, view)
    front = z - radius
    if front < 1.0:
        return False
    x0, x1 = _least_slope(x - radius, front, z + radius), -_least_slope(-x - radius, front, z + radius)
    y0, y1 = _least_slope(y - radius, front, z + radius), -_least_slope(-y - radius, front, z + radius)
    scale = 2.0 * view.focal
    box = on_image(
        x0 * scale + view.width - 2.0,
        x1 * scale + view.width + 2.0,
        y0 * scale + view.height - 2.0,
        y1 * scale + view.height + 2.0,
        view,
    )
    return is_hidden(box, 1.0001 / front, buffers)


@compiled
def _least_slope(x: float, front: float, back: float) -> float:
    """The least x / z for z between front and back."""
    return x / front if x < 0.0 else x / back


@compiled
def _ball(balls: NDArray[np.float64], g: int, view: View) -> tuple[float, float, float, float]:
    """Centre and radius of a sphere in camera coordinates."""
    p = view.position
    x, y, z = turned(view, (balls[g, 0] - p[0], balls[g, 1] - p[1], balls[g, 2] - p[2]))
    return x, y, z, balls[g, 3]
