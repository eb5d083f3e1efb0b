"""Event images: a window of events as the small image that scorers see (paper, Eq. 3 and section 3.2).

The order is the paper's: a binary image at the sensor's size, blurred with the 3x3 Gaussian, its bottom
quarter removed, resized to 160x90. Blur, crop and resize are one fused pass (see `_resampling`). Images are
uint8 in the store, value = round(255 v), and v = value / 255 as float32 in [0, 1] for the network.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.compiled import njit
from evplace.core.errors import SettingsError, TraverseError
from evplace.core.events import Events, Size
from evplace.imaging._resampling import Resampler, Resize, axis_map
from evplace.imaging.representations import Representation, grid_of
from evplace.imaging.tones import Tone, toned

MOST = {"width": 1 << 13, "height": 1 << 13, "saturation": 1 << 31, "tau_ms": 1e9, "bins": 1 << 8}
"""What settings of images go up to: sensors have fewer pixels, and an image must fit into memory."""
MOST_NUMBERS = 1 << 25
"""Numbers that an image has at most."""


@dataclass(frozen=True)
class ImageSettings:
    """How a window of events becomes an image."""

    representation: str = "binary"
    """binary (paper, Eq. 3), polarity, count, time-surface, voxel ...: `evplace list representations`."""
    width: int = 160
    """Columns of the image (paper: 160)."""
    height: int = 90
    """Rows of the image (paper: 90)."""
    blur: bool = True
    """Blur the event image 3x3 (paper: yes)."""
    blur_last: bool = False
    """Blur after crop and resize, as the author's notebook does (paper: before)."""
    crop_bottom: float = 0.25
    """Share of rows removed at the bottom before the resize (paper: a quarter)."""
    resize: Resize = "area"
    """area (each pixel is the mean over its share) or linear; the paper does not say."""
    saturation: int = 5
    """Events at which a pixel of count or voxel is full (ours)."""
    tau_ms: float = 30.0
    """Decay time of time-surface in milliseconds (ours: about one window)."""
    bins: int = 5
    """Time bins of voxel (ours)."""
    tone: Tone = "plain"
    """For camera images: plain (paper), normalised brightness and contrast, or edges (ours)."""

    def __post_init__(self) -> None:
        known = families.names("representations")
        if self.representation not in known:
            raise SettingsError(
                f"the setting 'representation' cannot be '{self.representation}': "
                f"known are {', '.join(known)}"
            )
        if not 0 <= self.crop_bottom < 1:
            raise SettingsError(
                f"the setting 'crop_bottom' cannot be {self.crop_bottom}: it takes 0 to below 1"
            )
        for name, most in MOST.items():
            if not 0 < getattr(self, name) <= most:
                raise SettingsError(
                    f"the setting '{name}' cannot be {getattr(self, name)}: it takes above 0, up to {most:,}"
                )
        if self.width * self.height * self.bins > MOST_NUMBERS:
            raise SettingsError(
                f"images of {self.width}x{self.height} in {self.bins} bins are too large: 'width', 'height' "
                f"and 'bins' make up to {MOST_NUMBERS:,} numbers"
            )

    @property
    def used(self) -> tuple[str, ...]:
        """Which of the settings that belong to some representations make a difference to this one."""
        used: tuple[str, ...] = families.load("representations", self.representation).used
        return used


class Imager:
    """Collects the events of one window after another; gives an image at each window's end."""

    def __init__(self, size: Size, settings: ImageSettings | None = None) -> None:
        """For a sensor of `size` (width, height) in pixels."""
        self.settings = settings or ImageSettings()
        self.size = size
        self._grid = _representation(size, self.settings)
        self._resampler = _resampler(size, self.settings, self.settings.blur and not self.settings.blur_last)
        self._blur = _blur_of_images(self.settings)

    @property
    def grid(self) -> NDArray[Any] | None:
        """What readers may mark in place of `add`: see `grid_of` of the representations."""
        return grid_of(self._grid)

    def add(self, events: Events) -> None:
        """Take events of the open window.

        Raises RecordingError where an event lies outside the sensor.
        """
        self._grid.add(events)

    def image(self, t_us: int) -> NDArray[np.uint8]:
        """(h, w) or, with several channels, (h, w, C): the window ending at `t_us`; starts the next one."""
        return _to_bytes(self.image_float(t_us))

    def image_float(self, t_us: int) -> NDArray[np.float32]:
        """As `image`, as float32 in [0, 1] before the rounding to 256 steps."""
        layers = [_resampled(self._resampler, grid) for grid in self._grid.channels(t_us)]
        self._grid.clear()
        if self._blur is not None:
            layers = [self._blur.values(layer) for layer in layers]
        return layers[0] if len(layers) == 1 else np.stack(layers, axis=-1)


def event_image(events: Events, settings: ImageSettings | None = None) -> NDArray[np.float32]:
    """The image of one window of events: (90, 160) float32 in [0, 1] by default; (h, w, C) with channels."""
    imager = Imager(events.size, settings)
    imager.add(events)
    return imager.image_float(int(events.t_us[-1]) if len(events) else 0)


def frame_image(frame: NDArray[np.uint8], settings: ImageSettings | None = None) -> NDArray[np.uint8]:
    """A camera's frame (H, W) or (H, W, 3), cropped and resized without blur: the paper's colour input.

    It gets the settings' tone; edges have no colours.
    """
    settings = settings or ImageSettings()
    if frame.ndim not in (2, 3) or frame.dtype != np.uint8 or 0 in frame.shape:
        raise TraverseError(
            f"a frame must be uint8 (height, width) or (height, width, 3), "
            f"this one is {frame.dtype} {frame.shape}"
        )
    layers = frame[..., None] if frame.ndim == 2 else frame
    resampler = _resampler((frame.shape[1], frame.shape[0]), settings, blur=False)
    grids = np.moveaxis(layers, -1, 0).astype(np.float32) / np.float32(255)
    small = [_to_bytes(resampler.values(np.ascontiguousarray(grid))) for grid in grids]
    image = small[0] if frame.ndim == 2 else np.stack(small, axis=-1)
    changed: NDArray[np.uint8] = toned(image[None], settings.tone)[0]
    return changed


def _resampler(size: Size, settings: ImageSettings, blur: bool) -> Resampler:
    width, height = size
    kept = int(height * (1 - Fraction(settings.crop_bottom).limit_denominator(1000)))
    if kept < 1:
        raise SettingsError(f"'crop_bottom' {settings.crop_bottom} leaves nothing of {height} rows")
    rows = axis_map(height, kept, settings.height, blur, settings.resize)
    return Resampler(rows, axis_map(width, width, settings.width, blur, settings.resize))


def _blur_of_images(settings: ImageSettings) -> Resampler | None:
    """What blurs the small image, where it is blurred last."""
    if not (settings.blur and settings.blur_last):
        return None
    rows, columns = settings.height, settings.width
    return Resampler(
        axis_map(rows, rows, rows, True, settings.resize),
        axis_map(columns, columns, columns, True, settings.resize),
    )


def _representation(size: Size, settings: ImageSettings) -> Representation:
    kind = families.load("representations", settings.representation)
    opened: Representation = kind(size, **{name: getattr(settings, name) for name in kind.used})
    return opened


def _resampled(resampler: Resampler, grid: NDArray[Any]) -> NDArray[np.float32]:
    return resampler.binary(grid) if grid.dtype == np.int8 else resampler.values(grid)


def _to_bytes(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    small = np.empty(image.shape, np.uint8)
    _round(image.reshape(-1), small.reshape(-1))
    return small


@njit(cache=True)
def _round(image: Any, small: Any) -> None:
    for i in range(len(image)):
        small[i] = np.int32(image[i] * np.float32(255) + np.float32(0.5))
