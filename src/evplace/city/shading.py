"""From visible primitives to linear light: each primitive in a pixel is shaded once."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.city import materials
from evplace.city.facades import facade
from evplace.city.jit import compiled
from evplace.city.light import (
    Light,
    Maps,
    lamps_on_facade,
    lamps_on_ground,
    own_headlights,
    sky,
    sunlight,
    through_air,
)
from evplace.city.materials import CAR_SIDE, FACADE, FENCE, GLASS, LAMP, LEAVES, PAVEMENT, ROAD, ROOF, SIGN
from evplace.city.mesh import SPHERE, Primitives
from evplace.city.raster import Buffers, View, sample_offset
from evplace.city.texture import Colour, mix, plus, scale, smoothstep, times


class Frame(NamedTuple):
    """What the shading of one frame fills."""

    radiance: NDArray[np.float64]
    """(H, W, 3) linear light."""
    nearness: NDArray[np.float64]
    """(H, W) mean 1 / depth, 0 for the sky."""
    ground: NDArray[np.float64]
    """(H, W) share of the pixel that is road."""


@compiled
def shade_frame(scene: Primitives, view: View, buffers: Buffers, light: Light, maps: Maps, frame: Frame) -> None:
    """Every pixel as the mean of its four samples."""
    owners = np.empty(4, np.int32)
    for y in range(view.height):
        for x in range(view.width):
            for k in range(4):
                owners[k] = buffers.owner[2 * y + k // 2, 2 * x + k % 2]
            colour, nearness, ground = _pixel(scene, view, buffers, light, maps, owners, x, y)
            frame.radiance[y, x, 0] = colour[0]
            frame.radiance[y, x, 1] = colour[1]
            frame.radiance[y, x, 2] = colour[2]
            frame.nearness[y, x] = nearness
            frame.ground[y, x] = ground


@compiled
def _pixel(
    scene: Primitives,
    view: View,
    buffers: Buffers,
    light: Light,
    maps: Maps,
    owners: NDArray[np.int32],
    x: int,
    y: int,
) -> tuple[Colour, float, float]:
    """Colour, 1 / depth and share of road of one pixel."""
    colour = (0.0, 0.0, 0.0)
    nearness = 0.0
    ground = 0.0
    done = 0
    for k in range(4):
        if done & (1 << k):
            continue
        count = 0
        column = 0.0
        row = 0.0
        for other in range(k, 4):
            if owners[other] == owners[k]:
                done |= 1 << other
                count += 1
                row += 2 * y + other // 2 + 0.5
                column += 2 * x + other % 2 + sample_offset(other // 2)
        q = owners[k]
        part, w = _shade(scene, q, column / count, row / count, view, buffers, light, maps)
        colour = plus(colour, scale(part, 0.25 * count))
        nearness += 0.25 * count * w
        if q >= 0 and scene.material[q] == ROAD:
            ground += 0.25 * count
    return colour, nearness, ground


@compiled
def _shade(
    scene: Primitives,
    q: int,
    column: float,
    row: float,
    view: View,
    buffers: Buffers,
    light: Light,
    maps: Maps,
) -> tuple[Colour, float]:
    """Radiance and 1 / depth of primitive `q` (-1: sky) at a sample position."""
    a = view.axes
    x = (column - view.width) / (2.0 * view.focal)
    y = (row - view.height) / (2.0 * view.focal)
    ray = (
        a[0, 0] * x + a[1, 0] * y + a[2, 0],
        a[0, 1] * x + a[1, 1] * y + a[2, 1],
        a[0, 2] * x + a[1, 2] * y + a[2, 2],
    )
    if q < 0:
        k = 1.0 / math.sqrt(x * x + y * y + 1.0)
        return sky(ray[0] * k, ray[1] * k, ray[2] * k, light), 0.0
    m = buffers.planes[q]
    w = max(m[6] * column + m[7] * row + m[8], 1e-6)
    s = (m[0] * column + m[1] * row + m[2]) / w
    t = (m[3] * column + m[4] * row + m[5]) / w
    fs = 2.0 * (abs(m[0] - s * m[6]) + abs(m[1] - s * m[7])) / w
    ft = 2.0 * (abs(m[3] - t * m[6]) + abs(m[4] - t * m[7])) / w
    depth = 1.0 / w
    at = plus((view.position[0], view.position[1], view.position[2]), scale(ray, depth))
    footprint = depth / view.focal
    s = min(max(s, 0.0), 1.0)
    t = min(max(t, 0.0), 1.0)
    normal = (scene.normal[q, 0], scene.normal[q, 1], scene.normal[q, 2])
    if scene.shape[q] == SPHERE:
        normal = _sphere_normal(2 * s - 1, 2 * t - 1, view)
    colour, shine = _material(scene, q, s, t, fs, ft, at, normal, footprint, light)
    lit = _lighting(scene.material[q], q, at, normal, view, light, maps)
    return through_air(plus(times(colour, lit), shine), depth, light), w


@compiled
def _sphere_normal(u: float, v: float, view: View) -> Colour:
    """The normal at a point of the disc that stands for a sphere, about upright for soft foliage."""
    a = view.axes
    towards = math.sqrt(max(1.0 - u * u - v * v, 0.0))
    return (
        a[0, 0] * u + a[1, 0] * v - a[2, 0] * towards,
        a[0, 1] * u + a[1, 1] * v - a[2, 1] * towards,
        a[0, 2] * u + a[1, 2] * v - a[2, 2] * towards,
    )


@compiled
def _material(
    scene: Primitives,
    q: int,
    s: float,
    t: float,
    fs: float,
    ft: float,
    at: Colour,
    normal: Colour,
    footprint: float,
    light: Light,
) -> tuple[Colour, Colour]:
    """Reflectance and own light, with snow on what faces the sky and dark where it is wet."""
    looks = scene.look
    kind = scene.material[q]
    colour = materials.colour_of(looks, q)
    shine = (0.0, 0.0, 0.0)
    if kind == ROAD:
        colour = materials.road(looks, q, s, t, fs, ft, light.snow)
    elif kind == PAVEMENT:
        colour = materials.pavement(looks, q, s, t, fs, ft, light.snow)
    elif kind == FACADE:
        colour, shine = facade(looks, q, s, t, fs, ft, light)
    elif kind == CAR_SIDE:
        colour = materials.car_side(looks, q, s, t, fs, ft)
    elif kind == LAMP:
        colour, shine = materials.lamp(looks, q, light)
    elif kind == LEAVES:
        colour = _leaves(scene, q, normal, footprint)
    elif kind == SIGN:
        colour, shine = materials.sign(looks, q, s, t, fs, ft, light)
    elif kind == FENCE:
        colour = materials.fence(looks, q, s, fs, at, footprint)
    elif kind == ROOF:
        colour = materials.roof(looks, q, t, ft)
    elif kind == GLASS:
        colour, shine = materials.glass(looks, q, t, light)
    if kind == ROAD or kind == PAVEMENT:
        return scale(colour, 1.0 - 0.45 * light.wet), shine
    if light.snow > 0.0 and kind != LAMP:
        colour = mix(colour, materials.WHITE, light.snow * smoothstep(0.2, 0.8, normal[2]))
    return colour, shine


@compiled
def _leaves(scene: Primitives, q: int, normal: Colour, footprint: float) -> Colour:
    """Foliage is painted on the ball itself, so that it stays put as the camera passes."""
    centre = (scene.frame[q, 0], scene.frame[q, 1], scene.frame[q, 2])
    return materials.leaves(scene.look, q, plus(centre, scale(normal, scene.frame[q, 3])), footprint)


@compiled
def _lighting(
    kind: int, q: int, at: Colour, normal: Colour, view: View, light: Light, maps: Maps
) -> Colour:
    """All light that falls on a point."""
    open_sky = 0.81 + 0.19 * normal[2]
    if kind == LEAVES:
        normal = (0.6 * normal[0], 0.6 * normal[1], 0.6 * normal[2] + 0.4)
    total = plus(scale(light.ambient, open_sky), sunlight(at, normal, kind == LEAVES, light, maps))
    if light.night > 0.0:
        if kind == FACADE:
            total = plus(total, lamps_on_facade(q, at, normal, light, maps))
        else:
            total = plus(total, lamps_on_ground(at, normal[2], light, maps))
        if light.headlights > 0.0:
            ahead = (view.axes[2, 0], view.axes[2, 1], view.axes[2, 2])
            total = plus(total, own_headlights(at, normal, view.position, ahead, light))
    return total
