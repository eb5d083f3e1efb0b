"""What lights the town: sky, sun, lamps, headlights, and the air between.

Radiance is linear, in units in which a white wall in the midday sun gives about 3.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.jit import compiled
from evplace_lab.city.texture import Colour, mix, noise, plus, sample, scale, smoothstep

Grid = NDArray[np.float32]


class Light(NamedTuple):
    """One condition of weather and time of day, as the loops read it."""

    night: float
    """0 by day, 1 where lamps, windows and headlights are fully on."""
    sun: Colour
    """Radiance of a white wall that faces the sun."""
    towards_sun: Colour
    """Unit vector to the sun."""
    ambient: Colour
    """Light from all sides."""
    zenith: Colour
    horizon: Colour
    fog: float
    """Extinction per metre."""
    wet: float
    """How much the ground mirrors, 0 to 1."""
    snow: float
    """How much of the ground snow covers, 0 to 1."""
    headlights: float
    lamps: float
    windows: float
    """Strength of the car's own headlights, of street lamps, of lit windows and signs."""
    clouds: float
    """How much of the sky is cloud, 0 to 1."""
    glow: float
    """Brightness of the sky around the sun."""


class Maps(NamedTuple):
    """Light worked out once for the whole town, on a grid of one-metre cells."""

    origin: tuple[float, float]
    """World x, y of the grids' corner."""
    shadow: Grid
    """(rows, columns) height up to which a point is in the shade, metres."""
    lamplight: Grid
    """(rows, columns) light of the street lamps on level ground."""
    lamps: NDArray[np.float64]
    """(L, 6) street lamps: x, y, z, and colour."""
    near_lamps: NDArray[np.int32]
    """(N, 6) the nearest lamps of each facade, -1 where there are fewer."""


@compiled
def sky(x: float, y: float, z: float, light: Light) -> Colour:
    """Radiance of the sky in a direction (unit vector)."""
    colour = mix(light.horizon, light.zenith, math.sqrt(max(z, 0.0)))
    if light.clouds > 0.0 and z > 0.01:
        colour = mix(colour, _cloud(light), _cloudiness(x, y, z) * light.clouds * min(1.0, z * 6.0))
    if light.glow > 0.0:
        towards = x * light.towards_sun[0] + y * light.towards_sun[1] + z * light.towards_sun[2]
        if towards > 0.9:
            colour = plus(colour, scale(light.sun, ((towards - 0.9) * 10.0) ** 6 * light.glow))
    return colour


@compiled
def _cloudiness(x: float, y: float, z: float) -> float:
    s = 1.2 / (z + 0.12)
    wide = noise(x * s * 1.5 + 7.0, y * s * 1.5, 11)
    fine = noise(x * s * 4.0, y * s * 4.0 + 3.0, 12)
    return smoothstep(0.5, 0.8, 0.6 * wide + 0.4 * fine)


@compiled
def _cloud(light: Light) -> Colour:
    z, s = light.zenith, light.sun
    grey = (z[0] + z[1] + z[2]) * 0.36 + (s[0] + s[1] + s[2]) * 0.11
    return (grey, grey, grey * 1.02)


@compiled
def sunlight(
    position: Colour, normal: Colour, soft: bool, light: Light, shadow: Grid, origin: tuple[float, float]
) -> Colour:
    """Light of the sun on a surface; `soft` surfaces (leaves) lie half in their own shade."""
    s = light.towards_sun
    facing = normal[0] * s[0] + normal[1] * s[1] + normal[2] * s[2]
    if facing <= 0.0 or light.sun[0] <= 0.0:
        return (0.0, 0.0, 0.0)
    x = position[0] + 0.6 * normal[0] - origin[0]
    y = position[1] + 0.6 * normal[1] - origin[1]
    above = position[2] - sample(shadow, x, y)
    visible = smoothstep(-6.0, -2.0, above) if soft else smoothstep(-0.9, 0.3, above)
    return scale(light.sun, facing * visible)


@compiled
def lamps_on_ground(
    position: Colour, upness: float, light: Light, lamplight: Grid, origin: tuple[float, float]
) -> Colour:
    """Light of all street lamps on anything but a facade."""
    level = sample(lamplight, position[0] - origin[0], position[1] - origin[1])
    level *= light.lamps * (0.35 + 0.65 * max(upness, 0.0))
    return (level, level * 0.8, level * 0.52)


@compiled
def lamps_on_facade(
    q: int,
    position: Colour,
    normal: Colour,
    light: Light,
    near_lamps: NDArray[np.int32],
    lamps: NDArray[np.float64],
) -> Colour:
    """Light of the nearest street lamps on a facade, each from its own side."""
    total = (0.0, 0.0, 0.0)
    for k in range(near_lamps.shape[1]):
        i = near_lamps[q, k]
        if i < 0:
            break
        x = lamps[i, 0] - position[0]
        y = lamps[i, 1] - position[1]
        z = lamps[i, 2] - position[2]
        facing = normal[0] * x + normal[1] * y + normal[2] * z
        if facing > 0.0:
            squared = x * x + y * y + z * z + 1.0
            near = 1.0 / math.sqrt(squared)
            level = facing * near / squared * light.lamps * (0.25 + 0.75 * max(z * near, 0.0))
            colour = (lamps[i, 3], lamps[i, 4], lamps[i, 5])
            total = plus(total, scale(colour, level))
    return total


@compiled
def own_headlights(position: Colour, normal: Colour, camera: Colour, ahead: Colour, light: Light) -> Colour:
    """Dipped beams from below the camera: a cone with a cut-off just above the horizon."""
    x = position[0] - camera[0]
    y = position[1] - camera[1]
    z = position[2] - camera[2] + 0.85
    distance = math.sqrt(x * x + y * y + z * z) + 0.1
    along = (x * ahead[0] + y * ahead[1] + z * ahead[2]) / distance
    facing = -(normal[0] * x + normal[1] * y + normal[2] * z) / distance
    if along < 0.75 or facing <= 0.0:
        return (0.0, 0.0, 0.0)
    rise = z / distance - ahead[2]
    cut = 1.0 - 0.9 * smoothstep(-0.02, 0.06, rise)
    level = smoothstep(0.80, 0.985, along) * cut * min(facing + 0.05, 1.0)
    level *= light.headlights / (distance * distance + 4.0)
    return (level, level * 0.95, level * 0.85)


@compiled
def through_air(colour: Colour, distance: float, light: Light) -> Colour:
    """`colour` seen through `distance` metres of fog or rain."""
    return mix(light.horizon, colour, math.exp(-light.fog * distance))
