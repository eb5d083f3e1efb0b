"""Visual place recognition with event cameras: learn a route once, find it again in the dark and in rain."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for editors and type checkers; a test holds this list against the one below
    from evplace import matchers as matchers
    from evplace import scorers as scorers
    from evplace.core.errors import EvplaceError as EvplaceError
    from evplace.core.events import Events as Events
    from evplace.drives.to_traverse import open_traverse as open_traverse
    from evplace.evaluation import Result as Result
    from evplace.evaluation import compare as compare
    from evplace.evaluation._evaluate import evaluate as evaluate
    from evplace.imaging.images import ImageSettings as ImageSettings
    from evplace.imaging.images import event_image as event_image
    from evplace.imaging.recipe import Recipe as Recipe
    from evplace.imaging.spacing import SpacingSettings as SpacingSettings
    from evplace.imaging.traverse import Traverse as Traverse
    from evplace.imaging.windows import WindowSettings as WindowSettings
    from evplace.localizer import Localizer as Localizer
    from evplace.localizer import Match as Match
    from evplace.placemap import PlaceMap as PlaceMap
    from evplace.placemap import train as train
    from evplace.places import PlaceGrid as PlaceGrid
    from evplace.places import PlaceRuns as PlaceRuns
    from evplace.scorers.network import TrainSettings as TrainSettings
    from evplace.sources.cleaning import CleaningSettings as CleaningSettings
    from evplace.sources.readers import Recording as Recording
    from evplace.sources.readers import open_recording as open_recording
    from evplace.sources.tracks import Track as Track
    from evplace.sources.tracks import open_track as open_track

__version__ = "0.1.0"

_PUBLIC = {
    "CleaningSettings": "evplace.sources.cleaning",
    "Events": "evplace.core.events",
    "EvplaceError": "evplace.core.errors",
    "ImageSettings": "evplace.imaging.images",
    "Localizer": "evplace.localizer",
    "Match": "evplace.localizer",
    "PlaceGrid": "evplace.places",
    "PlaceMap": "evplace.placemap",
    "PlaceRuns": "evplace.places",
    "Recipe": "evplace.imaging.recipe",
    "Recording": "evplace.sources.readers",
    "Result": "evplace.evaluation",
    "SpacingSettings": "evplace.imaging.spacing",
    "Track": "evplace.sources.tracks",
    "TrainSettings": "evplace.scorers.network",
    "Traverse": "evplace.imaging.traverse",
    "WindowSettings": "evplace.imaging.windows",
    "compare": "evplace.evaluation",
    "evaluate": "evplace.evaluation._evaluate",
    "event_image": "evplace.imaging.images",
    "open_recording": "evplace.sources.readers",
    "open_track": "evplace.sources.tracks",
    "open_traverse": "evplace.drives.to_traverse",
    "train": "evplace.placemap",
}
"""Public name -> module. Loaded on first use, so that `import evplace` costs numpy at most."""
_PACKAGES = ("matchers", "scorers")
"""Families whose parts are objects: `evplace.matchers.Local(K=5)`."""

__all__ = sorted([*_PUBLIC, *_PACKAGES, "__version__"])


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        return importlib.import_module(f"evplace.{name}")
    if name not in _PUBLIC:
        raise AttributeError(f"module 'evplace' has no attribute '{name}'")
    return getattr(importlib.import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return __all__
