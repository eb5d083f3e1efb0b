"""A folder of camera images, in order, with their times.

The order comes from a .csv list (a column of file names), else from the file names; the times from
`timestamps.txt` (one in seconds a line), else they are made up, at `fps` images a second.
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

from evplace.core.errors import SettingsError, TraverseError

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")


def read_image(file: Path) -> NDArray[np.uint8]:
    """An image file as uint8 (H, W), or (H, W, 3) where it has colours; 16 bits are scaled to 8.

    TraverseError where it cannot be read, or has 32 bits a pixel.
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
        raise TraverseError(f"cannot read the image {file}: {error}") from error


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

    def __len__(self) -> int:
        return len(self.files)

    def __iter__(self) -> Iterator[NDArray[np.uint8]]:
        """Each image as uint8 (H, W), or (H, W, 3) where it has colours."""
        return (self.read(file) for file in self.files)


def is_frames(path: Path) -> bool:
    """Whether `path` is a folder that holds images."""
    return path.is_dir() and any(file.suffix.lower() in SUFFIXES for file in path.iterdir())


def image_files(folder: Path) -> list[Path]:
    """The image files of a folder in natural order: numbers in their names count as numbers."""
    files = [file for file in folder.iterdir() if file.suffix.lower() in SUFFIXES]
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


def open_frames(path: str | Path, listing: str | Path | None = None, fps: float = 30.0) -> Frames:
    """The images of a folder.

    `listing` is a .csv or .txt with a file name in the first column of each line: only those are taken, in
    its order. Raises TraverseError for a folder without images, or for times that do not fit,
    SettingsError for an `fps` that cannot be.
    """
    check_rate(fps)
    folder = Path(path)
    if not folder.is_dir():
        raise TraverseError(f"{folder} is no folder of images")
    files = _listed(folder, Path(listing)) if listing else image_files(folder)
    if not files:
        raise TraverseError(f"{folder} holds no images: known are {', '.join(SUFFIXES)}")
    times = folder / "timestamps.txt"
    if not times.exists():
        times = folder.parent / "timestamps.txt"
    if times.exists():
        return Frames(tuple(files), _times(times, len(files)), True)
    return Frames(tuple(files), np.floor(np.arange(len(files)) * 1_000_000 / fps).astype(np.int64), False)


def check_rate(fps: float) -> None:
    """SettingsError for a rate of images that none can have."""
    if not 0 < fps <= 1e6:
        raise SettingsError(f"the setting 'fps' cannot be {fps}: it takes over 0, up to 1e6")


def _listed(folder: Path, listing: Path) -> list[Path]:
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


def _times(path: Path, n: int) -> NDArray[np.int64]:
    """Times in seconds, one a line, as microseconds."""
    try:
        seconds = [line.split()[-1] for line in path.read_text("utf-8").splitlines() if line.strip()]
        t_us = np.array([round(float(value) * 1e6) for value in seconds], np.int64)
    except (ValueError, OverflowError, UnicodeDecodeError) as error:
        raise TraverseError(f"{path} must hold one time in seconds a line: {error}") from error
    if len(t_us) != n:
        raise TraverseError(f"{path} holds {len(t_us)} times for {n} images: one a line is needed")
    if (np.diff(t_us) <= 0).any():
        first = int(np.argmax(np.diff(t_us) <= 0)) + 1
        raise TraverseError(f"{path}: time {first + 1} does not come after the one before it")
    return t_us
