"""Which primitive is seen at each of 2 x 2 samples a pixel.

A point O + s U + t V of a parallelogram lands on the image where s / z, t / z and 1 / z are linear in
the pixel: the inverse of the matrix (U V O). So there is no clipping: each row's span follows from the
four edges, and a z-buffer of 1 / z decides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.jit import compiled
from evplace_lab.city.mesh import QUAD, SPHERE, Primitives

NEAR_M = 0.15
FAR_M = 350.0
SMALLEST = 0.02
"""What spans fewer samples is left out."""

Vec = tuple[float, float, float]
Box = tuple[float, float, float, float]
"""First and last column, first and last row."""
NOWHERE = (1e9, -1e9, 1e9, -1e9)


class View(NamedTuple):
    """A pinhole camera."""

    position: Vec
    """World metres."""
    right: Vec
    down: Vec
    forward: Vec
    """Unit vectors in the world."""
    focal: float
    """Focal length in pixels."""
    width: int
    height: int


class Buffers(NamedTuple):
    """What the raster leaves behind."""

    nearness: NDArray[np.float32]
    """(2H, 2W) 1 / depth of each sample."""
    owner: NDArray[np.int32]
    """(2H, 2W) the primitive seen, -1 for sky."""
    planes: NDArray[np.float64]
    """(N, 9) s / z, t / z and 1 / z as linear functions of the sample position."""


@compiled
def sample_offset(row: int) -> float:
    """Samples of odd and even rows are staggered, which smooths upright edges."""
    return 0.25 if row % 2 == 0 else 0.75


@compiled
def draw(scene: Primitives, chosen: NDArray[np.int32], view: View, buffers: Buffers) -> None:
    """Fill `buffers` with the `chosen` primitives as `view` sees them."""
    buffers.nearness[:] = 1e-6
    buffers.owner[:] = -1
    for q in chosen:
        f = scene.frame[q]
        p = view.position
        o = _turned(view, (f[0] - p[0], f[1] - p[1], f[2] - p[2]))
        round_ = scene.shape[q] == SPHERE
        if round_:
            if not _ball_in_sight(o, f[3], view):
                continue
            o, u, v = _facing_square(o, f[3])
        else:
            u = _turned(view, (f[3], f[4], f[5]))
            v = _turned(view, (f[6], f[7], f[8]))
            lowest = o[2] + min(u[2], 0.0) + min(v[2], 0.0)
            highest = o[2] + max(u[2], 0.0) + max(v[2], 0.0)
            if highest < NEAR_M or lowest > FAR_M:
                continue
        x = _cross(v, o)
        determinant = u[0] * x[0] + u[1] * x[1] + u[2] * x[2]
        if abs(determinant) < 1e-9 or (determinant > 0.0 and not round_):
            continue  # edge on, or seen from behind
        box = _bounds(o, u, v, view)
        if box[0] > box[1]:
            continue
        a = _in_samples(x, determinant, view)
        b = _in_samples(_cross(o, u), determinant, view)
        c = _in_samples(_cross(u, v), determinant, view)
        for k in range(3):
            buffers.planes[q, k] = a[k]
            buffers.planes[q, 3 + k] = b[k]
            buffers.planes[q, 6 + k] = c[k]
        taper = (scene.taper[q, 0], scene.taper[q, 1])
        full = scene.shape[q] == QUAD
        _fill(q, (a, b, c), box, taper, full, view, buffers.nearness, buffers.owner)


@compiled
def _turned(view: View, v: Vec) -> Vec:
    """A vector of the world in camera coordinates."""
    r, d, f = view.right, view.down, view.forward
    return (
        r[0] * v[0] + r[1] * v[1] + r[2] * v[2],
        d[0] * v[0] + d[1] * v[1] + d[2] * v[2],
        f[0] * v[0] + f[1] * v[1] + f[2] * v[2],
    )


@compiled
def _cross(a: Vec, b: Vec) -> Vec:
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled
def _ball_in_sight(o: Vec, radius: float, view: View) -> bool:
    if o[2] < radius + NEAR_M or o[2] > FAR_M:
        return False
    return abs(o[0]) - 1.5 * radius <= o[2] * (view.width / (2.0 * view.focal)) * 1.05


@compiled
def _facing_square(o: Vec, radius: float) -> tuple[Vec, Vec, Vec]:
    """A sphere is drawn as the square that faces the camera, with a disc cut out of it: O, U, V of it."""
    distance = math.sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2])
    x, y, z = o[0] / distance, o[1] / distance, o[2] / distance
    k = 2.0 * radius / math.sqrt(x * x + z * z)
    u = (z * k, 0.0, -x * k)
    v = (-x * y * k, (z * z + x * x) * k, -y * z * k)
    corner = (
        o[0] - 0.5 * (u[0] + v[0]),
        o[1] - 0.5 * (u[1] + v[1]),
        o[2] - 0.5 * (u[2] + v[2]),
    )
    return corner, u, v


@compiled
def _in_samples(row: Vec, determinant: float, view: View) -> Vec:
    """A row of the inverse as a linear function of the sample column and row (two samples a pixel)."""
    per_sample = 1.0 / (2.0 * view.focal * determinant)
    x, y = row[0] * per_sample, row[1] * per_sample
    return (x, y, row[2] / determinant - view.width * x - view.height * y)


@compiled
def _bounds(o: Vec, u: Vec, v: Vec, view: View) -> Box:
    """The samples that the four corners span, cut at the near plane; NOWHERE if none is on the image."""
    uv = (o[0] + u[0] + v[0], o[1] + u[1] + v[1], o[2] + u[2] + v[2])
    u = (o[0] + u[0], o[1] + u[1], o[2] + u[2])
    v = (o[0] + v[0], o[1] + v[1], o[2] + v[2])
    box = _edge(_edge(_edge(_edge(NOWHERE, o, u), u, uv), uv, v), v, o)
    scale = 2.0 * view.focal
    x0, x1 = box[0] * scale + view.width, box[1] * scale + view.width
    y0, y1 = box[2] * scale + view.height, box[3] * scale + view.height
    outside = x1 < 0 or y1 < 0 or x0 > 2 * view.width or y0 > 2 * view.height
    if outside or x1 - x0 < SMALLEST or y1 - y0 < SMALLEST:
        return NOWHERE
    return (x0, x1, y0, y1)


@compiled
def _edge(box: Box, a: Vec, b: Vec) -> Box:
    """`box`, in units of the focal length, grown by the start of an edge and by where it is cut."""
    if a[2] >= NEAR_M:
        box = _grown(box, a[0] / a[2], a[1] / a[2])
    if (a[2] >= NEAR_M) != (b[2] >= NEAR_M):
        t = (NEAR_M - a[2]) / (b[2] - a[2])
        box = _grown(box, (a[0] + t * (b[0] - a[0])) / NEAR_M, (a[1] + t * (b[1] - a[1])) / NEAR_M)
    return box


@compiled
def _grown(box: Box, x: float, y: float) -> Box:
    return (min(box[0], x), max(box[1], x), min(box[2], y), max(box[3], y))


@compiled
def _fill(
    q: int,
    plane: tuple[Vec, Vec, Vec],
    box: Box,
    taper: tuple[float, float],
    full: bool,
    view: View,
    nearness: NDArray[np.float32],
    owner: NDArray[np.int32],
) -> None:
    """Each row's span of one primitive; the nearest wins."""
    a, b, c = plane
    first = max(0, math.floor(box[2] - 0.5))
    last = min(2 * view.height - 1, math.ceil(box[3] + 0.5))
    left, right = max(0.0, box[0] - 1.0), min(2.0 * view.width - 1.0, box[1] + 1.0)
    for row in range(first, last + 1):
        offset = sample_offset(row)
        s = a[1] * (row + 0.5) + a[2] + a[0] * offset
        t = b[1] * (row + 0.5) + b[2] + b[0] * offset
        w = c[1] * (row + 0.5) + c[2] + c[0] * offset
        span = _cut((left, right), b[0], t)
        span = _cut(span, c[0] - b[0], w - t)
        span = _cut(span, a[0] - taper[0] * b[0], s - taper[0] * t)
        span = _cut(span, c[0] - a[0] - taper[1] * b[0], w - s - taper[1] * t)
        for x in range(math.ceil(span[0]), math.floor(span[1]) + 1):
            near = w + c[0] * x
            if np.float32(near) > nearness[row, x]:
                i = s + a[0] * x - 0.5 * near
                j = t + b[0] * x - 0.5 * near
                if full or i * i + j * j < 0.25 * near * near:
                    nearness[row, x] = np.float32(near)
                    owner[row, x] = q


@compiled
def _cut(span: tuple[float, float], slope: float, value: float) -> tuple[float, float]:
    """The part of a span where value + slope * x >= 0."""
    if slope > 1e-14:
        return (max(span[0], -value / slope), span[1])
    if slope < -1e-14:
        return (span[0], min(span[1], -value / slope))
    return span if value >= 0 else (0.0, -1.0)
