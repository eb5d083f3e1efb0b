"""One drive on disk: event images of each sensor, colour images, poses; streamed, so memory stays flat."""

from __future__ import annotations

import contextlib
import math
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import utm
from numpy.typing import NDArray

from evplace.core.events import Events, Size
from evplace.core.folders import DRIVE
from evplace.core.storage import GrowingArray, new_folder, write_array
from evplace.exports import nmea, of_track
from evplace.imaging.images import Imager, frame_image
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import TraverseWriter, new_traverse
from evplace.imaging.windows import WindowSettings
from evplace.sources.simulators.esim import PRESETS, Simulator
from evplace.sources.tracks import Track
from evplace.sources.writers import write_recording
from evplace_lab.city.camera import ColourCamera, grey, luminance
from evplace_lab.city.film import ZONE, Film, GeoPose, geo_pose
from evplace_lab.city.plan import VERSION, CitySettings, drive_name, drive_number
from evplace_lab.city.town import Town

COLOUR = "colour"
"""Folder of the colour traverse, beside one for each sensor."""

MARK = DRIVE
"""What marks a folder that was written here: only such a one is replaced."""
PACKET = 1 << 17
"""Events that are written at a time."""

Tick = Callable[[float], None]
"""Called with the share of a drive that is done."""


def record_drive(out: Path, town: Town, settings: CitySettings, name: str, path: int, tick: Tick) -> None:
    """Drive once and write `out/<condition>-<path>`, which appears whole when the drive has ended."""
    size = (settings.width, settings.height)
    film = Film(town, path, name, size, settings.seed, settings.route_length_m or None)
    with (
        new_folder(out / drive_name(name, path), overwrite=True, mark=MARK) as folder,
        contextlib.ExitStack() as open_now,
    ):
        info = {"source": VERSION, "condition": name, "path": path, **settings.of_drive()}
        sensors = [
            _Sensor(open_now, folder, preset, size, settings, drive_number(name, path), info)
            for preset in settings.sensors
        ]
        colour = open_now.enter_context(new_traverse(folder / COLOUR, info))
        colour.recipe = Recipe("frames", size)
        poses = np.array(_drive(film, settings, sensors, colour, drive_number(name, path), tick))
        for writer in (colour, *(sensor.writer for sensor in sensors)):
            writer.track = _track(np.array(colour.t_us), poses)
        if settings.keep_events:
            for preset in settings.sensors:
                write_logs(folder / preset, _track(np.array(colour.t_us), poses))
        write_array(folder / MARK, poses)


def write_logs(recording: Path, track: Track) -> None:
    """Where the camera was, as logs beside a recording: its name with .nmea and .csv."""
    with recording.with_suffix(".nmea").open("w", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in nmea.lines(of_track(track)))
    columns = (track.t_us, track.latitude, track.longitude, track.xy[:, 0], track.xy[:, 1], track.heading_deg)
    with recording.with_suffix(".csv").open("w", encoding="utf-8") as file:
        file.write("t_us,latitude,longitude,easting,northing,heading_deg\n")
        for t_us, latitude, longitude, *metres, heading in zip(*columns, strict=True):
            east, north = (f"{value:.2f}" for value in metres)
            file.write(f"{t_us},{latitude:.7f},{longitude:.7f},{east},{north},{heading:.1f}\n")


def _drive(
    film: Film,
    settings: CitySettings,
    sensors: list[_Sensor],
    colour: TraverseWriter,
    number: int,
    tick: Tick,
) -> list[GeoPose]:
    """Render every frame, feed every sensor, keep an image now and then; returns the images' poses."""
    camera = ColourCamera([settings.seed, number], settings.most_gain)
    every = settings.fps // settings.image_hz
    times, poses = film.times(settings.fps), []
    for k, t_us in enumerate(times):
        radiance = film.radiance(t_us)
        camera.expose(radiance, t_us)
        light, grey8 = luminance(radiance), grey(camera.picture(radiance))
        due = k > 0 and k % every == 0
        for sensor in sensors:
            image_us = times[min(math.ceil(k / every) * every, len(times) - 1)]
            sensor.see(light, grey8, t_us, image_us - settings.window_us)
            if due:
                sensor.keep(t_us)
        if due:
            colour.add(frame_image(camera.noisy_picture(radiance)), t_us)
            poses.append(geo_pose(film.drive.pose(t_us)))
            tick(k / len(times))
    return poses


class _Sensor:
    """One event camera of a drive, its images and, if wanted, its events."""

    def __init__(
        self,
        open_now: contextlib.ExitStack,
        folder: Path,
        preset: str,
        size: Size,
        settings: CitySettings,
        number: int,
        info: dict[str, object],
    ) -> None:
        self._coded = preset == "from-8bit"
        self._simulator = Simulator(size, PRESETS[preset], settings.seed, number)
        self._imager = Imager(size)
        self._count = 0
        self.writer = open_now.enter_context(new_traverse(folder / preset, {**info, "preset": preset}))
        self.writer.recipe = Recipe("events", size, WindowSettings(settings.dt))
        self._events: _EventColumns | None = None
        if settings.keep_events:
            self._events = open_now.enter_context(_recording(folder / f"{preset}.aedat4", size))

    def see(self, light: NDArray[np.float32], grey8: NDArray[np.uint8], t_us: int, opens_us: int) -> None:
        """Take a frame; events after `opens_us` belong to the next image."""
        events = self._simulator.push(grey8 if self._coded else light, t_us)
        if self._events is not None:
            self._events.add(events)
        window = events[int(np.searchsorted(events.t_us, opens_us, "right")) :]
        self._imager.add(window)
        self._count += len(window)

    def keep(self, t_us: int) -> None:
        """Write the image of the window that ends now."""
        self.writer.add(self._imager.image(t_us), t_us, self._count)
        self._count = 0


class _EventColumns:
    """Events as they come, a column a file, until the drive has ended."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir()
        self._folder = folder
        kinds = {"t_us": np.int64, "x": np.uint16, "y": np.uint16, "p": np.bool_}
        self._arrays = {name: GrowingArray(folder / f"{name}.npy", kind, ()) for name, kind in kinds.items()}

    def add(self, events: Events) -> None:
        for name, array in self._arrays.items():
            array.extend(getattr(events, name))

    def packets(self, size: Size) -> Iterator[Events]:
        """All events again, in order; nothing can be added any more."""
        for array in self._arrays.values():
            array.close()
        columns = [np.load(self._folder / f"{name}.npy", mmap_mode="r") for name in self._arrays]
        for start in range(0, len(columns[0]), PACKET):
            t_us, x, y, p = (column[start : start + PACKET] for column in columns)
            yield Events.of(t_us, x, y, p, size)

    def discard(self) -> None:
        for array in self._arrays.values():
            array.discard()
        shutil.rmtree(self._folder)


@contextlib.contextmanager
def _recording(path: Path, size: Size) -> Iterator[_EventColumns]:
    """Columns that become the recording `path` when the block ends well."""
    columns = _EventColumns(path.with_suffix(".columns"))
    try:
        yield columns
        write_recording(path, columns.packets(size), size)
    finally:
        columns.discard()


def _track(t_us: NDArray[np.int64], poses: NDArray[np.float64]) -> Track:
    """The true positions and headings at the images' times."""
    easting, northing = poses[:, 0].copy(), poses[:, 1].copy()
    latitude, longitude = utm.to_latlon(easting, northing, ZONE, northern=True)
    heading = np.mod(90.0 - np.degrees(poses[:, 3]), 360.0)
    return Track(t_us, latitude, longitude, easting, northing, heading, ZONE, True)
