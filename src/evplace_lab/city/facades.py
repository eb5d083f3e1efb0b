"""Facades: walls, windows, cornices, shops and house doors, as functions of metres along and up a wall."""

from __future__ import annotations

import math

from evplace_lab.city.jit import compiled
from evplace_lab.city.light import Light
from evplace_lab.city.materials import BLACK, Look, Surface, colour_of
from evplace_lab.city.texture import Colour, band, hash01, mix, noise, plus, pulse, scale

WIDTH, HEIGHT, STOREY, PITCH, WINDOW_WIDTH, WINDOW_HEIGHT, GROUND = 3, 4, 5, 6, 7, 8, 9
SEED, STYLE, TRIM, LIT, KIND = 10, 11, 12, 13, 14
"""Where a facade's look keeps: sizes in metres (storey height, window pitch, ground-floor height),
windows as shares of pitch and storey, seed, wall style 0-3, grey of frames, share of lit windows, and
the kind of ground floor: a shop below SHOP, else a house."""
SHOP = 0.55
CORNICE_M = 0.5


@compiled
def facade(look: Look, s: float, t: float, fs: float, ft: float, light: Light) -> Surface:
    """A whole wall; s, t in [0, 1], footprints of a pixel in the same units."""
    u, fu = s * look[WIDTH], fs * look[WIDTH]
    v, fv = t * look[HEIGHT], ft * look[HEIGHT]
    surface = (scale(colour_of(look), _wall(look, u, v, fu, fv)), BLACK)
    ground = look[GROUND]
    if v > ground - 0.25 * fv and look[HEIGHT] > ground + 0.5:
        surface = _upper_floors(look, u, v, fu, fv, light, surface)
    if v < ground + 0.25 * fv:
        if look[KIND] < SHOP and look[WIDTH] > 5.0:
            surface = _shop(look, u, v, fu, fv, light, surface)
        else:
            surface = _house_door(look, u, v, fu, fv, light, surface)
    return surface


@compiled
def _wall(look: Look, u: float, v: float, fu: float, fv: float) -> float:
    """Brick courses, panels or storey joints, with stains and grain."""
    style = int(look[STYLE])
    seed = int(look[SEED])
    tone = 1.0
    if style == 0:
        tone = 1.04 - 0.22 * pulse(v / 0.34, fv / 0.34, 0.0, 0.22)
    elif style == 1:
        tone = 1.0 - 0.35 * pulse(u / look[PITCH], fu / look[PITCH], 0.0, 0.06)
    elif style == 2:
        tone = 1.0 - 0.3 * pulse((v - look[GROUND]) / look[STOREY], fv / look[STOREY], 0.0, 0.09)
    f = max(fu, fv)
    wear = 0.92 + 0.24 / (1.0 + f * 1.5) * (noise(u * 0.8 + seed * 3.7, v * 1.1, seed) - 0.5)
    wear += 0.22 * (noise(u * 0.17, v * 0.13 + seed, seed + 1) - 0.5)
    if f < 1.0:
        wear += 0.14 / (1.0 + f * 8.0) * (noise(u * 5.0, v * 5.0, seed + 2) - 0.5)
    return tone * wear


@compiled
def _upper_floors(
    look: Look, u: float, v: float, fu: float, fv: float, light: Light, surface: Surface
) -> Surface:
    """Windows with frames and sills on each storey, and the cornice."""
    colour, shine = surface
    seed = int(look[SEED])
    column, fc = u / look[PITCH], fu / look[PITCH]
    storey, fr = (v - look[GROUND]) / look[STOREY], fv / look[STOREY]
    wide, tall = look[WINDOW_WIDTH], look[WINDOW_HEIGHT]
    inside = band(v, fv, look[GROUND], look[HEIGHT] - CORNICE_M)
    across = pulse(column, fc, 0.5 - wide * 0.5, wide)
    pane = across * pulse(storey, fr, 0.5 - tall * 0.5, tall) * inside
    i, j = math.floor(column), math.floor(storey)
    if pane > 0.0 and hash01(i, j, seed + 77) > 0.92:
        pane = 0.0  # bricked up
    style = int(look[STYLE])
    if across > 0.0 and (style == 3 or (style == 0 and hash01(i, 3, seed) < 0.4)):
        sill = across * pulse(storey, fr, max(0.5 - tall * 0.5 - 0.22, 0.0), 0.2) * inside
        grey = 0.18 if style == 3 else 0.75
        colour = mix(colour, (grey, grey, grey), sill)
    around = pulse(column, fc, 0.45 - wide * 0.5, wide + 0.1) * pulse(
        storey, fr, 0.47 - tall * 0.5, tall + 0.06
    )
    trim = (look[TRIM], look[TRIM], look[TRIM])
    colour = mix(colour, trim, max(around * inside - pane, 0.0))
    if pane > 0.0:
        colour, shine = _window(look, i, j, column, fc, fr, pane, light, colour, shine)
    cornice = band(v, fv, look[HEIGHT] - CORNICE_M, look[HEIGHT])
    return mix(colour, scale(trim, 0.8), cornice), shine


@compiled
def _window(
    look: Look,
    i: int,
    j: int,
    column: float,
    fc: float,
    fr: float,
    pane: float,
    light: Light,
    colour: Colour,
    shine: Colour,
) -> Surface:
    """Window (i, j): glass, blinds or light behind it; from afar the mean of all windows."""
    seed = int(look[SEED])
    chance, other = hash01(i, j, seed), hash01(i, j, seed + 77)
    far = min(max((max(fc, fr) - 0.35) / 0.6, 0.0), 1.0)
    lit = 1.0 if chance < look[LIT] else 0.0
    lit += (look[LIT] - lit) * far
    grey = 0.45 + 0.2 * chance if other < 0.25 else 0.05 + 0.10 * other
    grey += (0.15 - grey) * far
    pane *= 1.0 - 0.7 * pulse(column * 2.0, fc * 2.0, 0.0, 0.08)
    colour = mix(colour, (grey, grey, grey * 1.1), pane)
    if light.night > 0.0:
        level = lit * pane * light.windows * (0.5 + 0.9 * hash01(i, j, seed + 5))
        warm = hash01(i, j, seed + 6)
        return colour, plus(shine, (level, level * (0.72 + 0.2 * warm), level * (0.38 + 0.5 * warm)))
    return colour, plus(shine, scale(light.zenith, 0.24 * pane))


@compiled
def _shop(look: Look, u: float, v: float, fu: float, fv: float, light: Light, surface: Surface) -> Surface:
    """Shop fronts side by side: display window, door and sign above."""
    colour, shine = surface
    seed, ground = int(look[SEED]), look[GROUND]
    front = look[WIDTH] / max(1.0, math.floor(look[WIDTH] / 5.5))
    x, fx = u / front, fu / front
    i = math.floor(x)
    open_late, stocked = hash01(i, 1, seed + 3), hash01(i, 2, seed + 3)
    paint = _shop_colour(i, seed)
    pane = pulse(x, fx, 0.05, 0.62) * band(v, fv, 0.5, ground - 1.1)
    door = pulse(x, fx, 0.72, 0.2) * band(v, fv, 0.05, ground - 1.2)
    board = band(v, fv, ground - 0.95, ground - 0.2) * pulse(x, fx, 0.03, 0.94)
    grey = 0.06 + 0.1 * open_late
    if stocked > 0.3:
        grey += 0.3 / (1.0 + fu * 4.0) * (noise(u * 2.2, v * 2.2, seed + i) - 0.4)
    grey = max(grey, 0.02)
    colour = mix(colour, scale(paint, 0.35), band(v, fv, 0.0, ground))
    colour = mix(mix(colour, (grey, grey, grey), pane), (0.08, 0.07, 0.06), door)
    lettered = _shop_sign(paint, u, v, fu, fv, ground, open_late, seed + 9 + i)
    colour = mix(colour, lettered, board)
    if light.night > 0.0 and stocked < 0.55:
        warm = (2.0 * (grey + 0.25), 1.8 * (grey + 0.22), 1.4 * (grey + 0.16))
        shine = plus(shine, scale(warm, pane * light.windows))
    if light.night > 0.0 and open_late < 0.6:
        shine = plus(shine, scale(lettered, 2.5 * board * light.windows))
    return colour, shine


@compiled
def _shop_colour(i: int, seed: int) -> Colour:
    return (
        0.12 + 0.6 * hash01(i, 3, seed + 3),
        0.12 + 0.6 * hash01(i, 4, seed + 3),
        0.12 + 0.6 * hash01(i, 5, seed + 3),
    )


@compiled
def _shop_sign(
    paint: Colour, u: float, v: float, fu: float, fv: float, ground: float, shift: float, seed: int
) -> Colour:
    """The board over a shop: bars of a contrasting colour stand for letters."""
    bar = 0.0
    if noise(u * 1.7, 0.5, seed) > 0.35:
        bar = pulse(u * 2.3 + shift * 9.0, fu * 2.3, 0.2, 0.5) * band(v, fv, ground - 0.8, ground - 0.35)
    other = (0.8 - 0.9 * paint[0], 0.8 - 0.9 * paint[1], 0.8 - 0.9 * paint[2])
    mixed = mix(paint, other, bar)
    return (max(mixed[0], 0.03), max(mixed[1], 0.03), max(mixed[2], 0.03))


@compiled
def _house_door(
    look: Look, u: float, v: float, fu: float, fv: float, light: Light, surface: Surface
) -> Surface:
    """A house's ground floor: base course, one door, windows beside it."""
    colour, shine = surface
    seed, pitch, wide = int(look[SEED]), look[PITCH], look[WINDOW_WIDTH]
    at = (0.15 + 0.6 * hash01(1, 1, seed + 4)) * look[WIDTH]
    door = band(u, fu, at, at + 1.3) * band(v, fv, 0.1, 2.5)
    pane = pulse(u / pitch, fu / pitch, 0.5 - wide * 0.5, wide) * band(v, fv, 1.0, 2.5)
    if abs(u - at - 0.65) < 1.3:
        pane = 0.0
    colour = mix(colour, (0.2, 0.2, 0.2), 0.7 * band(v, fv, 0.0, 0.6))
    paint = (
        0.1 + 0.5 * hash01(1, 2, seed + 4),
        0.1 + 0.4 * hash01(1, 3, seed + 4),
        0.1 + 0.4 * hash01(1, 4, seed + 4),
    )
    colour = mix(mix(colour, paint, door), (0.1, 0.1, 0.11), pane)
    if light.night > 0.0 and hash01(math.floor(u / pitch), 9, seed) < look[LIT]:
        shine = plus(shine, scale((1.0, 0.8, 0.5), pane * light.windows))
    return colour, shine
