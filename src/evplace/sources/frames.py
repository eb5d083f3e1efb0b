"""A folder of camera images, in order, with their times.

The order comes from a .csv list (a column of file names), else from the file names; the times from
`timestamps.txt` (one a line), else from the file names where these are times (as EuRoC's, RobotCar's and
TUM's are), else they are made up, at `fps` images a second.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError, TraverseError, UnreadableImageError
from evplace.core.storage import is_stream
from evplace.sources._times import UNIT_US, Unit, dated_unit, number, number_us

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
SLOWEST_S = 60.0
"""Images this far apart are told of: their times may be in another unit."""
_TIME_IN_NAME = re.compile(r"[0-9]{9,20}(\.[0-9]{1,12})?$")
_TIME_AS_NAME = re.compile(r"[0-9]{1,20}(\.[0-9]{1,12})?$")


def read_image(file: Path) -> NDArray[np.uint8]:
    """An image file as uint8 (H, W), or (H, W, 3) where it has colours; 16 bits are scaled to 8.

    UnreadableImageError where it is damaged, TraverseError where it is missing or has 32 bits a pixel.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(file) as image:
            if image.mode.startswith("I;16") or (image.mode == "I" and image.format == "PNG"):
                return (np.asarray(image).astype(np.uint32) // 257).astype(np.uint8)
            if image.mode in ("I", "F"):
                raise TraverseError(
                    f"{file} has 32 bits a pixel, and does not say what is white: save it with 8 or 16 bits"
                )
            return np.asarray(image.convert("L" if image.mode in ("1", "L") else "RGB"), np.uint8)
    except FileNotFoundError:
        raise TraverseError(f"there is no image {file}") from None
    except Image.DecompressionBombError as error:
        raise TraverseError(f"the image {file} is too large to be a camera's: {error}") from error
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError) as error:
        raise UnreadableImageError(f"cannot read the image {file}: {error}") from error


@dataclass(frozen=True)
class Frames:
    """Images on disk, in order."""

    files: tuple[Path, ...]
    """The image files."""
    t_us: NDArray[np.int64]
    """(n,) times in microseconds, increasing."""
    timed: bool
    """Whether the times were given, not made up from a rate."""
    read: Callable[[Path], NDArray[np.uint8]] = read_image
    """How a file becomes an image: data sets whose files are raw sensor data have their own way."""
    notes: tuple[str, ...] = ()
    """What was guessed of the times, a sentence each."""

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[NDArray[np.uint8]]:
        """Each image as uint8 (H, W), or (H, W, 3) where it has colours."""
        return (self.read(file) for file in self.files)


def is_frames(path: Path) -> bool:
    """Whether `path` is a folder that holds images."""
    return path.is_dir() and any(is_image(file) for file in path.iterdir())


def is_image(file: Path) -> bool:
    """Whether a file's name is that of an image; hidden files are none, whatever their suffix."""
    return file.suffix.lower() in SUFFIXES and not file.name.startswith(".")


def image_files(folder: Path) -> list[Path]:
    """The image files of a folder in natural order: numbers in their names count as numbers."""
    files = [file for file in folder.iterdir() if is_image(file)]
    return sorted(files, key=_natural)


def _natural(file: Path) -> tuple[list[tuple[bool, Decimal, str]], str]:
    """Text and numbers of a name in turn, a name that is one decimal number as that; then the whole name."""
    if re.fullmatch(r"[0-9]+\.[0-9]+", file.stem):
        parts = [file.stem]
    else:
        parts = [part for part in re.split(r"([0-9]+)", file.stem) if part]
    told = [
        (False, Decimal(part), "") if part[0] in "0123456789" else (True, Decimal(0), part) for part in parts
    ]
    return told, file.name


def open_frames(
    path: str | Path, listing: str | Path | None = None, fps: float = 30.0, time_unit: str | None = None
) -> Frames:
    """The images of a folder.

    `listing` is a .csv or .txt with a file name in the first column of each line: only those are taken, in
    its order. `time_unit` (s, ms, us or ns) is that of the times in timestamps.txt or in the file names; by
    default the one in which they are dates, else s. Raises TraverseError for a folder without images, or for
    times that do not fit, SettingsError for an `fps` or a unit that cannot be.
    """
    check_rate(fps)
    folder = Path(path)
    if time_unit is not None and time_unit not in UNIT_US:
        raise SettingsError(f"the setting 'time_unit' cannot be {time_unit!r}: it takes s, ms, us or ns")
    if not folder.is_dir():
        raise TraverseError(f"{folder} is no folder of images")
    files = _listed(folder, Path(listing)) if listing else image_files(folder)
    if not files:
        raise TraverseError(f"{folder} holds no images: known are {', '.join(SUFFIXES)}")
    times = folder / "timestamps.txt"
    if not times.exists():
        times = folder.parent / "timestamps.txt"
    if times.exists():
        t_us, notes = _times(times, len(files), time_unit)
        return Frames(tuple(files), t_us, True, notes=notes)
    named = _times_in_names(files, time_unit)
    if named is not None:
        return Frames(tuple(files), named[0], True, notes=named[1])
    if time_unit is not None:
        raise SettingsError(
            f"the images in {folder} have no times of the unit {time_unit}: their names are no numbers that "
            "increase, and there is no timestamps.txt"
        )
    return Frames(tuple(files), np.floor(np.arange(len(files)) * 1_000_000 / fps).astype(np.int64), False)


def check_rate(fps: float) -> None:
    """SettingsError for a rate of images that none can have."""
    if not 0 < fps <= 1e6:
        raise SettingsError(f"the setting 'fps' cannot be {fps}: it takes over 0, up to 1e6")


def _listed(folder: Path, listing: Path) -> list[Path]:
    if is_stream(listing):
        raise TraverseError(f"{listing} is a pipe or a device: lists are read from files, so save it first")
    try:
        rows = list(csv.reader(listing.read_text("utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise TraverseError(f"cannot read the list of images {listing}: {error}") from error
    names = [row[0].strip() for row in rows if row]
    files = [folder / name for name in names if Path(name).suffix.lower() in SUFFIXES]
    missing = [file.name for file in files if not file.exists()]
    if missing:
        raise TraverseError(f"{listing} names {len(missing)} images that {folder} lacks, first {missing[0]}")
    return files


def _times(path: Path, n: int, time_unit: str | None) -> tuple[NDArray[np.int64], tuple[str, ...]]:
    """Times, one a line, as microseconds, and what was guessed of them."""
    try:
        texts = [line.split()[-1] for line in path.read_text("utf-8-sig").splitlines() if _is_told(line)]
        if any("," in text for text in texts):
            raise ValueError("a comma")
        told = time_unit or dated_unit(number(text) for text in texts)
        t_us = np.array([number_us(text, told or "s") for text in texts], np.int64)
    except (ValueError, UnicodeDecodeError) as error:
        raise TraverseError(f"{path} must hold one time in seconds a line: {error}") from error
    if len(t_us) != n:
        raise TraverseError(f"{path} holds {len(t_us)} times for {n} images: one a line is needed")
    if (np.diff(t_us) <= 0).any():
        first = int(np.argmax(np.diff(t_us) <= 0)) + 1
        raise TraverseError(f"{path}: time {first + 1} does not come after the one before it")
    if time_unit is None and told not in (None, "s"):
        return t_us, (f"the times in {path.name} are taken in {told}, in which they are dates",)
    apart_s = float(np.median(np.diff(t_us))) / 1e6 if n > 1 else 0.0
    if time_unit is None and told is None and apart_s > SLOWEST_S:
        slow = f"the images are {apart_s:,.0f} s apart, as {path.name} is taken in s"
        return t_us, (f"{slow}: if it is another unit, say so with `time_unit`",)
    return t_us, ()


def _is_told(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _times_in_names(
    files: list[Path], time_unit: str | None
) -> tuple[NDArray[np.int64], tuple[str, ...]] | None:
    """The times that end the names of all files: where they increase, and are dates or of a given unit."""
    pattern = _TIME_IN_NAME if time_unit is None else _TIME_AS_NAME
    found = [pattern.search(file.stem) for file in files]
    texts = [match[0] for match in found if match]
    unit: str | Unit | None = time_unit or dated_unit(number(text) for text in texts)
    if len(texts) < len(files) or unit is None:
        return None
    try:
        t_us = np.array([number_us(text, unit) for text in texts], np.int64)
    except ValueError:
        return None
    if (np.diff(t_us) <= 0).any():
        return None
    return t_us, (f"the times of the images are those in their names, {texts[0]} {unit} the first",)
