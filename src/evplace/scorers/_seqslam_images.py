"""Images as SeqSLAM compares them: grey, cropped, small, with patch-normalised contrast.

OpenSeqSLAM (2013) normalises patches; OpenSeqSLAM 2.0 runs MATLAB's edge-aware `localcontrast` in its place
(threshold 0.5, amount 1), which is not the same and has no counterpart here.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import InputError
from evplace.core.events import Size
from evplace.core.grey import MATLAB, to_grey

Image = NDArray[np.uint8]
"""(height, width) grey levels."""


def prepare(
    image: NDArray[np.uint8],
    size: Size = (64, 32),
    crop: tuple[int, int, int, int] | None = None,
    patch: int | None = 8,
) -> Image:
    """One frame, (height, width) or (height, width, 3), ready for `distances.sad`.

    Grey, cropped to `crop` (left, top, right, bottom) in its own pixels, resized to `size` (width, height)
    with a Lanczos filter, then patches of `patch` x `patch` normalised (None: left as they are).
    """
    from PIL import Image as Pillow

    plain = grey(image)
    if crop is not None:
        left, top, right, bottom = crop
        if not (0 <= left < right <= plain.shape[1] and 0 <= top < bottom <= plain.shape[0]):
            raise InputError(
                f"the crop {crop} does not lie in an image of {plain.shape[1]} x {plain.shape[0]}"
            )
        plain = plain[top:bottom, left:right]
    if plain.shape != size[::-1]:
        plain = np.asarray(Pillow.fromarray(plain).resize(size, Pillow.Resampling.LANCZOS))
    return plain if patch is None else normalise_patches(plain, patch)


def grey(image: NDArray[np.uint8]) -> Image:
    """Luminance of a colour image as rgb2gray has it; a grey one as it is."""
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] != 3):
        raise InputError(
            f"an image is uint8 (height, width) or (height, width, 3), not {image.dtype} {image.shape}"
        )
    return image if image.ndim == 2 else to_grey(image, MATLAB)


def normalise_patches(
    images: Image, side: int = 8, mode: Literal["deviation", "range"] = "deviation"
) -> Image:
    """Each full `side` x `side` block of (..., height, width) images by its own contrast; the rest untouched.

    "deviation" (mode 1 of 2013): 127 plus the rounded number of standard deviations from the mean, which
    leaves few grey levels; "range" (mode 0): stretched to 0..255. A flat block becomes 0.
    """
    if side < 2:
        raise InputError(f"patches of {side} x {side} pixels have no contrast: take a side from 2")
    height, width = (length // side * side for length in images.shape[-2:])
    result = images.copy()
    blocks = images[..., :height, :width].reshape(
        *images.shape[:-2], height // side, side, width // side, side
    )
    patches = blocks.astype(np.float64)
    level = _deviations(patches) if mode == "deviation" else _stretched(patches)
    result[..., :height, :width] = level.reshape(*images.shape[:-2], height, width).astype(np.uint8)
    return result


def _deviations(patches: NDArray[np.float64]) -> NDArray[Any]:
    deviation = patches.std(axis=(-3, -1), ddof=1, keepdims=True)
    z = (patches - patches.mean(axis=(-3, -1), keepdims=True)) / np.where(deviation > 0, deviation, 1)
    return np.where(deviation > 0, 127 + _half_away(z), 0)


def _stretched(patches: NDArray[np.float64]) -> NDArray[Any]:
    least, most = patches.min(axis=(-3, -1), keepdims=True), patches.max(axis=(-3, -1), keepdims=True)
    return _half_away(255 / np.where(most > least, most - least, 1) * (patches - least))


def _half_away(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rounded as MATLAB does, halves away from zero."""
    rounded: NDArray[np.float64] = np.sign(values) * np.floor(np.abs(values) + 0.5)
    return rounded
