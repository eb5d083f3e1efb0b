"""Masks of pixels: from files, and measured over a recording."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError, InputError, RecordingError
from evplace.core.events import Events, Size
from evplace.core.storage import is_stream, read_array
from evplace.sources.cleaning._pixels import Mask, count_pixels, hot_pixels, static_pixels
from evplace.sources.cleaning._settings import CleaningSettings

MaskSource = str | Path | NDArray[Any]
"""A file of pixels or of a mask, or the mask itself (H, W)."""


def pixel_mask(
    packets: Iterable[Events], size: Size, settings: CleaningSettings, given: MaskSource | None = None
) -> Mask | None:
    """(H, W) True at the pixels to leave out of a recording: those `given`, and those measured.

    `packets` are read to their end where `settings` ask for a measurement; of a damaged recording, the good
    part counts. None where no pixel is to be left out by either. RecordingError as in `read_mask`.
    """
    mask = None if given is None else read_mask(given, size)
    if not settings.measured:
        return mask
    counts = count_pixels(_good_part(packets), size)
    whole = np.zeros(counts.shape, np.bool_) if mask is None else mask
    if settings.mask_hot:
        whole = whole | hot_pixels(counts)
    if settings.static_mask:
        whole = whole | static_pixels(counts)
    return whole


def read_mask(given: MaskSource, size: Size) -> Mask:
    """(H, W) True at the pixels that `given` names, for a sensor of `size` (width, height).

    A text file has a line `x,y` a pixel (blanks do as well, # starts a remark, a header x,y may stand first);
    a .npy file, or an array, is a mask (H, W) of booleans or the pixels (n, 2) as whole numbers.
    RecordingError where it is neither or does not fit the sensor.
    """
    name = "the mask" if isinstance(given, np.ndarray) else f"the mask {given}"
    values = given if isinstance(given, np.ndarray) else _loaded(Path(given), name)
    shape = (size[1], size[0])
    if values.dtype == np.bool_:
        if values.shape != shape:
            raise RecordingError(f"{name} has the shape {values.shape}, the sensor {shape}")
        return np.array(values, np.bool_)
    if values.ndim != 2 or values.shape[1] != 2 or values.dtype.kind not in "iu":
        raise RecordingError(
            f"{name} is {values.dtype} {values.shape}: it must be booleans {shape} or pixels x, y (n, 2)"
        )
    outside = ((values < 0) | (values >= np.array(size))).any(axis=1)
    if outside.any():
        x, y = values[outside][0]
        raise RecordingError(f"{name} has the pixel {x},{y}, which a {size[0]}x{size[1]} sensor lacks")
    mask = np.zeros(shape, np.bool_)
    mask[values[:, 1], values[:, 0]] = True
    return mask


def _loaded(path: Path, name: str) -> NDArray[Any]:
    if is_stream(path):
        raise RecordingError(f"{name} is a pipe or a device: masks are read from files, so save it first")
    try:
        with path.open("rb") as file:
            is_array = file.read(6) == b"\x93NUMPY"
        return read_array(path, name) if is_array else _pixels(path, name)
    except OSError as error:
        raise RecordingError(f"cannot read {name}: {error.strerror or error}") from error
    except (InputError, ValueError) as error:
        raise RecordingError(f"{name} cannot be used: {error}") from error


def _pixels(path: Path, name: str) -> NDArray[np.int64]:
    """(n, 2) the pixels of a text file."""
    found = []
    for number, line in enumerate(path.read_text("ascii").splitlines(), 1):
        text = line.partition("#")[0].strip()
        pixel = re.fullmatch(r"(\d{1,5})[\s,;]+(\d{1,5})", text)
        if pixel is not None:
            found.append((int(pixel[1]), int(pixel[2])))
        elif text and not (re.fullmatch(r"x[\s,;]+y", text.lower()) and not found):
            raise RecordingError(f"{name}: line {number} is no pixel: write x,y")
    return np.array(found, np.int64).reshape(-1, 2)


def _good_part(packets: Iterable[Events]) -> Iterator[Events]:
    with contextlib.suppress(DamagedRecordingError):  # it is raised again when the events are read
        yield from packets
