"""Cars and people, built at the origin, facing +x."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from evplace_lab.city.materials import CAR_SIDE, GLASS, LAMP, PLAIN
from evplace_lab.city.mesh import OVAL, Mesh, Primitives

PAINTS = (
    (0.55, 0.55, 0.57),
    (0.05, 0.05, 0.06),
    (0.62, 0.62, 0.62),
    (0.38, 0.04, 0.04),
    (0.05, 0.10, 0.30),
    (0.20, 0.22, 0.24),
    (0.65, 0.60, 0.45),
    (0.10, 0.25, 0.15),
)
RUBBER, WINDOW = (0.02, 0.02, 0.02), (0.03, 0.035, 0.04)
STRIDES = 8
"""Positions of the legs in one double step."""


def car(seed: int) -> Primitives:
    """A saloon, an estate or a van of about 4.4 m."""
    rng = np.random.default_rng(seed)
    mesh = Mesh()
    paint = PAINTS[rng.integers(len(PAINTS))]
    pick = rng.random()
    if pick < 0.55:
        _body(mesh, paint, half=2.15, belt=0.88, roof=1.42, cabin=(-1.55, 0.95), lean=(0.45, 0.65))
    elif pick < 0.82:
        _body(mesh, paint, half=2.2, belt=0.95, roof=1.58, cabin=(-2.1, 1.0), lean=(0.2, 0.6))
    else:
        _body(mesh, paint, half=2.5, belt=1.25, roof=2.15, cabin=(-2.45, 2.1), lean=(0.05, 0.7))
    return mesh.primitives()


def _body(
    mesh: Mesh,
    paint: tuple[float, float, float],
    half: float,
    belt: float,
    roof: float,
    cabin: tuple[float, float],
    lean: tuple[float, float],
) -> None:
    """Lower body, cabin with leaning screens, wheels, lights, and the dark under the car."""
    width = 0.87
    floor = 0.26
    tall = (0.0, 0.0, belt - floor)
    mesh.quad((-half, -width, floor), (2 * half, 0, 0), tall, CAR_SIDE, paint)
    mesh.quad((half, width, floor), (-2 * half, 0, 0), tall, CAR_SIDE, paint)
    mesh.quad((half, -width, floor), (0, 2 * width, 0), tall, PLAIN, paint)
    mesh.quad((-half, width, floor), (0, -2 * width, 0), tall, PLAIN, paint)
    mesh.quad((-half, -width, belt), (2 * half, 0, 0), (0, 2 * width, 0), PLAIN, paint)
    mesh.quad((-half, -width, 0.03), (2 * half, 0, 0), (0, 2 * width, 0), PLAIN, (0.015, 0.015, 0.015))
    _cabin(mesh, paint, belt, roof, cabin, lean)
    for x in (-0.62 * half, 0.64 * half):
        for side in (-1.0, 1.0):
            _wheel(mesh, x, side * (width + 0.01), side)
    _lights(mesh, half + 0.02, belt)


def _cabin(
    mesh: Mesh,
    paint: tuple[float, float, float],
    belt: float,
    roof: float,
    ends: tuple[float, float],
    lean: tuple[float, float],
) -> None:
    """Side windows, screens and roof; the ends lean inwards by `lean` metres (rear, front)."""
    rear, front = ends
    length, tall, width, inset = front - rear, roof - belt, 0.80, 0.12
    back, ahead = lean[0] / length, lean[1] / length
    screens, sides = (*WINDOW, 0, 0, *paint, 0.0), (*WINDOW, 0, 0, *paint, 1.0)
    up_right, up_left = (0, inset, tall), (0, -inset, tall)
    mesh.quad((rear, -width, belt), (length, 0, 0), up_right, GLASS, sides, taper=(back, ahead))
    mesh.quad((front, width, belt), (-length, 0, 0), up_left, GLASS, sides, taper=(ahead, back))
    narrow = inset / (2 * width)
    wide = (0, 2 * width, 0)
    mesh.quad((front, -width, belt), wide, (-lean[1], 0, tall), GLASS, screens, taper=(narrow, narrow))
    mesh.quad(
        (rear, width, belt), (0, -2 * width, 0), (lean[0], 0, tall), GLASS, screens, taper=(narrow, narrow)
    )
    flat = length - lean[0] - lean[1]
    top = (rear + lean[0], -width + inset, roof)
    mesh.quad(top, (flat, 0, 0), (0, 2 * (width - inset), 0), PLAIN, paint)


def _wheel(mesh: Mesh, x: float, y: float, side: float) -> None:
    for radius, colour, out in ((0.33, RUBBER, 0.0), (0.19, (0.35, 0.35, 0.37), 0.01)):
        corner = (x + side * radius, y + side * out, 0.33 - radius)
        mesh.quad(corner, (-side * 2 * radius, 0, 0), (0, 0, 2 * radius), PLAIN, colour, shape=OVAL)


def _lights(mesh: Mesh, front: float, belt: float) -> None:
    """Headlights, tail lights and plates."""
    low = belt - 0.28
    for y in (-0.78, 0.46):
        mesh.quad((front, y, low), (0, 0.32, 0), (0, 0, 0.18), LAMP, (1.0, 0.95, 0.8, 0.3, 14.0))
        mesh.quad((-front, y + 0.32, low), (0, -0.32, 0), (0, 0, 0.18), LAMP, (1.0, 0.08, 0.05, 0.15, 1.2))
    plate = (0.75, 0.75, 0.7)
    mesh.quad((front, -0.26, 0.42), (0, 0.52, 0), (0, 0, 0.12), PLAIN, plate)
    mesh.quad((-front, 0.26, 0.42), (0, -0.52, 0), (0, 0, 0.12), PLAIN, plate)


def person(seed: int, stride: int) -> Primitives:
    """Someone walking, with the legs at `stride` of STRIDES."""
    rng = np.random.default_rng(seed)
    mesh = Mesh()
    tall = 1.55 + 0.3 * rng.random()
    coat, trousers = rng.random(3) * 0.5 + 0.03, rng.random(3) * 0.2 + 0.02
    skin = np.array([0.45, 0.29, 0.21]) * rng.uniform(0.5, 1.2)
    hair = np.array([0.10, 0.07, 0.05]) * rng.uniform(0.4, 3.0)
    swing = 0.3 * math.sin(2 * math.pi * stride / STRIDES)
    hip, neck = 0.5 * tall, 0.84 * tall
    for side in (-1.0, 1.0):
        _limb(mesh, (side * swing, side * 0.09, 0.0), (0.0, side * 0.09, hip), 0.075, trousers)
        hand = (-side * swing * 0.7, side * 0.27, 0.46 * tall)
        _limb(mesh, hand, (0.0, side * 0.22, neck - 0.04), 0.05, coat * 0.85)
    _torso(mesh, hip - 0.08, neck, coat)
    mesh.sphere((0.02, 0, 0.92 * tall), 0.115, PLAIN, skin)
    mesh.sphere((-0.03, 0, 0.95 * tall), 0.115, PLAIN, hair)
    return mesh.primitives()


def _limb(
    mesh: Mesh,
    low: tuple[float, float, float],
    high: tuple[float, float, float],
    half: float,
    colour: NDArray[np.float64],
) -> None:
    """A leaning box from foot to hip, or from hand to shoulder."""
    up = np.subtract(high, low)
    square = np.array([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)])
    for k in range(4):
        mesh.quad(low + square[k], square[(k + 1) % 4] - square[k], up, PLAIN, colour)


def _torso(mesh: Mesh, low: float, high: float, colour: NDArray[np.float64]) -> None:
    """A coat, wider at the shoulders than at the waist."""
    half, deep, tall = 0.17, 0.12, high - low
    out = -0.12
    for corner, along in (
        ((-deep, -half, low), (2 * deep, 0, 0)),
        ((deep, -half, low), (0, 2 * half, 0)),
        ((deep, half, low), (-2 * deep, 0, 0)),
        ((-deep, half, low), (0, -2 * half, 0)),
    ):
        mesh.quad(corner, along, (0, 0, tall), PLAIN, colour, taper=(out, out) if along[1] else (0.0, 0.0))
