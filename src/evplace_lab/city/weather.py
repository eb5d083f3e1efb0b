"""What weather does to a finished frame: a wet road, rain, snow, drops on the lens, the sun's veil."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.jit import compiled
from evplace_lab.city.texture import hash01, smoothstep

Image = NDArray[np.float64]
"""(H, W, 3) linear radiance."""

BOX_M = (12.0, 9.0, 7.0)
"""Width, depth and height of the box of air before the camera in which drops fall."""


@compiled
def mirror(
    image: Image, nearness: Image, ground: Image, focal: float, tilt: float, wet: float, out: Image
) -> None:
    """`image` into `out`, with the road as a mirror about the horizon, blurred downwards; more at a flat
    angle. `tilt` is the camera's pitch against the road in pixels.
    """
    height, width = ground.shape
    horizon = 0.5 * height + tilt
    for y in range(height):
        below = y + 0.5 - horizon
        flat = 1.0 - min(max(below, 0.0) / focal, 1.0)
        fresnel = 0.12 + 0.75 * flat * flat * flat
        for x in range(width):
            share = wet * ground[y, x] * fresnel if below >= 1.0 else 0.0
            for c in range(3):
                out[y, x, c] = image[y, x, c]
            if share > 0.0:
                _reflect(image, nearness, x, y, horizon, below, focal, share, out)


@compiled
def _reflect(
    image: Image,
    nearness: Image,
    x: int,
    y: int,
    horizon: float,
    below: float,
    focal: float,
    share: float,
    out: Image,
) -> None:
    """Add what stands behind the mirror at one pixel: two steps towards the true mirrored row."""
    height = image.shape[0]
    row = horizon - below
    for _ in range(2):
        k = min(max(int(row), 0), height - 1)
        row = min(horizon - below + 3.0 * focal * nearness[k, x], horizon + 0.3 * below)
    reach = 1 + int(below * 0.08)
    for c in range(3):
        total = 0.0
        for k in range(-reach, reach + 1):
            total += image[min(max(int(row + k * 1.6), 0), height - 1), x, c]
        out[y, x, c] += (total / (2 * reach + 1) - out[y, x, c]) * share


@compiled
def fall(
    image: Image,
    focal: float,
    seconds: float,
    speed: float,
    exposure: float,
    count: int,
    fall_speed: float,
    size: float,
    white: float,
) -> None:
    """Drops or flakes: `count` of them fall through a box before the car at `fall_speed` m/s; each is a
    smooth streak over `exposure` seconds. Flakes (`white` > 0) are white, drops take the light above.
    """
    cycle = BOX_M[2] / fall_speed
    for i in range(count):
        phase = hash01(i, 1, 5) * cycle
        turn = math.floor((seconds + phase) / cycle)
        age = seconds + phase - turn * cycle
        x = (hash01(i, int(turn), 7) - 0.5) * BOX_M[0] + math.sin(age * 2.0 + i) * 0.1 * white
        z = 0.8 + BOX_M[1] * hash01(i, int(turn), 8) - 0.3 * speed * age
        y = -0.6 * BOX_M[2] + fall_speed * age
        if z >= 0.4:
            end = max(z - speed * exposure, 0.35)
            _streak(image, focal, (x, y, z), (x, y + fall_speed * exposure, end), size, white)


@compiled
def _streak(
    image: Image,
    focal: float,
    start: tuple[float, float, float],
    end: tuple[float, float, float],
    size: float,
    white: float,
) -> None:
    height, width, _ = image.shape
    ax = focal * start[0] / start[2] + 0.5 * width
    ay = focal * start[1] / start[2] + 0.5 * height
    bx = focal * end[0] / end[2] + 0.5 * width
    by = focal * end[1] / end[2] + 0.5 * height
    length = math.hypot(bx - ax, by - ay)
    opacity = min(2.5 * focal * size / start[2] / (1.0 + 0.15 * length), 0.35 + 0.4 * white)
    if length > 60.0 or opacity < 0.004:
        return
    steps = int(length) + 1
    for k in range(steps + 1):
        x = ax + (bx - ax) * k / steps - 0.5
        column, row = math.floor(x), math.floor(ay + (by - ay) * k / steps)
        if 0 <= column < width - 1 and 0 <= row < height:
            _blend(image, row, column, opacity * (1.0 - x + column), white)
            _blend(image, row, column + 1, opacity * (x - column), white)


@compiled
def _blend(image: Image, row: int, column: int, opacity: float, white: float) -> None:
    """Light of a drop comes from above it."""
    height = image.shape[0]
    above = max(row - height // 6, 0)
    for c in range(3):
        light = 0.5 * image[above, column, c] + 0.5 * image[height // 5, column, c]
        light += (0.9 - light) * white
        image[row, column, c] += (light * 1.25 - image[row, column, c]) * opacity


@compiled
def lens_drops(image: Image, spare: Image, seconds: float, count: int) -> None:
    """Drops that sit on the lens for some seconds, creep down and show the view upside down."""
    height, width, _ = image.shape
    spare[:] = image
    for i in range(count):
        cycle = 6.0 + 5.0 * hash01(i, 0, 9)
        phase = hash01(i, 1, 9) * cycle
        turn = math.floor((seconds + phase) / cycle)
        age = seconds + phase - turn * cycle
        x = hash01(i, turn, 10) * width
        y = hash01(i, turn, 11) * height + age * age * 0.002 * height
        radius = (0.012 + 0.03 * hash01(i, turn, 12)) * width * min(age / 0.15, 1.0)
        _lens_drop(image, spare, x, y, radius)


@compiled
def _lens_drop(image: Image, spare: Image, x: float, y: float, radius: float) -> None:
    height, width, _ = image.shape
    for row in range(max(0, int(y - radius)), min(height, int(y + radius) + 2)):
        for column in range(max(0, int(x - radius)), min(width, int(x + radius) + 2)):
            dx, dy = column + 0.5 - x, row + 0.5 - y
            share = smoothstep(radius + 0.7, radius * 0.6, math.hypot(dx, dy)) * 0.75
            i = min(max(int(x - dx * 3.0), 0), width - 1)
            j = min(max(int(y - dy * 3.0), 0), height - 1)
            for c in range(3):
                image[row, column, c] += (spare[j, i, c] - image[row, column, c]) * share


@compiled
def veil(
    image: Image, nearness: Image, column: float, row: float, colour: tuple[float, float, float]
) -> None:
    """Light of a sun at (column, row) scattered in the lens, as far as the sky there is free."""
    height, width = nearness.shape
    free = 0.0
    for dy in range(-3, 4):
        for dx in range(-3, 4):
            j, i = int(row) + dy, int(column) + dx
            inside = 0 <= i < width and 0 <= j < height
            free += 1.0 / 49.0 if inside and nearness[j, i] <= 0.0 else 0.0
    if free <= 0.0:
        return
    for y in range(height):
        for x in range(width):
            away = math.hypot(x - column, y - row) / width
            level = free * (0.05 + 0.5 * math.exp(-away * 9.0))
            for c in range(3):
                image[y, x, c] += colour[c] * level
