"""What surfaces are made of: reflectance and own light of each material at a point."""

from __future__ import annotations

import numpy as np

from evplace_lab.city.jit import compiled
from evplace_lab.city.light import Light
from evplace_lab.city.texture import Colour, band, hash01, mix, noise, plus, pulse, scale

ROAD, PAVEMENT, FACADE, PLAIN, CAR_SIDE, LAMP, LEAVES, SIGN, FENCE, ROOF, GLASS = range(11)
"""Materials; each function says what the numbers of a look mean."""

Look = tuple[float, ...]
"""The 16 numbers of a primitive's look: by value, since a call with an array counts its references."""
Surface = tuple[Colour, Colour]
"""Reflectance and own light."""

HALF_ROAD_M = 5.2
"""From the middle of a street to its kerb."""

BLACK = (0.0, 0.0, 0.0)
WHITE = (0.85, 0.86, 0.90)


@compiled
def look_of(looks: np.ndarray, q: int) -> Look:
    """Row `q` of (N, 16) looks."""
    row = looks[q]
    low = (row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7])
    high = (row[8], row[9], row[10], row[11], row[12], row[13], row[14], row[15])
    return low + high


@compiled
def colour_of(look: Look) -> Colour:
    """The first three numbers of a look."""
    return (look[0], look[1], look[2])


@compiled
def road(look: Look, s: float, t: float, fs: float, ft: float, snow: float) -> Colour:
    """Asphalt with markings. Look: 3-6 the tile's corner and size on the drawing board, 7-8 the nearest
    streets along y and along x, 9-10 how they are marked.
    """
    x = look[3] + s * look[5]
    y = look[4] + t * look[6]
    fx = min(fs * look[5], 30.0)
    fy = min(ft * look[6], 30.0)
    off_x = x - look[7]
    off_y = y - look[8]
    along_y = abs(off_x) < HALF_ROAD_M
    along_x = abs(off_y) < HALF_ROAD_M
    paint = 0.0
    if along_y and not along_x:
        paint = _markings(off_x, y, abs(off_y), fx, fy, look[9])
    elif along_x and not along_y:
        paint = _markings(off_y, x, abs(off_x), fy, fx, look[10])
    bare = mix(scale(colour_of(look), _asphalt(x, y, max(fx, fy))), (0.62, 0.62, 0.58), paint)
    if snow == 0.0:
        return bare
    tracks = 0.3
    if along_y and not along_x:
        tracks = _wheel_tracks(off_x, fx)
    elif along_x and not along_y:
        tracks = _wheel_tracks(off_y, fy)
    return mix(bare, WHITE, snow * (1.0 - 0.85 * tracks))


@compiled
def _asphalt(x: float, y: float, footprint: float) -> float:
    """Patches, stains and grain, each fading out before it could flicker."""
    k = 1.0 / (1.0 + footprint * 0.7)
    v = 0.85 + 0.3 * k * (noise(x * 0.9, y * 0.9, 5) - 0.5) + 0.35 * (noise(x * 0.11, y * 0.11, 7) - 0.5)
    if footprint < 2.0:
        v += 0.25 / (1.0 + footprint * 4.0) * (noise(x * 5.0, y * 5.0, 6) - 0.5)
    patch = hash01(int(np.floor(x / 3.0)), int(np.floor(y / 5.0)), 21)
    if patch < 0.05:
        v *= 1.0 - 0.35 * k
    elif patch > 0.985:
        v *= 1.0 + 0.3 * k
    return v


@compiled
def _markings(off: float, along: float, to_crossing: float, fo: float, fa: float, style: float) -> float:
    """Share of paint: middle line, edge lines, zebra and stop line; `style` in [0, 1) is the street's."""
    paint = 0.0
    if to_crossing > 12.0:
        dashes = pulse(along / 6.0, fa / 6.0, 0.0, 0.5) if style < 0.7 else 1.0
        paint = band(off, fo, -0.08, 0.08) * dashes
    if style > 0.4:
        paint += band(abs(off), fo, 3.15, 3.27)
    zebra = band(to_crossing, fa, 6.0, 9.0)
    if zebra > 0.0:
        paint += zebra * pulse(off / 1.1, fo / 1.1, 0.0, 0.5) * band(abs(off), fo, 0.0, 4.8)
    paint += band(to_crossing, fa, 10.0, 10.4) * band(off, fo, 0.0, 4.8)
    return min(paint, 1.0)


@compiled
def _wheel_tracks(off: float, footprint: float) -> float:
    """Share of the snow that wheels have pressed away."""
    return band(abs(off), footprint, 0.9, 1.4) + band(abs(off), footprint, 2.4, 2.9)


@compiled
def pavement(look: Look, s: float, t: float, fs: float, ft: float, snow: float) -> Colour:
    """Slabs. Look: 3-6 as for the road."""
    x = look[3] + s * look[5]
    y = look[4] + t * look[6]
    fx = min(fs * look[5], 30.0)
    fy = min(ft * look[6], 30.0)
    k = 1.0 / (1.0 + max(fx, fy) * 2.0)
    slab = (1.0 - pulse(x / 0.9, fx / 0.9, 0.0, 0.07)) * (1.0 - pulse(y / 0.9, fy / 0.9, 0.0, 0.07))
    wear = 0.9 + 0.35 * k * (noise(x * 1.3, y * 1.3, 15) - 0.5) + 0.2 * (noise(x * 0.15, y * 0.15, 16) - 0.5)
    bare = scale(colour_of(look), (0.8 + 0.2 * slab) * wear)
    return mix(bare, WHITE, snow) if snow > 0.0 else bare


@compiled
def car_side(look: Look, s: float, t: float, fs: float, ft: float) -> Colour:
    """Painted metal: a dark sill, the gap of a door, a lighter shoulder."""
    colour = mix(colour_of(look), (0.03, 0.03, 0.03), 0.7 * band(t, ft, 0.0, 0.14))
    colour = mix(colour, (0.02, 0.02, 0.02), 0.6 * band(s, fs, 0.47, 0.49) * band(t, ft, 0.2, 1.0))
    return mix(colour, (0.9, 0.9, 0.9), 0.18 * band(t, ft, 0.72, 0.82))


@compiled
def lamp(look: Look, light: Light) -> Surface:
    """A light source. Look: 3 its strength by day, 4 by night."""
    level = look[3] + (look[4] - look[3]) * light.night
    colour = colour_of(look)
    return scale(colour, 0.3), scale(colour, level)


@compiled
def leaves(look: Look, at: Colour, footprint: float) -> Colour:
    """Foliage. Look: 10 its seed."""
    seed = int(look[10])
    x, y, z = at
    fine = noise(x * 4.0 + z * 2.3, y * 4.0 - z * 3.1, seed) - 0.5
    wide = noise(x * 1.4 + z, y * 1.4 - z * 1.2, seed + 1) - 0.5
    v = 0.55 + 0.9 * fine / (1.0 + footprint * 6.0) + 0.9 * wide / (1.0 + footprint * 2.0)
    return scale(colour_of(look), max(v, 0.08))


@compiled
def sign(look: Look, s: float, t: float, fs: float, ft: float, light: Light) -> Surface:
    """A sign, poster or hoarding. Look: 3 how strongly it shines at night, 10 its seed."""
    blot = hash01(int(s * 5), int(t * 3), int(look[10]))
    far = min(max((max(fs * 5, ft * 3) - 0.4) / 0.6, 0.0), 1.0)
    colour = scale(colour_of(look), (0.25 + 1.5 * blot) * (1.0 - far) + far)
    line = pulse(t * 4.0, ft * 4.0, 0.3, 0.4) * band(s, fs, 0.1, 0.9)
    colour = plus(scale(colour, 1.0 - 0.6 * line), scale((0.5, 0.5, 0.5), line))
    edge = 1.0 - band(s, fs, 0.04, 0.96) * band(t, ft, 0.06, 0.94)
    colour = mix(colour, (0.05, 0.05, 0.05), edge)
    return colour, scale(colour, light.windows * look[3])


@compiled
def fence(look: Look, s: float, fs: float, at: Colour, footprint: float) -> Colour:
    """Bars or a hedge. Look: 3 width in metres, 4 one for bars and zero for a hedge."""
    if look[4] > 0.5:
        return scale(colour_of(look), 0.5 + 0.7 * pulse(s * look[3] / 0.8, fs * look[3] / 0.8, 0.0, 0.5))
    leaf = noise((at[0] + at[1]) * 4.0, at[2] * 4.0, 3) - 0.5
    return scale(colour_of(look), 0.8 + 0.9 * leaf / (1.0 + footprint * 6.0))


@compiled
def roof(look: Look, t: float, ft: float) -> Colour:
    """Rows of tiles. Look: 3 how many."""
    return scale(colour_of(look), 1.0 - 0.3 * pulse(t * look[3], ft * look[3], 0.0, 0.25))


@compiled
def glass(look: Look, s: float, t: float, fs: float, ft: float, light: Light) -> Surface:
    """A car's windows: dark, with the sky mirrored in their upper part. Look: 5-7 the paint of the posts,
    8 whether there is one in the middle.
    """
    clear = band(s, fs, 0.05, 0.95) * band(t, ft, 0.0, 0.86)
    clear *= 1.0 - look[8] * band(s, fs, 0.47, 0.53)
    paint = (look[5], look[6], look[7])
    return mix(paint, colour_of(look), clear), scale(light.horizon, clear * (0.03 + 0.12 * t))
