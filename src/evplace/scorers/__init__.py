"""Images -> score rows: one number for each map item, larger is better. One file a scorer.

Each file holds `Settings`, a frozen dataclass, and `scorer(place_map) -> Scorer`. The settings of a scorer
belong to the map: they are chosen when it is learned.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from evplace.core import families as plugs
from evplace.core import settings
from evplace.core.errors import PlaceMapError
from evplace.placemap import PlaceMap

Rows = NDArray[np.float32]
"""(queries, items) scores."""


class Scorer(Protocol):
    """Compares images with a map."""

    distances: bool
    """Whether the scores are negated distances."""

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """(n, h, w) or (n, h, w, C) uint8 -> (n, items)."""


def open_scorer(place_map: PlaceMap) -> Scorer:
    """The scorer that a map was made for; PlaceMapError where this version does not know it."""
    if place_map.scorer not in plugs.names("scorers"):
        raise PlaceMapError(
            f"the map wants the scorer '{place_map.scorer}', which this version does not have"
        )
    scorer: Scorer = plugs.load("scorers", place_map.scorer).scorer(place_map)
    return scorer


def checked_settings(name: str, values: dict[str, object]) -> dict[str, object]:
    """The resolved settings of the scorer `name`; SettingsError for an unknown name or setting."""
    return settings.to_dict(settings.make(plugs.load("scorers", name).Settings, values))


def references_of(place_map: PlaceMap) -> NDArray[np.uint8]:
    """The reference images of a map; PlaceMapError where it holds none."""
    if place_map.references is None:
        raise PlaceMapError(f"the map holds no reference images, which the scorer '{place_map.scorer}' needs")
    return place_map.references
