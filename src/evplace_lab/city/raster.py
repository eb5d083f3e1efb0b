"""Which primitive is seen at each of 2 x 2 samples a pixel.

A point O + s U + t V of a parallelogram lands on the image where s / z, t / z and 1 / z are linear in
the pixel: the inverse of the matrix (U V O). So there is no clipping: each row's span follows from the
four edges, and a z-buffer of 1 / z decides. The order in which primitives are drawn makes no difference,
and what lies behind all that was drawn where it would lie is left out.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Size
from evplace_lab.city.jit import compiled
from evplace_lab.city.mesh import QUAD, SPHERE, Primitives

NEAR_M = 0.15
FAR_M = 350.0
SMALLEST = 0.02
"""What spans fewer samples is left out."""
SKY = 1e-6
"""The nearness of the sky."""
LAST = (1 << 31) - 1
"""The rank of the sky."""
TILE = 8
"""Samples along a side of the squares of which the farthest sample is known."""

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

    front: NDArray[np.int64]
    """(2H, 2W) what is seen at each sample, see `_key`."""
    least: NDArray[np.int64]
    """(2H / TILE, 2W / TILE) no sample of a tile has a smaller key."""
    owner: NDArray[np.int32]
    """(2H, 2W) the primitive seen, -1 for sky."""
    planes: NDArray[np.float64]
    """(N, 9) s / z, t / z and 1 / z as linear functions of the sample position."""

    @classmethod
    def of(cls, size: Size, count: int) -> Buffers:
        """For images of `size` (width, height) and up to `count` primitives."""
        columns, rows = (2 * length for length in size)
        tiles = (-(-rows // TILE), -(-columns // TILE))
        return cls(
            np.empty((rows, columns), np.int64),
            np.empty(tiles, np.int64),
            np.empty((rows, columns), np.int32),
            np.empty((count, 9)),
        )


@compiled
def sample_offset(row: int) -> float:
    """Samples of odd and even rows are staggered, which smooths upright edges."""
    return 0.25 if row % 2 == 0 else 0.75


@compiled
def _key(near: float, rank: int) -> int:
    """A number that is larger for what is nearer, and of what is as near for what has the lower rank: the
    bits of a float above the rank. Samples are worked out side by side, since one `max` of keys decides.
    """
    return int(np.float32(near).view(np.int32)) << 32 | (LAST - rank)


@compiled
def clear(buffers: Buffers) -> None:
    """Nothing but sky."""
    buffers.front[:] = _key(SKY, LAST)
    buffers.least[:] = _key(SKY, LAST)


@compiled
def find_owners(buffers: Buffers, members: NDArray[np.int32]) -> None:
    """Which primitive is seen at each sample; `members` gives that of each rank."""
    for row in range(buffers.front.shape[0]):
        for x in range(buffers.front.shape[1]):
            rank = LAST - (buffers.front[row, x] & LAST)
            buffers.owner[row, x] = -1 if rank == LAST else members[rank]


@compiled
def draw(scene: Primitives, q: int, rank: int, view: View, buffers: Buffers) -> None:
    """Add primitive `q` to `buffers` as `view` sees it; of two that are as near, the lower rank wins."""
    f = scene.frame[q]
    p = view.position
    o = turned(view, (f[0] - p[0], f[1] - p[1], f[2] - p[2]))
    round_ = scene.shape[q] == SPHERE
    if round_:
        if not _ball_in_sight(o, f[3], view):
            return
        o, u, v = _facing_square(o, f[3])
    else:
        u = turned(view, (f[3], f[4], f[5]))
        v = turned(view, (f[6], f[7], f[8]))
        lowest = o[2] + min(u[2], 0.0) + min(v[2], 0.0)
        highest = o[2] + max(u[2], 0.0) + max(v[2], 0.0)
        if highest < NEAR_M or lowest > FAR_M:
            return
    x = _cross(v, o)
    determinant = u[0] * x[0] + u[1] * x[1] + u[2] * x[2]
    if abs(determinant) < 1e-9 or (determinant > 0.0 and not round_):
        return  # edge on, or seen from behind
    box = _bounds(o, u, v, view)
    if box[0] > box[1]:
        return
    c = _in_samples(_cross(u, v), determinant, view)
    if is_hidden(box, _nearest(c, box), buffers):
        return
    a = _in_samples(x, determinant, view)
    b = _in_samples(_cross(o, u), determinant, view)
    for k in range(3):
        buffers.planes[q, k] = a[k]
        buffers.planes[q, 3 + k] = b[k]
        buffers.planes[q, 6 + k] = c[k]
    taper = (scene.taper[q, 0], scene.taper[q, 1])
    full = scene.shape[q] == QUAD
    _fill(rank, (a, b, c), box, taper, full, buffers.front)


@compiled
def is_hidden(box: Box, near: float, buffers: Buffers) -> bool:
    """Whether all samples in `box` are nearer than `near`."""
    key = _key(near, 0)
    for j in range(int(box[2]) // TILE, int(box[3]) // TILE + 1):
        for i in range(int(box[0]) // TILE, int(box[1]) // TILE + 1):
            if buffers.least[j, i] <= key:
                rows, columns = slice(j * TILE, (j + 1) * TILE), slice(i * TILE, (i + 1) * TILE)
                buffers.least[j, i] = _least(buffers.front[rows, columns])
                if buffers.least[j, i] <= key:
                    return False
    return True


@compiled
def _least(tile: NDArray[np.int64]) -> int:
    least = int(tile[0, 0])
    for y in range(tile.shape[0]):
        for x in range(tile.shape[1]):
            least = min(least, int(tile[y, x]))
    return least


@compiled
def _nearest(c: Vec, box: Box) -> float:
    """The largest nearness of a plane on whole samples of `box`, rounded as `_fill` rounds it."""
    row = box[3] if c[1] > 0.0 else box[2]
    offset, x = (0.75, box[1]) if c[0] > 0.0 else (0.25, box[0])
    return c[1] * (row + 0.5) + c[2] + c[0] * offset + c[0] * x


@compiled
def turned(view: View, v: Vec) -> Vec:
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
    """The samples that the four corners may span, cut at the near plane; NOWHERE if none is on the image."""
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
    return on_image(x0 - 1.0, x1 + 1.0, math.floor(y0 - 0.5), math.ceil(y1 + 0.5), view)


@compiled
def on_image(x0: float, x1: float, y0: float, y1: float, view: View) -> Box:
    """The part of a box that lies on the image."""
    right, bottom = 2.0 * view.width - 1.0, 2.0 * view.height - 1.0
    return (max(0.0, x0), min(right, x1), max(0.0, y0), min(bottom, y1))


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
    rank: int,
    plane: tuple[Vec, Vec, Vec],
    box: Box,
    taper: tuple[float, float],
    full: bool,
    front: NDArray[np.int64],
) -> None:
    """Each row's span of one primitive; the nearest wins."""
    a, b, c = plane
    for row in range(int(box[2]), int(box[3]) + 1):
        offset = sample_offset(row)
        s = a[1] * (row + 0.5) + a[2] + a[0] * offset
        t = b[1] * (row + 0.5) + b[2] + b[0] * offset
        w = c[1] * (row + 0.5) + c[2] + c[0] * offset
        span = _cut((box[0], box[1]), b[0], t)
        span = _cut(span, c[0] - b[0], w - t)
        span = _cut(span, a[0] - taper[0] * b[0], s - taper[0] * t)
        span = _cut(span, c[0] - a[0] - taper[1] * b[0], w - s - taper[1] * t)
        first = math.ceil(span[0])
        line = front[row, first : max(math.floor(span[1]) + 1, first)]
        for k in range(len(line)):
            near = w + c[0] * (first + k)
            i = s + a[0] * (first + k) - 0.5 * near
            j = t + b[0] * (first + k) - 0.5 * near
            if full or i * i + j * j < 0.25 * near * near:
                line[k] = max(line[k], _key(near, rank))


@compiled
def _cut(span: tuple[float, float], slope: float, value: float) -> tuple[float, float]:
    """The part of a span where value + slope * x >= 0."""
    if slope > 1e-14:
        return (max(span[0], -value / slope), span[1])
    if slope < -1e-14:
        return (span[0], min(span[1], -value / slope))
    return span if value >= 0 else (0.0, -1.0)
