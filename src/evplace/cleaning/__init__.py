"""Events that say nothing of the place: hot pixels, static regions, too quick repeats, flickering lamps.

First measure: `count_pixels` and `FlickerMeter` run over a whole recording, `hot_pixels` and
`static_pixels` make masks of the counts. Then clean: `without`, `Refractory` and `FlickerFilter` take one
packet after the other; the size of the packets changes nothing.

The rules and their numbers are ours: the paper does not clean.
"""

from __future__ import annotations

from evplace.cleaning._flicker import MAINS_HZ, FlickerFilter, FlickerMeter
from evplace.cleaning._pixels import Refractory, count_pixels, hot_pixels, static_pixels, without

__all__ = [
    "MAINS_HZ",
    "FlickerFilter",
    "FlickerMeter",
    "Refractory",
    "count_pixels",
    "hot_pixels",
    "static_pixels",
    "without",
]
