"""Drives that are worse than the clean one: what is done to the events of a query, or to where its camera is.

Each function takes the clean query and a level, and gives the traverse of the query that is worse.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Events
from evplace.imaging.images import Imager
from evplace.imaging.traverse import Traverse
from evplace.sources.readers import open_recording
from evplace.sources.simulators.esim import PRESETS, Simulator
from evplace.sources.tracks import Track
from evplace_lab.city import CitySettings, Film, GeoPose, build_town
from evplace_lab.city.camera import luminance
from evplace_lab.city.drive import Pose
from evplace_lab.city.film import FIELD_DEG, geo_pose
from evplace_lab.city.plan import drive_number

CONDITION, PATH, SENSOR = "night", 1, "ideal"
HOT_HZ, FLICKER_HZ = 200.0, 100.0
DISC_PX = 12.0
"""Radius of a flickering disc."""
SEED = 7


@dataclass(frozen=True)
class Night:
    """The clean query: its traverse, its events and how they were made."""

    traverse: Traverse
    events: Events
    settings: CitySettings

    @classmethod
    def load(cls, folder: Path, settings: CitySettings) -> Night:
        """From the folder of a drive that kept its events."""
        recording = open_recording(folder / f"{SENSOR}.aedat4")
        events = Events.concatenate(list(recording.packets()))
        return cls(Traverse.load(folder / SENSOR), events, settings)

    @property
    def window_us(self) -> int:
        """Length of a window."""
        return self.settings.window_us


Extra = Callable[[Events, int, int], Events]
"""A window's events, its start and its end -> the same, disturbed."""


def images(
    night: Night, disturb: Extra | None = None, window_us: int | None = None, events: Events | None = None
) -> Traverse:
    """The query anew: the events of each window, disturbed, as the map's recipe makes images of them."""
    source, recipe = night.events if events is None else events, night.traverse.recipe
    assert recipe is not None  # the city says how its images are made
    imager = Imager(source.size, recipe.images)
    length = window_us or night.window_us
    made, counts = np.empty_like(np.asarray(night.traverse.images)), []
    for at, t_us in enumerate(night.traverse.t_us.tolist()):
        first, last = np.searchsorted(source.t_us, (t_us - length, t_us), "right")
        window = source[int(first) : int(last)]
        window = window if disturb is None else disturb(window, t_us - length, t_us)
        imager.add(window)
        made[at] = imager.image(t_us)
        counts.append(len(window))
    return dataclasses.replace(night.traverse, images=made, counts=np.array(counts, np.int64))


def dropout(night: Night, percent: float) -> Traverse:
    """Events are lost."""
    rng = np.random.default_rng(SEED)

    def disturb(events: Events, _: int, __: int) -> Events:
        kept = rng.random(len(events)) >= percent / 100
        return Events(events.t_us[kept], events.x[kept], events.y[kept], events.p[kept], events.size)

    return images(night, disturb)


def noise(night: Night, rate_hz: float) -> Traverse:
    """Every pixel fires by itself."""
    rng = np.random.default_rng(SEED)
    pixels = _grid(night)

    def disturb(events: Events, start_us: int, end_us: int) -> Events:
        expected = rate_hz * len(pixels) * (end_us - start_us) / 1e6
        chosen = pixels[rng.integers(0, len(pixels), rng.poisson(expected))]
        return _with(events, chosen, rng, start_us, end_us)

    return images(night, disturb)


def hot(night: Night, percent: float) -> Traverse:
    """Some pixels fire all the time."""
    rng = np.random.default_rng(SEED)
    pixels = _grid(night)
    bad = pixels[rng.permutation(len(pixels))[: round(len(pixels) * percent / 100)]]

    def disturb(events: Events, start_us: int, end_us: int) -> Events:
        times = rng.poisson(HOT_HZ * (end_us - start_us) / 1e6, len(bad))
        return _with(events, np.repeat(bad, times, axis=0), rng, start_us, end_us)

    return images(night, disturb)


def flicker(night: Night, percent: float) -> Traverse:
    """Lamps: discs in which all pixels fire at each half wave of the mains."""
    rng = np.random.default_rng(SEED)
    pixels = _grid(night)
    discs = max(1, round(len(pixels) * percent / 100 / (math.pi * DISC_PX**2)))

    def disturb(events: Events, start_us: int, end_us: int) -> Events:
        middles = pixels[rng.integers(0, len(pixels), discs)]
        near = np.hypot(*(pixels[:, None] - middles[None]).transpose(2, 0, 1)) < DISC_PX
        lit = pixels[near.any(axis=1)]
        waves = max(1, round(FLICKER_HZ * (end_us - start_us) / 1e6))
        return _with(events, np.repeat(lit, waves, axis=0), rng, start_us, end_us)

    return images(night, disturb)


def speed(night: Night, factor: float) -> Traverse:
    """The same way in 1 / factor of the time; images come as often as before."""
    clean = night.traverse
    spacing = int(np.median(np.diff(clean.t_us)))
    times = np.arange(int(clean.t_us[0]), int(clean.t_us[-1] / factor), spacing)
    track = clean.track
    assert track is not None  # the city knows where it is
    along = track.at((times * factor).astype(np.int64))
    shape = (len(times), *clean.images.shape[1:])
    asked = dataclasses.replace(
        clean, images=np.zeros(shape, np.uint8), t_us=times, counts=np.zeros(len(times), np.int64),
        track=dataclasses.replace(along, t_us=times),
    )  # fmt: skip
    faster = (night.events.t_us / factor).astype(np.int64)
    events = Events(faster, night.events.x, night.events.y, night.events.p, night.events.size)
    return images(dataclasses.replace(night, traverse=asked), events=events)


def dt(night: Night, milliseconds: float) -> Traverse:
    """Windows of another length."""
    return images(night, window_us=round(milliseconds * 1000))


def lateral(night: Night, metres: float) -> Traverse:
    """Beside the lane, to the right."""

    def moved(pose: Pose) -> Pose:
        return pose._replace(x=pose.x + metres * math.sin(pose.yaw), y=pose.y - metres * math.cos(pose.yaw))

    return _rendered(night, moved)


def yaw(night: Night, degrees: float) -> Traverse:
    """Turned to the left."""
    return _rendered(night, lambda pose: pose._replace(yaw=pose.yaw + math.radians(degrees)))


def lens(night: Night, degrees: float) -> Traverse:
    """A wider or narrower view."""
    return _rendered(night, lambda pose: pose, degrees)


def gps(day: Traverse, seconds: float) -> Traverse:
    """A map's drive whose positions are those of so much before; its first images keep the first position."""
    track = day.track
    assert track is not None  # the city knows where it is
    earlier = np.maximum(day.t_us - round(seconds * 1e6), day.t_us[0])
    late = track.at(earlier)
    return dataclasses.replace(day, track=dataclasses.replace(late, t_us=day.t_us))


QUERIES: dict[str, Callable[[Night, float], Traverse]] = {
    "dropout": dropout, "noise": noise, "hot": hot, "flicker": flicker, "speed": speed, "dt": dt,
    "lateral": lateral, "yaw": yaw, "lens": lens,
}  # fmt: skip
"""Kind of a recipe -> what it does to a query."""
MAPS = {"gps": gps}
"""Kind of a recipe -> what it does to the map's drive."""


def _rendered(night: Night, moved: Callable[[Pose], Pose], field_deg: float = FIELD_DEG) -> Traverse:
    """The same drive by a camera that is elsewhere, or sees otherwise."""
    settings = night.settings
    size = (settings.width, settings.height)
    town = build_town(settings.seed)
    film = Film(town, PATH, CONDITION, size, settings.seed, settings.route_length_m or None, field_deg)
    number = drive_number(CONDITION, PATH)
    simulator = Simulator(size, PRESETS[SENSOR], settings.seed, number)
    times = film.times(settings.fps)
    parts = [
        simulator.push(luminance(film.seen_from(moved(film.drive.pose(t_us)), t_us)), t_us) for t_us in times
    ]
    poses = [geo_pose(moved(film.drive.pose(int(t_us)))) for t_us in night.traverse.t_us]
    made = images(night, events=Events.concatenate(parts))
    return dataclasses.replace(made, track=_track_of(night.traverse, poses))


def _track_of(clean: Traverse, poses: list[GeoPose]) -> Track:
    """The clean track with other positions and headings."""
    track = clean.track
    assert track is not None  # the city knows where it is
    easting, northing = np.array([pose[:2] for pose in poses]).T
    heading = np.mod(90.0 - np.degrees([pose.yaw for pose in poses]), 360.0)
    return dataclasses.replace(track, easting=easting, northing=northing, heading_deg=heading)


def _grid(night: Night) -> NDArray[np.int64]:
    """(W * H, 2) column and row of every pixel."""
    width, height = night.events.size
    return np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)


def _with(
    events: Events, pixels: NDArray[np.int64], rng: np.random.Generator, start_us: int, end_us: int
) -> Events:
    """Events with others at `pixels` (n, 2), at random times of the window and of either sign."""
    many = len(pixels)
    times = np.concatenate([events.t_us, rng.integers(start_us + 1, end_us + 1, many)])
    order = np.argsort(times, kind="stable")
    columns = (
        np.concatenate([events.x, pixels[:, 0].astype(events.x.dtype)]),
        np.concatenate([events.y, pixels[:, 1].astype(events.y.dtype)]),
        np.concatenate([events.p, rng.integers(0, 2, many).astype(events.p.dtype)]),
    )
    x, y, p = (column[order] for column in columns)
    return Events(times[order], x, y, p, events.size)
