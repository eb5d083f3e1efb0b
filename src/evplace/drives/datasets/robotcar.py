"""Oxford RobotCar: drives through Oxford over a year, a stereo camera at 16 images a second, GPS and INS.

Citation: W. Maddern, G. Pascoe, C. Linegar and P. Newman, "1 Year, 1000km: The Oxford RobotCar Dataset",
The International Journal of Robotics Research 36(1), 2017. Licence: CC BY-NC-SA 4.0.
Address: https://robotcar-dataset.robots.ox.ac.uk.

Layout, of the archives as they unpack (the documentation above; github.com/ori-mrg/robotcar-dataset-sdk):

    2014-12-09-13-21-02/stereo.timestamps                     lines of "microseconds chunk"
    2014-12-09-13-21-02/stereo/centre/<microseconds>.png      raw Bayer, GBRG, 1280 x 960
    2014-12-09-13-21-02/gps/ins.csv, gps/gps.csv              with timestamp, latitude, longitude

There are no events: they are simulated from the images, as in the paper, which cuts them at 1/16 s. At 16
images a second the picture often moves by more than a pixel, which the simulator remarks upon. Each 2x2 block
of the Bayer pattern becomes one pixel, so images are 640 x 480 and nothing is interpolated.

Chunks are downloaded one by one: a chunk may be missing, an image of a chunk that is there may not. The
positions are ins.csv's where that is there, whatever its ins_status says, else gps.csv's.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DatasetError, TraverseError
from evplace.drives.datasets import Drive
from evplace.imaging.recipe import Recipe
from evplace.imaging.windows import WindowSettings
from evplace.sources.film import film_of
from evplace.sources.frames import Frames, image_files, read_image
from evplace.sources.tracks import Track, open_track

NEEDS = "DATE/stereo/centre/*.png, DATE/stereo.timestamps, and DATE/gps/ins.csv or gps.csv"


def recognises(folder: Path) -> bool:
    """Whether there are images of the stereo camera."""
    return bool(drives(folder))


def drives(folder: Path) -> list[str]:
    """The drives below the folder, or the one that it is."""
    return sorted(_places(folder))


def open_drive(folder: Path, name: str) -> Drive:
    """The images, to be simulated, and the positions."""
    place = _places(folder)[name]
    images = place / "stereo" / "centre"
    frames = _frames(place, images)
    return Drive(
        film_of(images, frames),
        _track(place),
        simulate=True,
        recipe=Recipe(windows=WindowSettings(dt="1/16")),
    )


def demosaiced(raw: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The colours (h/2, w/2, 3) of a GBRG Bayer image (h, w); TraverseError where a side is odd."""
    if raw.ndim != 2 or raw.shape[0] % 2 or raw.shape[1] % 2:
        raise TraverseError(f"a Bayer image has one channel and even sides, this one is {raw.shape}")
    green = (raw[0::2, 0::2].astype(np.uint16) + raw[1::2, 1::2] + 1) // 2
    return np.stack([raw[1::2, 0::2], green.astype(np.uint8), raw[0::2, 1::2]], axis=-1)


def _places(folder: Path) -> dict[str, Path]:
    """Name of a drive -> its folder."""
    return {place.name: place for place in _candidates(folder) if (place / "stereo" / "centre").is_dir()}


def _candidates(folder: Path) -> Iterator[Path]:
    yield folder
    yield from (place for place in folder.iterdir() if place.is_dir())


def _frames(place: Path, images: Path) -> Frames:
    files = {_time(file): file for file in image_files(images)}
    if not files:
        raise DatasetError(f"{images} holds no images")
    _check_complete(place / "stereo.timestamps", set(files))
    t_us = sorted(files)
    return Frames(tuple(files[t] for t in t_us), np.array(t_us, np.int64), True, _read)


def _time(file: Path) -> int:
    if not file.stem.isdecimal():
        raise TraverseError(
            f"{file} has no time: the images' names are microseconds, as in 1418132504537582.png"
        )
    return int(file.stem)


def _check_complete(listing: Path, there: set[int]) -> None:
    """Whether the images are those that `stereo.timestamps` lists for their chunks."""
    chunks = _chunks(listing)
    unlisted = sorted(there - set(chunks))
    if unlisted:
        raise TraverseError(f"{len(unlisted)} images are not in {listing}, first {unlisted[0]}.png")
    begun = {chunks[t] for t in there}
    lost = sorted(t for t, chunk in chunks.items() if chunk in begun and t not in there)
    if lost:
        raise TraverseError(
            f"{listing} lists {len(lost)} images that are missing, first {lost[0]}.png: "
            f"unpack chunk {chunks[lost[0]]} again"
        )


def _chunks(listing: Path) -> dict[int, str]:
    """Time in microseconds -> the chunk that holds its image."""
    try:
        rows = [line.split() for line in listing.read_text("utf-8").splitlines() if line.strip()]
        return {int(time): chunk for time, chunk in rows}
    except OSError as error:
        raise DatasetError(f"the times of the images are missing: {listing}: {error.strerror}") from error
    except (ValueError, UnicodeDecodeError) as error:
        raise TraverseError(f"{listing} must hold lines of microseconds and chunk: {error}") from error


def _read(file: Path) -> NDArray[np.uint8]:
    try:
        return demosaiced(read_image(file))
    except TraverseError as error:
        raise TraverseError(f"{file}: {error}") from error


def _track(place: Path) -> Track:
    for name, preset in (("ins.csv", "robotcar-ins"), ("gps.csv", "robotcar")):
        if (place / "gps" / name).exists():
            return open_track(place / "gps" / name, preset)
    raise DatasetError(f"the positions are missing: {place / 'gps'} holds neither ins.csv nor gps.csv")
