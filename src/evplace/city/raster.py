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

from evplace.city.jit import compiled
from evplace.city.mesh import QUAD, SPHERE, Primitives

NEAR_M = 0.15
FAR_M = 350.0


class View(NamedTuple):
    """A pinhole camera."""

    position: NDArray[np.float64]
    """(3,) world metres."""
    axes: NDArray[np.float64]
    """(3, 3) rows: right, down, forward, unit vectors in the world."""
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
def draw(scene: Primitives, count: int, view: View, buffers: Buffers) -> None:
    """Fill `buffers` with the first `count` primitives as `view` sees them."""
    buffers.nearness[:] = 1e-6
    buffers.owner[:] = -1
    corners = np.empty((3, 3))
    box = np.empty(4)
    for q in range(count):
        if not _in_camera(scene, q, view, corners):
            continue
        if not _plane(corners, scene.shape[q] != SPHERE, view, buffers.planes[q]):
            continue
        if _bounds(corners, view, box):
            _fill(scene, q, view, box, buffers)


@compiled
def _in_camera(scene: Primitives, q: int, view: View, corners: NDArray[np.float64]) -> bool:
    """O, U, V in camera coordinates; False where the primitive is out of reach."""
    frame = scene.frame
    axes = view.axes
    for k in range(3):
        a = frame[q, 3 * k]
        b = frame[q, 3 * k + 1]
        c = frame[q, 3 * k + 2]
        if k == 0:
            a -= view.position[0]
            b -= view.position[1]
            c -= view.position[2]
        for r in range(3):
            corners[k, r] = axes[r, 0] * a + axes[r, 1] * b + axes[r, 2] * c
        if k == 0 and scene.shape[q] == SPHERE:
            return _face_sphere(frame[q, 3], view, corners)
        if k == 0 and corners[0, 2] > FAR_M + 100.0:
            return False
    lift = min(corners[1, 2], 0.0) + min(corners[2, 2], 0.0)
    rise = max(corners[1, 2], 0.0) + max(corners[2, 2], 0.0)
    return corners[0, 2] + rise >= NEAR_M and corners[0, 2] + lift <= FAR_M


@compiled
def _face_sphere(radius: float, view: View, corners: NDArray[np.float64]) -> bool:
    """A sphere is drawn as the square that faces the camera, with a disc cut out of it."""
    x, y, z = corners[0, 0], corners[0, 1], corners[0, 2]
    if z < radius + NEAR_M or z > FAR_M:
        return False
    if abs(x) - 1.5 * radius > z * (view.width / (2.0 * view.focal)) * 1.05:
        return False
    distance = math.sqrt(x * x + y * y + z * z)
    dx, dy, dz = x / distance, y / distance, z / distance
    k = 1.0 / math.sqrt(dx * dx + dz * dz)
    right_x, right_z = dz * k, -dx * k
    corners[1, 0], corners[1, 1], corners[1, 2] = 2 * radius * right_x, 0.0, 2 * radius * right_z
    corners[2, 0] = 2 * radius * dy * right_z
    corners[2, 1] = 2 * radius * (dz * right_x - dx * right_z)
    corners[2, 2] = -2 * radius * dy * right_x
    for r in range(3):
        corners[0, r] -= 0.5 * (corners[1, r] + corners[2, r])
    return True


@compiled
def _plane(
    corners: NDArray[np.float64], one_sided: bool, view: View, plane: NDArray[np.float64]
) -> bool:
    """The rows of the inverse of (U V O), in sample coordinates; False if seen from behind or edge on."""
    o0, o1, o2 = corners[0, 0], corners[0, 1], corners[0, 2]
    u0, u1, u2 = corners[1, 0], corners[1, 1], corners[1, 2]
    v0, v1, v2 = corners[2, 0], corners[2, 1], corners[2, 2]
    a0, a1, a2 = v1 * o2 - v2 * o1, v2 * o0 - v0 * o2, v0 * o1 - v1 * o0
    determinant = u0 * a0 + u1 * a1 + u2 * a2
    if abs(determinant) < 1e-9 or (one_sided and determinant > 0.0):
        return False
    b0, b1, b2 = o1 * u2 - o2 * u1, o2 * u0 - o0 * u2, o0 * u1 - o1 * u0
    c0, c1, c2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    _to_samples(a0, a1, a2, determinant, view, plane, 0)
    _to_samples(b0, b1, b2, determinant, view, plane, 3)
    _to_samples(c0, c1, c2, determinant, view, plane, 6)
    return True


@compiled
def _to_samples(
    x: float, y: float, one: float, determinant: float, view: View, plane: NDArray[np.float64], at: int
) -> None:
    """A row of the inverse as a linear function of the sample column and row (two samples a pixel)."""
    per_sample = 1.0 / (2.0 * view.focal * determinant)
    plane[at] = x * per_sample
    plane[at + 1] = y * per_sample
    plane[at + 2] = one / determinant - view.width * plane[at] - view.height * plane[at + 1]


@compiled
def _bounds(corners: NDArray[np.float64], view: View, box: NDArray[np.float64]) -> bool:
    """The samples that the four corners span, cut at the near plane; False if none is on the image."""
    box[0], box[1], box[2], box[3] = 1e9, -1e9, 1e9, -1e9
    for k in range(4):
        x, y, z = _corner(corners, k)
        x2, y2, z2 = _corner(corners, (k + 1) % 4)
        if z >= NEAR_M:
            _grow(box, x / z, y / z, view)
        if (z >= NEAR_M) != (z2 >= NEAR_M):
            t = (NEAR_M - z) / (z2 - z)
            _grow(box, (x + t * (x2 - x)) / NEAR_M, (y + t * (y2 - y)) / NEAR_M, view)
    if box[1] < 0 or box[3] < 0 or box[0] > 2 * view.width or box[2] > 2 * view.height:
        return False
    return box[1] - box[0] >= 0.02 and box[3] - box[2] >= 0.02


@compiled
def _corner(corners: NDArray[np.float64], k: int) -> tuple[float, float, float]:
    u = 1.0 if k == 1 or k == 2 else 0.0
    v = 1.0 if k >= 2 else 0.0
    return (
        corners[0, 0] + u * corners[1, 0] + v * corners[2, 0],
        corners[0, 1] + u * corners[1, 1] + v * corners[2, 1],
        corners[0, 2] + u * corners[1, 2] + v * corners[2, 2],
    )


@compiled
def _grow(box: NDArray[np.float64], x: float, y: float, view: View) -> None:
    column = x * 2.0 * view.focal + view.width
    row = y * 2.0 * view.focal + view.height
    box[0] = min(box[0], column)
    box[1] = max(box[1], column)
    box[2] = min(box[2], row)
    box[3] = max(box[3], row)


@compiled
def _fill(scene: Primitives, q: int, view: View, box: NDArray[np.float64], buffers: Buffers) -> None:
    """Each row's span of one primitive, nearest wins."""
    plane = buffers.planes[q]
    first = max(0, int(math.floor(box[2] - 0.5)))
    last = min(2 * view.height - 1, int(math.ceil(box[3] + 0.5)))
    left = max(0.0, box[0] - 1.0)
    right = min(2.0 * view.width - 1.0, box[1] + 1.0)
    k0, k1 = scene.taper[q, 0], scene.taper[q, 1]
    full = scene.shape[q] == QUAD
    for row in range(first, last + 1):
        offset = sample_offset(row)
        a = plane[1] * (row + 0.5) + plane[2] + plane[0] * offset
        b = plane[4] * (row + 0.5) + plane[5] + plane[3] * offset
        c = plane[7] * (row + 0.5) + plane[8] + plane[6] * offset
        lo, hi = _cut(left, right, plane[3], b)
        lo, hi = _cut(lo, hi, plane[6] - plane[3], c - b)
        lo, hi = _cut(lo, hi, plane[0] - k0 * plane[3], a - k0 * b)
        lo, hi = _cut(lo, hi, plane[6] - plane[0] - k1 * plane[3], c - a - k1 * b)
        if hi >= lo:
            _span(row, lo, hi, q, plane, a, b, c, full, buffers)


@compiled
def _cut(lo: float, hi: float, slope: float, value: float) -> tuple[float, float]:
    """The part of [lo, hi] where value + slope * x >= 0."""
    if slope > 1e-14:
        lo = max(lo, -value / slope)
    elif slope < -1e-14:
        hi = min(hi, -value / slope)
    elif value < 0:
        hi = -1.0
    return lo, hi


@compiled
def _span(
    row: int,
    lo: float,
    hi: float,
    q: int,
    plane: NDArray[np.float64],
    a: float,
    b: float,
    c: float,
    full: bool,
    buffers: Buffers,
) -> None:
    nearness = buffers.nearness
    for x in range(int(math.ceil(lo)), int(math.floor(hi)) + 1):
        w = c + plane[6] * x
        if np.float32(w) > nearness[row, x]:
            u = a + plane[0] * x - 0.5 * w
            v = b + plane[3] * x - 0.5 * w
            if full or u * u + v * v < 0.25 * w * w:
                nearness[row, x] = np.float32(w)
                buffers.owner[row, x] = q
