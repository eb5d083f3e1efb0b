"""From visible primitives to linear light: each primitive in a pixel is shaded once.

The loop keeps arrays to itself and hands on numbers: in compiled code a call with an array counts its
references, which would cost more than the shading.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city import materials
from evplace_lab.city.facades import facade
from evplace_lab.city.jit import compiled
from evplace_lab.city.light import (
    Light,
    Maps,
    lamps_on_facade,
    lamps_on_ground,
    own_headlights,
    sky,
    sunlight,
    through_air,
)
from evplace_lab.city.materials import (
    CAR_SIDE,
    FACADE,
    FENCE,
    GLASS,
    LAMP,
    LEAVES,
    PAVEMENT,
    ROAD,
    ROOF,
    SIGN,
    Look,
)
from evplace_lab.city.mesh import SPHERE, Primitives
from evplace_lab.city.raster import Buffers, View, sample_offset
from evplace_lab.city.texture import Colour, mix, plus, scale, smoothstep, times


class Frame(NamedTuple):
    """What the shading of one frame fills."""

    radiance: NDArray[np.float64]
    """(H, W, 3) linear light."""
    nearness: NDArray[np.float64]
    """(H, W) mean 1 / depth, 0 for the sky."""
    ground: NDArray[np.float64]
    """(H, W) share of the pixel that is road."""


class Spot(NamedTuple):
    """The point of a primitive that is seen at a sample position."""

    s: float
    t: float
    """Where on the parallelogram, 0 to 1."""
    fs: float
    ft: float
    """How much of s and t one pixel covers."""
    depth: float
    size: float
    """Metres that a pixel covers across the line of sight."""
    at: Colour
    """World position."""
    normal: Colour


Plane = tuple[float, float, float, float, float, float, float, float, float]


@compiled
def shade_frame(
    scene: Primitives, view: View, buffers: Buffers, light: Light, maps: Maps, frame: Frame
) -> None:
    """Every pixel as the mean of its four samples."""
    owners, planes, radiance = buffers.owner, buffers.planes, frame.radiance
    frames, shapes, kinds, normals, looks = scene.frame, scene.shape, scene.material, scene.normal, scene.look
    shadow, lamplight, lamps, near_lamps = maps.shadow, maps.lamplight, maps.lamps, maps.near_lamps
    for y in range(view.height):
        for x in range(view.width):
            four = (
                owners[2 * y, 2 * x],
                owners[2 * y, 2 * x + 1],
                owners[2 * y + 1, 2 * x],
                owners[2 * y + 1, 2 * x + 1],
            )
            total = (0.0, 0.0, 0.0)
            nearness, ground = 0.0, 0.0
            for k in range(4):
                q = four[k]
                count, column, row = _share(four, k, x, y)
                if count == 0:
                    continue
                if q < 0:
                    total = plus(total, scale(_background(column, row, view, light), 0.25 * count))
                    continue
                p, n, kind = planes[q], normals[q], kinds[q]
                plane = (p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8])
                spot = _spot(plane, (n[0], n[1], n[2]), shapes[q] == SPHERE, column, row, view)
                look = materials.look_of(looks, q)
                if kind == LEAVES:
                    f = frames[q]
                    centre, radius = (f[0], f[1], f[2]), f[3]
                    on_ball = plus(centre, scale(spot.normal, radius))
                    colour, shine = materials.leaves(look, on_ball, spot.size), (0.0, 0.0, 0.0)
                else:
                    colour, shine = _material(kind, look, spot, light)
                lit = _sky_light(kind, spot, light)
                soft = _softened(kind, spot.normal)
                lit = plus(lit, sunlight(spot.at, soft, kind == LEAVES, light, shadow, maps.origin))
                if light.night > 0.0:
                    if kind == FACADE:
                        lit = plus(lit, lamps_on_facade(q, spot.at, soft, light, near_lamps, lamps))
                    else:
                        lit = plus(lit, lamps_on_ground(spot.at, soft[2], light, lamplight, maps.origin))
                    lit = plus(lit, own_headlights(spot.at, soft, view.position, view.forward, light))
                colour = through_air(plus(times(colour, lit), shine), spot.depth, light)
                total = plus(total, scale(colour, 0.25 * count))
                nearness += 0.25 * count / spot.depth
                ground += 0.25 * count if kind == ROAD else 0.0
            radiance[y, x, 0], radiance[y, x, 1], radiance[y, x, 2] = total
            frame.nearness[y, x] = nearness
            frame.ground[y, x] = ground


@compiled
def _share(four: tuple[int, int, int, int], k: int, x: int, y: int) -> tuple[int, float, float]:
    """How many of a pixel's samples have the owner of sample k, and their mean position; none where an
    earlier sample stood for them.
    """
    count, column, row = 0, 0.0, 0.0
    for other in range(4):
        if four[other] == four[k]:
            if other < k:
                return 0, 0.0, 0.0
            count += 1
            row += 2 * y + other // 2 + 0.5
            column += 2 * x + other % 2 + sample_offset(other // 2)
    return count, column / count, row / count


@compiled
def _ray(x: float, y: float, z: float, view: View) -> Colour:
    """A vector of the camera (right, down, forward) in the world."""
    r, d, f = view.right, view.down, view.forward
    return (
        r[0] * x + d[0] * y + f[0] * z,
        r[1] * x + d[1] * y + f[1] * z,
        r[2] * x + d[2] * y + f[2] * z,
    )


@compiled
def _background(column: float, row: float, view: View, light: Light) -> Colour:
    """The sky at a sample position."""
    x = (column - view.width) / (2.0 * view.focal)
    y = (row - view.height) / (2.0 * view.focal)
    k = 1.0 / math.sqrt(x * x + y * y + 1.0)
    ray = _ray(x * k, y * k, k, view)
    return sky(ray[0], ray[1], ray[2], light)


@compiled
def _spot(m: Plane, normal: Colour, ball: bool, column: float, row: float, view: View) -> Spot:
    """What a primitive with plane `m` shows at a sample position."""
    w = max(m[6] * column + m[7] * row + m[8], 1e-6)
    s = (m[0] * column + m[1] * row + m[2]) / w
    t = (m[3] * column + m[4] * row + m[5]) / w
    fs = 2.0 * (abs(m[0] - s * m[6]) + abs(m[1] - s * m[7])) / w
    ft = 2.0 * (abs(m[3] - t * m[6]) + abs(m[4] - t * m[7])) / w
    x = (column - view.width) / (2.0 * view.focal)
    y = (row - view.height) / (2.0 * view.focal)
    depth = 1.0 / w
    at = plus(view.position, scale(_ray(x, y, 1.0, view), depth))
    s = min(max(s, 0.0), 1.0)
    t = min(max(t, 0.0), 1.0)
    if ball:
        u, v = 2.0 * s - 1.0, 2.0 * t - 1.0
        normal = _ray(u, v, -math.sqrt(max(1.0 - u * u - v * v, 0.0)), view)
    return Spot(s, t, fs, ft, depth, depth / view.focal, at, normal)


@compiled
def _material(kind: int, look: Look, spot: Spot, light: Light) -> tuple[Colour, Colour]:
    """Reflectance and own light, with snow on what faces the sky and dark where it is wet."""
    colour = materials.colour_of(look)
    shine = (0.0, 0.0, 0.0)
    if kind == ROAD:
        colour = materials.road(look, spot.s, spot.t, spot.fs, spot.ft, light.snow)
    elif kind == PAVEMENT:
        colour = materials.pavement(look, spot.s, spot.t, spot.fs, spot.ft, light.snow)
    elif kind == FACADE:
        colour, shine = facade(look, spot.s, spot.t, spot.fs, spot.ft, light)
    elif kind == CAR_SIDE:
        colour = materials.car_side(look, spot.s, spot.t, spot.fs, spot.ft)
    elif kind == LAMP:
        return materials.lamp(look, light)
    elif kind == SIGN:
        colour, shine = materials.sign(look, spot.s, spot.t, spot.fs, spot.ft, light)
    elif kind == FENCE:
        colour = materials.fence(look, spot.s, spot.fs, spot.at, spot.size)
    elif kind == ROOF:
        colour = materials.roof(look, spot.t, spot.ft)
    elif kind == GLASS:
        colour, shine = materials.glass(look, spot.s, spot.t, spot.fs, spot.ft, light)
    if kind in (ROAD, PAVEMENT):
        return scale(colour, 1.0 - 0.45 * light.wet), shine
    if light.snow > 0.0:
        colour = mix(colour, materials.WHITE, light.snow * smoothstep(0.2, 0.8, spot.normal[2]))
    return colour, shine


@compiled
def _sky_light(kind: int, spot: Spot, light: Light) -> Colour:
    """Light from all sides: less from below, less at the foot of a street of houses."""
    if kind == FACADE:
        return scale(light.ambient, 0.85)
    return scale(light.ambient, 0.81 + 0.19 * spot.normal[2])


@compiled
def _softened(kind: int, normal: Colour) -> Colour:
    """Leaves point every way: their normal is drawn upwards."""
    if kind == LEAVES:
        return (0.6 * normal[0], 0.6 * normal[1], 0.6 * normal[2] + 0.4)
    return normal
