"""G2D: drives through the city of Grand Theft Auto V, captured with the camera's six degrees of freedom.

Citation: A.-D. Doan, A. M. Jawaid, T.-T. Do and T.-J. Chin, "G2D: from GTA to Data", arXiv 1806.07381, 2018.
Licence: research and education only (the software's README). Address: https://github.com/dzungdoan6/G2D.

Layout, as the capturing tool writes it (TrajectoryTool/script.cpp there):

    DRIVE/6dpose_list.txt       lines of "dataset/images/0.jpg x y z rx ry rz": metres and degrees
    DRIVE/images/0.jpg ...

The images have no times: they are frames of the game, 60 a second (paper, section 4). Positions lie on the
game's own plane, x to the east and y to the north; rz turns to the left from north (as the game's headings
do; not checked against the files).
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DatasetError, TrackError, TraverseError
from evplace.drives.datasets import Drive
from evplace.imaging.recipe import Recipe
from evplace.imaging.windows import WindowSettings
from evplace.sources.film import film_of
from evplace.sources.frames import Frames, is_frames
from evplace.sources.tracks import Track

NEEDS = "DRIVE/6dpose_list.txt and DRIVE/images/*.jpg"
POSES = "6dpose_list.txt"
FRAMES_A_SECOND = 60


class _Pose(NamedTuple):
    """One line of the list."""

    image: str
    x: float
    y: float
    heading_deg: float


def recognises(folder: Path) -> bool:
    """Whether there is a list of poses."""
    return any((place / POSES).is_file() for place in [folder, *_folders(folder)])


def drives(folder: Path) -> list[str]:
    """The drives below the folder, or the one that it is."""
    return sorted(_places(folder))


def open_drive(folder: Path, name: str) -> Drive:
    """The images, to be simulated, and the poses."""
    place = _places(folder)[name]
    poses = _poses(place / POSES)
    files = _files(place, poses)
    t_us = np.arange(len(poses), dtype=np.int64) * 1_000_000 // FRAMES_A_SECOND
    xy: NDArray[np.float64] = np.array([(pose.x, pose.y) for pose in poses])
    headings = np.array([pose.heading_deg for pose in poses])
    return Drive(
        film_of(place / "images", Frames(files, t_us, False)),
        Track.local(t_us, xy, headings),
        simulate=True,
        recipe=Recipe(windows=WindowSettings(dt="1/60")),
    )


def _folders(folder: Path) -> list[Path]:
    return [place for place in folder.iterdir() if place.is_dir()]


def _places(folder: Path) -> dict[str, Path]:
    """Name of a drive -> its folder."""
    places = [folder, *_folders(folder)]
    return {place.name: place for place in places if (place / POSES).is_file()}


def _poses(file: Path) -> list[_Pose]:
    try:
        lines = file.read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrackError(f"cannot read the poses {file}: {error}") from error
    poses = [_pose(file, number, line) for number, line in enumerate(lines, 1) if line.strip()]
    if not poses:
        raise TrackError(f"{file} holds no poses")
    return poses


def _pose(file: Path, number: int, line: str) -> _Pose:
    image, *numbers = line.split()
    try:
        x, y, _, _, _, turn = (float(value) for value in numbers)
    except ValueError:
        raise TrackError(
            f"{file}, line {number}: an image's name and six numbers are needed, it is '{line[:80]}'"
        ) from None
    if not np.isfinite([x, y, turn]).all():
        raise TrackError(f"{file}, line {number}: the pose is not a number: '{line[:80]}'")
    return _Pose(image, x, y, -turn % 360)


def _files(place: Path, poses: list[_Pose]) -> tuple[Path, ...]:
    images = place / "images"
    if not (images.is_dir() and is_frames(images)):
        raise DatasetError(f"the images are missing: {images} holds none")
    files = tuple(images / pose.image.replace("\\", "/").rpartition("/")[2] for pose in poses)
    missing = [file.name for file in files if not file.is_file()]
    if missing:
        raise TraverseError(
            f"{place / POSES} names {len(missing)} images that {images} lacks, first {missing[0]}"
        )
    return files
