"""Grey of colours: one weighted sum, wherever colour images become grey ones."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Weights = tuple[float, float, float]
"""Of red, green and blue; they add up to 1."""

BT601: Weights = (0.299, 0.587, 0.114)
"""ITU-R BT.601: the field's usual grey, and that of video decoders and Pillow."""
MATLAB: Weights = (0.298936, 0.587043, 0.114021)
"""MATLAB's rgb2gray: the same before BT.601 rounds it. One level in two hundred differs by one, and what was
published with SeqSLAM was made with these."""


def luminance(colours: NDArray[Any], weights: Weights = BT601) -> NDArray[np.floating[Any]]:
    """(...) of colours (..., 3): floats as they came, integers as float64."""
    kind = colours.dtype if colours.dtype.kind == "f" else np.float64
    summed: NDArray[np.floating[Any]] = colours @ np.asarray(weights, kind)
    return summed


def to_grey(colours: NDArray[np.uint8], weights: Weights = BT601) -> NDArray[np.uint8]:
    """(...) uint8 of colours (..., 3) uint8, rounded half up."""
    return (luminance(colours, weights) + 0.5).astype(np.uint8)
