"""Visual place recognition with event cameras: learn a route once, find it again in the dark and in rain."""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
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
