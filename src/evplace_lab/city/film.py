"""A drive as frames: linear light and pose at any time."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Size
from evplace_lab.city import weather
from evplace_lab.city.camera import ColourCamera
from evplace_lab.city.conditions import CONDITIONS, Condition, condition
from evplace_lab.city.culling import draw_groups, group
from evplace_lab.city.drive import Drive, Pose, camera_axes, drive_along
from evplace_lab.city.lightmaps import light_maps
from evplace_lab.city.mesh import Primitives, join
from evplace_lab.city.raster import Buffers, View
from evplace_lab.city.routes import lay_route
from evplace_lab.city.shading import Frame, shade_frame
from evplace_lab.city.signals import Signals
from evplace_lab.city.town import Town
from evplace_lab.city.traffic import Traffic, parked_cars, traffic_for

MOVING = 2500
"""Room for primitives of what moves."""
FIELD_DEG = 80.0
"""Horizontal field of view."""
ZONE, EAST, NORTH, TURN = 10, 585_900.0, 4_134_000.0, math.radians(23.0)
"""UTM zone and anchor of the town, and its turn against the grid, so that places do not follow streets."""


class GeoPose(NamedTuple):
    """Where the camera is on the map and where it looks."""

    easting: float
    northing: float
    """UTM metres in ZONE, northern half."""
    height: float
    """Metres above the town's datum."""
    yaw: float
    """Radians, counter-clockwise from east."""
    pitch: float
    roll: float
    """Radians."""


@dataclass(frozen=True)
class CityFrame:
    """One frame of a drive."""

    t_us: int
    """Microseconds from the start of the drive."""
    radiance: NDArray[np.float32]
    """(H, W, 3) linear red, green, blue."""
    colour: NDArray[np.uint8]
    """(H, W, 3) the colour camera's picture: exposed, gamma-coded, without noise."""
    pose: GeoPose


class Film:
    """Renders one drive: a path under a condition. Frames may be asked for at any time, in any order."""

    def __init__(
        self,
        town: Town,
        path: int,
        weather_name: str,
        size: Size,
        seed: int,
        length_m: float | None = None,
        field_deg: float = FIELD_DEG,
    ) -> None:
        """`size` is (width, height); the drive's own draws follow from seed, path and condition."""
        rng = np.random.default_rng([seed, 2, path, list(CONDITIONS).index(weather_name)])
        self.condition: Condition = condition(weather_name)
        self.light = self.condition.light()
        route = lay_route(path, town.streets, town.terrain, seed, length_m)
        self._signals = Signals(town, rng)
        self.drive: Drive = drive_along(route, self._signals, rng)
        self._traffic: Traffic = traffic_for(town, route, self.drive, self._signals, rng)
        still = join([town.scene, parked_cars(town, rng)])
        self._still = len(still.shape)
        self._groups = group(still, MOVING)
        self._scene = _with_room(still, MOVING)
        self._maps = light_maps(town, self.light, self._still + MOVING)
        self._size = size
        width, height = size
        self._focal = 0.5 * width / math.tan(math.radians(field_deg) / 2)
        self._buffers = Buffers.of(size, self._still + MOVING)
        self._frame = Frame(
            np.empty((height, width, 3)), np.empty((height, width)), np.empty((height, width))
        )
        self._spare = np.empty((height, width, 3))

    def radiance(self, t_us: int) -> NDArray[np.float32]:
        """(H, W, 3) linear light at a time."""
        return self.seen_from(self.drive.pose(t_us), t_us)

    def seen_from(self, pose: Pose, t_us: int) -> NDArray[np.float32]:
        """(H, W, 3) linear light at a time as a camera at any other pose sees it."""
        self._groups.start[-1] = self._populate(pose, t_us)
        self._signals.show(self._scene.look, t_us * 1e-6)
        view = view_of(pose, self._focal, self._size)
        draw_groups(self._scene, self._groups, view, self._buffers)
        shade_frame(self._scene, view, self._buffers, self.light, self._maps, self._frame)
        return self._weathered(pose, view, t_us * 1e-6).astype(np.float32)

    def times(self, fps: int) -> list[int]:
        """The times of all frames at an even rate, microseconds."""
        return [round(k * 1_000_000 / fps) for k in range(self.drive.duration_us * fps // 1_000_000 + 1)]

    def frames(self, fps: int) -> Iterator[CityFrame]:
        """All frames of the drive at an even rate, with the colour camera's pictures."""
        camera = ColourCamera([0])
        for t_us in self.times(fps):
            radiance = self.radiance(t_us)
            camera.expose(radiance, t_us)
            yield CityFrame(t_us, radiance, camera.picture(radiance), geo_pose(self.drive.pose(t_us)))

    def _populate(self, pose: Pose, t_us: int) -> int:
        """Put what moves behind what stands still; returns how many primitives there are."""
        count = self._still
        for part in self._traffic.around(pose, t_us):
            end = count + len(part.shape)
            if end > len(self._scene.shape):
                break
            for name in Primitives._fields:
                getattr(self._scene, name)[count:end] = getattr(part, name)
            count = end
        return count

    def _weathered(self, pose: Pose, view: View, seconds: float) -> NDArray[np.float64]:
        """The frame with what the condition does to it; falls are exposed for 8 ms, as an eye would see."""
        image, near = self._frame.radiance, self._frame.nearness
        if self.condition.wet > 0:
            tilt = math.tan(pose.pitch - pose.slope) * self._focal
            weather.mirror(
                image, near, self._frame.ground, self._focal, tilt, self.condition.wet, self._spare
            )
            image, spare = self._spare, image
        else:
            spare = self._spare
        if self.condition.rain:
            weather.fall(image, self._focal, seconds, pose.speed, 0.008, 900, 7.0, 0.003, 0.0)
            weather.lens_drops(image, spare, seconds, 7)
        if self.condition.snowing:
            weather.fall(image, self._focal, seconds, pose.speed, 0.008, 500, 1.6, 0.008, 1.0)
        if self.condition.veil > 0:
            self._veil(image, view)
        return image

    def _veil(self, image: NDArray[np.float64], view: View) -> None:
        x, y, z = np.array([view.right, view.down, view.forward]) @ np.array(self.light.towards_sun)
        if z > 0.1:
            column = x / z * self._focal + 0.5 * view.width
            row = y / z * self._focal + 0.5 * view.height
            weather.veil(image, self._frame.nearness, column, row, self.light.sun)


def view_of(pose: Pose, focal: float, size: Size) -> View:
    """The pinhole camera at a pose."""
    right, down, forward = camera_axes(pose)
    return View(
        (float(pose.x), float(pose.y), float(pose.z)),
        _three(right),
        _three(down),
        _three(forward),
        focal,
        *size,
    )


def _three(row: NDArray[np.float64]) -> tuple[float, float, float]:
    return float(row[0]), float(row[1]), float(row[2])


def _with_room(parts: Primitives, extra: int) -> Primitives:
    return Primitives(*(np.concatenate([a, np.zeros((extra, *a.shape[1:]), a.dtype)]) for a in parts))


def geo_pose(pose: Pose) -> GeoPose:
    """A pose of the town's own metres on the map."""
    c, s = math.cos(TURN), math.sin(TURN)
    return GeoPose(
        EAST + c * float(pose.x) - s * float(pose.y),
        NORTH + s * float(pose.x) + c * float(pose.y),
        float(pose.z),
        math.remainder(float(pose.yaw) + TURN, 2 * math.pi),
        float(pose.pitch),
        float(pose.roll),
    )
