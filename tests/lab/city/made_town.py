"""The town that the city's tests look at, built once."""

from __future__ import annotations

import functools

from evplace_lab.city import build_town
from evplace_lab.city.town import Town


@functools.cache
def made_town() -> Town:
    """The benchmark's town; nobody writes into its arrays."""
    town = build_town(0)
    for array in (*town.scene, town.lamps, town.trees, town.signals):
        array.setflags(write=False)
    return town
