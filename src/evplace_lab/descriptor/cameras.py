"""Cameras, and how they are carried: drawn anew for each route, so that no lens and no vehicle is learned.

All numbers are ours: wide enough for what a car, a robot or a hand carries.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evplace.core.events import Size
from evplace_lab.city.drive import CAMERA_M, Pose
from evplace_lab.city.film import FIELD_DEG

CITY_SHARE = 0.3
"""Share of the routes in a town that are seen by the camera of `evplace city`."""
SHAPES = ((4, 3), (4, 3), (16, 9), (1, 1), (2, 1))


@dataclass(frozen=True)
class Camera:
    """A camera and its mount: the same in all drives along a route."""

    size: Size
    """Columns and rows of its sensor."""
    field_deg: float
    """Horizontal field of view."""
    height_m: float
    """Above the ground."""
    pitch: float
    """Radians, upwards."""
    crop_bottom: float
    """Share of its rows that are cut off below."""
    window_s: float
    """Length of the window of events."""
    frames: int
    """Frames in a window, besides its first."""


@dataclass(frozen=True)
class Carrying:
    """What one drive along the route does otherwise than the next."""

    speed: float
    """Metres a second."""
    aside_m: float
    """To the left of the route."""
    yaw: float
    """Radians that the camera is turned against the route."""
    shake: float
    """Radians a second: standard deviation of how fast it turns about each axis."""

    def pose(self, pose: Pose, camera: Camera, turned: np.ndarray) -> Pose:
        """The camera's pose where the route has `pose`; `turned` (3,) is added to yaw, pitch and roll."""
        yaw = pose.yaw + self.yaw + turned[0]
        return pose._replace(
            x=pose.x - math.sin(pose.yaw) * self.aside_m,
            y=pose.y + math.cos(pose.yaw) * self.aside_m,
            z=pose.z + camera.height_m - CAMERA_M,
            yaw=yaw,
            pitch=pose.pitch + camera.pitch + turned[1],
            roll=pose.roll + turned[2],
            speed=self.speed,
        )


def draw_camera(rng: np.random.Generator, indoors: bool) -> Camera:
    """A camera for one route."""
    window_s = float(np.exp(rng.uniform(math.log(1 / 60), math.log(1 / 15))))
    if not indoors and rng.random() < CITY_SHARE:
        return Camera((160, 120), FIELD_DEG, CAMERA_M, 0.0, 0.25, 1 / 30, 2)
    across, down = SHAPES[int(rng.integers(len(SHAPES)))]
    width = int(rng.choice([80, 96, 112, 128, 160]))
    low, high = (0.12, 1.3) if indoors else (0.4, 2.3)
    return Camera(
        (width, width * down // across),
        float(rng.uniform(45, 105)),
        float(rng.uniform(low, high)),
        math.radians(rng.uniform(-8, 10)),
        float(rng.choice([0.0, 0.0, 0.15, 0.25])),
        window_s,
        int(rng.integers(1, 4)),
    )


def draw_carrying(rng: np.random.Generator, indoors: bool) -> Carrying:
    """How one drive goes along the route."""
    slow, fast = (0.6, 2.5) if indoors else (2.0, 12.0)
    return Carrying(
        float(np.exp(rng.uniform(math.log(slow), math.log(fast)))),
        float(rng.normal(0, 0.1 if indoors else 0.5)),
        math.radians(rng.normal(0, 2.0)),
        math.radians(np.exp(rng.uniform(math.log(0.3), math.log(10.0)))),
    )
