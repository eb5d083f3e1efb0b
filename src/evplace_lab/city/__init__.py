"""The virtual city: a data set that needs no download.

A town of one seed, driven along two overlapping paths under seven conditions, rendered as linear light with
exact poses and turned into events. The condition, the traffic and the driver's small habits are all that
changes from one drive to the next. `city-v1` is frozen: its settings were set by eye, before any
recognition was measured on it.
"""

from __future__ import annotations

from evplace_lab.city.conditions import CONDITIONS
from evplace_lab.city.film import CityFrame, Film, GeoPose
from evplace_lab.city.generation import Progress, generate
from evplace_lab.city.plan import VERSION, CitySettings
from evplace_lab.city.previewing import moving_preview, preview
from evplace_lab.city.town import Town, build_town

__all__ = [
    "CONDITIONS",
    "VERSION",
    "CityFrame",
    "CitySettings",
    "Film",
    "GeoPose",
    "Progress",
    "Town",
    "build_town",
    "generate",
    "moving_preview",
    "preview",
]
