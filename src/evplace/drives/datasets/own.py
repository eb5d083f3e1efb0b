"""A folder of one's own: a recording, or a folder of images, for each drive, and its GPS log beside it.

Citation, licence, address: its owner's. Layout:

    day.aedat4       any recording that is read here, or a folder of images with timestamps.txt (seconds)
    day.nmea         the GPS log of the same name: .nmea, .gpx or .csv, on the same clock
    day_hot_pixels.txt      lines of x,y, where there is one; passed over beside a folder of images

Images are kept as camera images unless events are asked for.
"""

from __future__ import annotations

from pathlib import Path

from evplace.core.errors import DatasetError, TraverseError
from evplace.drives.datasets import Drive
from evplace.sources.film import Film, film_of
from evplace.sources.frames import SUFFIXES, is_frames, open_frames
from evplace.sources.readers import is_recording, open_recording
from evplace.sources.tracks import open_track

NEEDS = "NAME.aedat4 (any recording, or a folder of images) and NAME.nmea, .gpx or .csv"
LOGS = (".nmea", ".gpx", ".csv")
HOT = "_hot_pixels.txt"


def recognises(folder: Path) -> bool:
    """Whether a recording or a folder of images has a log of the same name."""
    # The log is asked for first: to look into each of thousands of images takes long.
    return any(_log(folder, _name(path)) is not None and _is_source(path) for path in folder.iterdir())


def drives(folder: Path) -> list[str]:
    """The names of the recordings and folders of images."""
    return sorted({_name(path) for path in folder.iterdir() if _is_source(path)})


def open_drive(folder: Path, name: str) -> Drive:
    """The recording or the images, and the log."""
    sources = sorted(path for path in folder.iterdir() if _name(path) == name and _is_source(path))
    if len(sources) > 1:
        names = ", ".join(path.name for path in sources)
        raise DatasetError(f"{folder} holds several recordings of '{name}': {names}: keep one")
    log = _log(folder, name)
    if log is None:
        wanted = ", ".join(f"{name}{suffix}" for suffix in LOGS)
        raise DatasetError(f"{sources[0]} has no GPS log: put one of {wanted} beside it")
    if is_frames(sources[0]):
        return Drive(_film(sources[0]), open_track(log))
    hot = folder / f"{name}{HOT}"
    return Drive(open_recording(sources[0]), open_track(log), hot if hot.exists() else None)


def _film(folder: Path) -> Film:
    frames = open_frames(folder)
    if not frames.timed:
        raise TraverseError(
            f"the images in {folder} have no times: put them into timestamps.txt, one in seconds a line"
        )
    return film_of(folder, frames)


def _name(path: Path) -> str:
    return path.name if path.is_dir() else path.stem


def _is_source(path: Path) -> bool:
    if path.name.startswith(".") or path.name.endswith(HOT):
        return False
    if path.is_dir():
        return is_frames(path) or is_recording(path)
    return path.suffix.lower() not in (*LOGS, *SUFFIXES) and is_recording(path)


def _log(folder: Path, name: str) -> Path | None:
    found = (folder / f"{name}{suffix}" for suffix in LOGS)
    return next((log for log in found if log.is_file()), None)
