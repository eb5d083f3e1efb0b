"""Leaving out what cannot be seen: still primitives in groups of neighbours, each with a sphere around."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.jit import compiled
from evplace_lab.city.mesh import SPHERE, Primitives
from evplace_lab.city.raster import FAR_M, View

CELL_M = 12.0


class Groups(NamedTuple):
    """Neighbouring primitives."""

    ball: NDArray[np.float64]
    """(G, 4) centre and radius of a sphere around each group."""
    start: NDArray[np.int32]
    """(G + 1,) where each group begins in `members`."""
    members: NDArray[np.int32]
    """(N,) primitives, group by group."""


def group(parts: Primitives) -> Groups:
    """Primitives whose middles lie in one square of 12 m make a group."""
    low, high = _extent(parts)
    cell = np.floor((low + high)[:, :2] / 2 / CELL_M).astype(np.int64)
    key = cell[:, 0] * 100_000 + cell[:, 1]
    members = np.argsort(key, kind="stable").astype(np.int32)
    start = np.flatnonzero(np.diff(key[members], prepend=key[members[0]] - 1))
    lowest = np.minimum.reduceat(low[members], start)
    highest = np.maximum.reduceat(high[members], start)
    radius = np.linalg.norm(highest - lowest, axis=1) / 2
    ball = np.column_stack([(lowest + highest) / 2, radius])
    return Groups(ball, np.append(start, len(members)).astype(np.int32), members)


def _extent(parts: Primitives) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(N, 3) least and greatest coordinates of each primitive."""
    o, u, v = (parts.frame[:, k : k + 3] for k in (0, 3, 6))
    corners = np.stack([o, o + u, o + v, o + u + v])
    low, high = corners.min(0), corners.max(0)
    balls = parts.shape == SPHERE
    radius = parts.frame[balls, 3][:, None]
    low[balls], high[balls] = o[balls] - radius, o[balls] + radius
    return low, high


@compiled
def seen(groups: Groups, view: View) -> NDArray[np.int32]:
    """The primitives of all groups whose sphere the view's left and right edgesand its reach let in."""
    out = np.empty(len(groups.members), np.int32)
    count = 0
    slope = 0.5 * view.width / view.focal
    edge = math.sqrt(1.0 + slope * slope)
    r, f, p = view.right, view.forward, view.position
    for g in range(len(groups.ball)):
        x, y, z = groups.ball[g, 0] - p[0], groups.ball[g, 1] - p[1], groups.ball[g, 2] - p[2]
        radius = groups.ball[g, 3]
        ahead = f[0] * x + f[1] * y + f[2] * z
        beside = abs(r[0] * x + r[1] * y + r[2] * z)
        if ahead < -radius or ahead > FAR_M + radius or beside - slope * ahead > radius * edge:
            continue
        for k in range(groups.start[g], groups.start[g + 1]):
            out[count] = groups.members[k]
            count += 1
    return out[:count]
