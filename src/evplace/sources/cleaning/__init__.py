"""Events that say nothing of the place: hot pixels, static regions, too quick repeats, flickering lamps.

`CleaningSettings` say what is left out, `pixel_mask` measures where hot and static pixels are, and `Cleaner`
does it, one packet after the other: it stands before the windows, for files and live streams alike. Its parts
can be used alone: `count_pixels` and `FlickerMeter` run over a whole recording, `hot_pixels` and
`static_pixels` make masks of the counts, `without`, `Refractory` and `FlickerFilter` clean. The size of the
packets changes nothing.

The rules and their numbers are ours: the paper does not clean.
"""

from __future__ import annotations

from evplace.sources.cleaning._cleaner import Cleaner
from evplace.sources.cleaning._flicker import MAINS_HZ, FlickerFilter, FlickerMeter
from evplace.sources.cleaning._mask import MaskSource, pixel_mask, read_mask
from evplace.sources.cleaning._pixels import (
    Mask,
    Refractory,
    count_pixels,
    hot_pixels,
    static_pixels,
    without,
)
from evplace.sources.cleaning._settings import CleaningSettings

__all__ = [
    "MAINS_HZ",
    "Cleaner",
    "CleaningSettings",
    "FlickerFilter",
    "FlickerMeter",
    "Mask",
    "MaskSource",
    "Refractory",
    "count_pixels",
    "hot_pixels",
    "pixel_mask",
    "read_mask",
    "static_pixels",
    "without",
]
