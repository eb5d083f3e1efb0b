"""LENS: small event-count images of several places and drives, as the LENS system is trained on.

Citation: A. D. Hines, M. Milford and T. Fischer, "A compact neuromorphic system for ultra
energy-efficient, on-device robot localization", Science Robotics, 2025. Licence: MIT.
Address: https://github.com/AdamDHines/LENS, folder lens/dataset.

Layout, checked against the files:

    sunset1.csv                                            Image_name,index: the images and their order
    brisevent/davis346/sunset1/images_00000.png            counts of events in a second, 8 bits
    brisevent/davis346/sunset2_sunset1_GT.npy              truth of a pair, (references, queries): for
                                                           `evplace evaluate --truth`

The images are event images already: they are kept as they are, without crop and blur, at their own size.
They have no times and no positions; they count as one a second, as they were made.
"""

from __future__ import annotations

from pathlib import Path

from evplace.core.errors import DatasetError
from evplace.drives.datasets import Drive
from evplace.imaging.images import ImageSettings
from evplace.imaging.recipe import Recipe
from evplace.sources.film import film_of
from evplace.sources.frames import is_frames, open_frames

NEEDS = "NAME.csv (Image_name,index) and PLACE/CAMERA/NAME/*.png"
IMAGES_A_SECOND = 1.0


def recognises(folder: Path) -> bool:
    """Whether there is a list of images with the set's header."""
    return bool(drives(folder))


def drives(folder: Path) -> list[str]:
    """The drives that a list names, and that have a folder."""
    return sorted(
        file.stem
        for file in folder.glob("*.csv")
        if file.is_file() and _is_listing(file) and any(folder.glob(f"*/*/{file.stem}"))
    )


def open_drive(folder: Path, name: str) -> Drive:
    """The images of the list, as they are."""
    places = [place for place in sorted(folder.glob(f"*/*/{name}")) if is_frames(place)]
    if not places:
        raise DatasetError(f"the images of {name} are missing: no folder {folder}/*/*/{name} holds any")
    frames = open_frames(places[0], folder / f"{name}.csv", IMAGES_A_SECOND)
    film = film_of(places[0], frames)
    width, height = film.size
    images = ImageSettings(width=width, height=height, blur=False, crop_bottom=0.0)
    return Drive(film, simulate=None, recipe=Recipe(images=images))


def _is_listing(file: Path) -> bool:
    with file.open("rb") as opened:
        return opened.readline(64).removeprefix(b"\xef\xbb\xbf").strip().lower() == b"image_name,index"
