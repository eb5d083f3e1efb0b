"""Visual place recognition with event cameras: learn a route once, find it again in the dark and in rain."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for editors and type checkers; a test holds this list against the one below
    from evplace.capture import open_traverse as open_traverse
    from evplace.cleaning import CleaningSettings as CleaningSettings
    from evplace.errors import EvplaceError as EvplaceError
    from evplace.evaluation import Result as Result
    from evplace.evaluation import compare as compare
    from evplace.events import Events as Events
    from evplace.images import ImageSettings as ImageSettings
    from evplace.images import event_image as event_image
    from evplace.localizer import Localizer as Localizer
    from evplace.localizer import Match as Match
    from evplace.placemap import PlaceMap as PlaceMap
    from evplace.places import PlaceGrid as PlaceGrid
    from evplace.places import PlaceRuns as PlaceRuns
    from evplace.readers import Recording as Recording
    from evplace.readers import open_recording as open_recording
    from evplace.spacing import SpacingSettings as SpacingSettings
    from evplace.tracks import Track as Track
    from evplace.tracks import open_track as open_track
    from evplace.training import TrainSettings as TrainSettings
    from evplace.training import train as train
    from evplace.traverse import Traverse as Traverse
    from evplace.trial import evaluate as evaluate
    from evplace.windows import WindowSettings as WindowSettings

__version__ = "0.1.0"

_PUBLIC = {
    "CleaningSettings": "evplace.cleaning",
    "Events": "evplace.events",
    "EvplaceError": "evplace.errors",
    "ImageSettings": "evplace.images",
    "Localizer": "evplace.localizer",
    "Match": "evplace.localizer",
    "PlaceGrid": "evplace.places",
    "PlaceMap": "evplace.placemap",
    "PlaceRuns": "evplace.places",
    "Recording": "evplace.readers",
    "Result": "evplace.evaluation",
    "SpacingSettings": "evplace.spacing",
    "Track": "evplace.tracks",
    "TrainSettings": "evplace.training",
    "Traverse": "evplace.traverse",
    "WindowSettings": "evplace.windows",
    "compare": "evplace.evaluation",
    "evaluate": "evplace.trial",
    "event_image": "evplace.images",
    "open_recording": "evplace.readers",
    "open_track": "evplace.tracks",
    "open_traverse": "evplace.capture",
    "train": "evplace.training",
}
"""Public name -> module. Loaded on first use, so that `import evplace` costs numpy at most."""

__all__ = sorted([*_PUBLIC, "__version__"])


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'evplace' has no attribute '{name}'")
    return getattr(importlib.import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return __all__
