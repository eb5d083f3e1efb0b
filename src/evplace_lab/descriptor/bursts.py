"""Places seen in short bursts: a town or a hall, several drives along each route, a few frames a place.

An image needs the frames of its own window only, so that a place costs a few frames and not a drive.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from evplace.core.storage import new_file
from evplace_lab.city.drive import Pose
from evplace_lab.city.film import Film
from evplace_lab.city.town import build_town
from evplace_lab.descriptor.cameras import Camera, Carrying, draw_camera, draw_carrying
from evplace_lab.descriptor.halls import HallFilm, build_hall
from evplace_lab.descriptor.sensors import FROM_FRAMES, SIZE, Sensor, draw_kind, draw_sensor

FIRST_SEED = 10_000
"""Towns of lower seeds are for trials and for the benchmark, whose seed is 0."""
OTHERS = {"rain": 0.4, "dusk": 0.15, "fog": 0.15, "snow": 0.15, "lowsun": 0.15}
"""Conditions beside day and night, and how often each is drawn."""
FIRST_PATH = 3
"""Paths 1 and 2 are the benchmark's."""
HALL_METRE = 12.0
"""A metre in a hall counts for so many in a street: what is near changes sooner."""
SENSORS = 2


@dataclass(frozen=True)
class BurstSettings:
    """How much is made of one town."""

    routes: int = 4
    """Routes, each with a camera of its own."""
    drives: int = 4
    """Drives along each: day, night, and others."""
    places: int = 120
    """Places along each."""
    step_m: float = 1.5
    """Metres between two of them."""
    hall_every: int = 4
    """Each so manieth seed is a hall a route in place of a town; 0 for none."""
    frames: bool = False
    """Frames of an ordinary camera alone, in place of what all sensors give."""


class Bursts(NamedTuple):
    """Images of one town, place by place, drive by drive, route by route."""

    images: NDArray[np.uint8]
    """(routes, drives, places, sensors, 45, 80)."""
    poses: NDArray[np.float32]
    """(routes, drives, places, 3): x, y in metres, those of a hall by HALL_METRE; yaw in radians."""

    def save(self, path: Path) -> None:
        """As .npz, whole or not at all."""
        path.parent.mkdir(parents=True, exist_ok=True)
        with new_file(path, overwrite=True) as partial:
            np.savez(partial, **self._asdict())

    @classmethod
    def load(cls, path: Path) -> Bursts:
        """What `save` wrote."""
        with np.load(path, allow_pickle=False) as arrays:
            return cls(arrays["images"], arrays["poses"])


class _Scenery(Protocol):
    """A town or a hall in one drive."""

    def pose_at(self, way_m: float) -> Pose: ...

    def seen_from(self, pose: Pose) -> NDArray[np.float32]: ...


class _Street:
    """A town in one drive: its traffic is that of the time at which the drive itself would come by."""

    def __init__(self, film: Film) -> None:
        self._film = film

    def pose_at(self, way_m: float) -> Pose:
        return self._film.drive.pose(self._time_us(way_m))

    def seen_from(self, pose: Pose) -> NDArray[np.float32]:
        return self._film.seen_from(pose, self._time_us(pose.way))

    def _time_us(self, way_m: float) -> int:
        drive = self._film.drive
        return int(np.interp(way_m, drive.ways, drive.times) * 1e6)


def is_hall(seed: int, settings: BurstSettings) -> bool:
    """Whether a seed is halls and no town."""
    return settings.hall_every > 0 and seed % settings.hall_every == settings.hall_every - 1


def make_bursts(seed: int, settings: BurstSettings) -> Bursts:
    """All images of one town; the same seed and settings give the same."""
    rng = np.random.default_rng([seed, 7])
    routes = _halls if is_hall(seed, settings) else _streets
    images, poses = zip(*routes(FIRST_SEED + seed, settings, rng), strict=True)
    return Bursts(np.stack(images), np.stack(poses))


_Route = tuple[NDArray[np.uint8], NDArray[np.float32]]


def _streets(seed: int, settings: BurstSettings, rng: np.random.Generator) -> Iterator[_Route]:
    town = build_town(seed)
    length = settings.places * settings.step_m
    for path in range(FIRST_PATH, FIRST_PATH + settings.routes):
        camera, sensors = _seen_by(rng, settings, indoors=False)
        drives = []
        for name in _conditions(settings.drives, rng):
            film = Film(town, path, name, camera.size, seed, length + 30, camera.field_deg)
            carrying = draw_carrying(rng, indoors=False)
            ways = 12 + settings.step_m * (np.arange(settings.places) + rng.uniform(0, 1))
            drives.append(_drive(_Street(film), camera, sensors, carrying, ways, rng))
        yield _joined(drives, 1.0)


def _halls(_: int, settings: BurstSettings, rng: np.random.Generator) -> Iterator[_Route]:
    for _ in range(settings.routes):
        hall, (camera, sensors) = build_hall(rng), _seen_by(rng, settings, indoors=True)
        drives = []
        for number in range(settings.drives):
            film = HallFilm(hall, number % 2 == 1, camera.size, camera.field_deg, rng)
            carrying = draw_carrying(rng, indoors=True)
            ways = hall.length_m * (np.arange(settings.places) + rng.uniform(0, 1)) / settings.places
            drives.append(_drive(film, camera, sensors, carrying, ways, rng))
        yield _joined(drives, HALL_METRE)


def _conditions(count: int, rng: np.random.Generator) -> list[str]:
    """Day, night and others."""
    names, shares = list(OTHERS), list(OTHERS.values())
    return ["day", "night", *map(str, rng.choice(names, count - 2, replace=False, p=shares))][:count]


def _seen_by(rng: np.random.Generator, settings: BurstSettings, indoors: bool) -> tuple[Camera, list[Sensor]]:
    """The camera of a route, and its sensors: a map and its queries are made by one."""
    camera = draw_camera(rng, indoors)
    kinds = (draw_kind(rng, settings.frames) for _ in range(SENSORS))
    return camera, [draw_sensor(rng, kind, camera.size, camera.crop_bottom) for kind in kinds]


def _drive(
    scenery: _Scenery,
    camera: Camera,
    sensors: list[Sensor],
    carrying: Carrying,
    ways: NDArray[Any],
    rng: np.random.Generator,
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Images (places, sensors, 45, 80) and poses (places, 3) of one drive."""
    images = np.empty((len(ways), SENSORS, SIZE[1], SIZE[0]), np.uint8)
    poses = np.empty((len(ways), 3))
    events = any(sensor.kind not in FROM_FRAMES for sensor in sensors)
    for place, way_m in enumerate(ways):
        frames, times_us = _burst(
            scenery, camera, carrying, float(way_m), rng, 0 if events else camera.frames
        )
        for k, sensor in enumerate(sensors):
            images[place, k] = sensor.image(frames, times_us, int(rng.integers(1 << 30)))
        pose = scenery.pose_at(float(way_m))
        poses[place] = pose.x, pose.y, pose.yaw
    return images, poses


def _burst(
    scenery: _Scenery, camera: Camera, carrying: Carrying, way_m: float, rng: np.random.Generator, first: int
) -> tuple[list[NDArray[np.float32]], list[int]]:
    """The frames from number `first` of the window that ends at a place, and their times in microseconds."""
    turning = rng.normal(0, carrying.shake, 3)
    frames, times_us = [], []
    for k in range(first, camera.frames + 1):
        before_s = camera.window_s * (1 - k / camera.frames)
        pose = scenery.pose_at(way_m - carrying.speed * before_s)
        moved = carrying.pose(pose, camera, turning * (0.02 - before_s))
        frames.append(scenery.seen_from(moved))
        times_us.append(round((1 - before_s) * 1e6))
    return frames, times_us


def _joined(drives: list[tuple[NDArray[np.uint8], NDArray[np.float64]]], metre: float) -> _Route:
    images, poses = zip(*drives, strict=True)
    scaled = np.stack(poses)
    scaled[..., :2] *= metre
    return np.stack(images), scaled.astype(np.float32)
