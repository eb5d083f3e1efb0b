"""Folders of images with their UTM positions in the names, as benches of frame-based recognition read them.

Citation: G. Berton, C. Masone and B. Caputo, "Rethinking Visual Geo-localization for Large-Scale
Applications", CVPR 2022. Licence: each set's own. Address: https://github.com/gmberton/VPR-datasets-downloader.

Layout, from that repository's README and code:

    database/@0544388.51@4172758.25@10@S@037.70098@-122.49646@@@@@@@@@.jpg      the map
    queries/@...                                                                what is to be found in it

The fields are easting, northing, zone number, zone letter, latitude, longitude, then panorama, tile, heading,
pitch, roll, height, timestamp, note, and the suffix. Only the first two are required, the rest may be
anything: where no name has a zone the positions lie on a plane of their own, to be compared within the set.
`write_images` puts the time into the note, as t1500us; where all names have such a note it gives order and
times, else the names give the order, at one image a second. Images of several sizes take the first one's.
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import TrackError, TraverseError
from evplace.core.storage import new_folder
from evplace.drives.datasets import Drive
from evplace.imaging.images import ImageSettings
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import Traverse
from evplace.sources.film import film_of
from evplace.sources.frames import Frames, is_image, read_image
from evplace.sources.tracks import Track

NEEDS = "database/@UTM_east@UTM_north@zone@letter@...@.jpg, and queries/ alike"
NAMES = ("database", "queries")
SPLITS = ("", "test", "images/test")
"""Where the two lie, in the set's folder."""
_NORTH = "NPQRSTUVWX"
_SOUTH = "CDEFGHJKLM"
_NOTE = re.compile(r"t(-?\d+)us")
MARK = "@*@t*us@.jpg"
"""What tells a folder that was written here from any other: only such a one is replaced."""
_QUALITY = 95


class _Place(NamedTuple):
    """What an image's name says."""

    file: Path
    easting: float
    northing: float
    zone: int
    letter: str
    t_us: int | None


def recognises(folder: Path) -> bool:
    """Whether a folder `database` or `queries`, or the folder itself, holds images with @ in their names."""
    return bool(drives(folder))


def drives(folder: Path) -> list[str]:
    """Which of the two folders are there; the folder itself where it is such a one."""
    found = [name for name in NAMES if _images(folder, name)]
    return found or ([folder.resolve().name] if _own_images(folder) else [])


def open_drive(folder: Path, name: str) -> Drive:
    """The images in order, and where they were taken."""
    files = _images(folder, name) or _own_images(folder)
    places = _in_order([_place(file) for file in files])
    timed = places[0].t_us is not None
    times = [place.t_us for place in places] if timed else [n * 1_000_000 for n in range(len(places))]
    t_us = np.array(times, np.int64)
    like = read_image(places[0].file)
    frames = Frames(tuple(place.file for place in places), t_us, timed, lambda file: _alike(file, like))
    film = film_of(files[0].parent, frames)
    return Drive(
        film, _track(places, t_us), simulate=None, recipe=Recipe(images=ImageSettings(crop_bottom=0.0))
    )


def write_images(traverse: Traverse, folder: str | Path, overwrite: bool = False) -> int:
    """Write the images of a drive as the folder `folder`, their positions in their names; returns how many.

    Call it `database` or `queries` in one parent. Images without a position are left out. Raises TrackError
    where no image has one, TraverseError for images that are neither grey nor RGB, OutputError as
    `storage.new_folder`.
    """
    from PIL import Image

    track = traverse.track
    if track is None or not track.known.any():
        raise TrackError("the drive has no positions: make it with its `track`, then write its images")
    if traverse.images.ndim == 4 and traverse.images.shape[-1] != 3:
        raise TraverseError(
            f"images of {traverse.images.shape[-1]} channels cannot be written as .jpg: make them grey or RGB"
        )
    with new_folder(folder, overwrite, MARK) as made:
        names: Counter[str] = Counter()
        for n in np.flatnonzero(track.known):
            image = Image.fromarray(np.ascontiguousarray(traverse.images[n]))
            name = _image_name(track, int(n), int(traverse.t_us[n]))
            names[name] += 1
            if names[name] > 1:  # of one place and time: the note tells them apart
                name = name.replace("us@.jpg", f"us-{names[name]}@.jpg")
            image.save(made / name, quality=_QUALITY, subsampling=0)
    return int(track.known.sum())


def _images(folder: Path, name: str) -> list[Path]:
    """The images of the first split that has them."""
    for split in SPLITS:
        place = folder / split / name
        files = [file for file in place.rglob("*") if is_image(file)]
        if any(file.name.startswith("@") for file in files):
            return sorted(files)
    return []


def _own_images(folder: Path) -> list[Path]:
    """The images of a folder that is itself such a one: its `database`, say."""
    files = [file for file in folder.iterdir() if is_image(file)]
    return sorted(files) if any(file.name.startswith("@") for file in files) else []


def _place(file: Path) -> _Place:
    fields = [*file.name.split("@"), *[""] * 15][:16]
    try:
        easting, northing = float(fields[1]), float(fields[2])
    except ValueError:
        raise TrackError(
            f"{file} does not say where it was taken: its name must begin with @UTM_east@UTM_north@"
        ) from None
    if not (np.isfinite(easting) and np.isfinite(northing)):
        raise TrackError(f"{file}: its position is not a number")
    letter = fields[4].upper() if fields[4].upper() in [*_NORTH, *_SOUTH] else ""
    zone = int(fields[3]) if letter and fields[3].isdecimal() else 0
    if letter and not 1 <= zone <= 60:
        raise TrackError(f"{file}: there is no UTM zone '{fields[3]}{letter}': 10 and S stand for 10S")
    note = _NOTE.fullmatch(fields[14])
    return _Place(file, easting, northing, zone, letter, int(note[1]) if note else None)


def _alike(file: Path, like: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An image in the size and the colours of another."""
    from PIL import Image

    image = read_image(file)
    if image.shape == like.shape:
        return image
    size = (like.shape[1], like.shape[0])
    made = Image.fromarray(image).convert("L" if like.ndim == 2 else "RGB").resize(size, Image.Resampling.BOX)
    return np.asarray(made, np.uint8)


def _in_order(places: list[_Place]) -> list[_Place]:
    """By the times in the notes where all have different ones, else as the files were, without times."""
    if len({place.t_us for place in places} - {None}) == len(places):
        return sorted(places, key=lambda place: place.t_us or 0)
    return [place._replace(t_us=None) for place in places]


def _track(places: list[_Place], t_us: NDArray[np.int64]) -> Track:
    import utm

    zone, northern = _zone(places)
    easting = np.array([place.easting for place in places])
    northing = np.array([place.northing for place in places])
    nowhere = np.full(len(places), np.nan)
    if not zone:
        return Track(t_us, nowhere, nowhere, easting, northing, nowhere, 0, True)
    try:
        latitude, longitude = utm.to_latlon(easting, northing, zone, northern=northern)
    except utm.OutOfRangeError as error:
        raise TrackError(f"{places[0].file.parent}: a position lies outside its UTM zone: {error}") from error
    return Track(t_us, latitude, longitude, easting, northing, nowhere, zone, northern)


def _zone(places: list[_Place]) -> tuple[int, bool]:
    """The one zone, 0 for none, and whether it is in the north; TrackError where there are several."""
    first = places[0]
    for place in places:
        if (place.zone, place.letter in _NORTH) != (first.zone, first.letter in _NORTH):
            raise TrackError(
                f"{first.file.parent} mixes UTM zones: {_named(first)} in {first.file.name}, "
                f"{_named(place)} in {place.file.name}: give all positions in one zone"
            )
    return first.zone, first.letter in _NORTH


def _named(place: _Place) -> str:
    return f"{place.zone}{place.letter}" if place.zone else "none"


def _image_name(track: Track, n: int, t_us: int) -> str:
    zone, letter, latitude, longitude = "", "", "", ""
    if track.zone:
        zone, letter = f"{track.zone:02}", _letter(float(track.latitude[n]))
        latitude, longitude = f"{track.latitude[n]:09.5f}", f"{track.longitude[n]:010.5f}"
    fields = (f"{track.easting[n]:010.2f}", f"{track.northing[n]:010.2f}", zone, letter, latitude, longitude)
    return "@" + "@".join((*fields, "", "", "", "", "", "", "", f"t{t_us}us", ".jpg"))


def _letter(latitude: float) -> str:
    """The band of 8 degrees, C to X without I and O."""
    return "CDEFGHJKLMNPQRSTUVWXX"[int((latitude + 80) // 8)]
