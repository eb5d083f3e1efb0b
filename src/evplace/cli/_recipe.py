"""Which settings of images a command line names."""

from __future__ import annotations

from typing import Any, Protocol

from evplace.core.events import Size
from evplace.imaging.images import ImageSettings
from evplace.imaging.spacing import SpacingSettings
from evplace.imaging.windows import WindowSettings
from evplace.sources.cleaning import CleaningSettings


class RecipeArgs(Protocol):
    """The flags of a command that makes images."""

    @property
    def windows(self) -> WindowSettings: ...
    @property
    def images(self) -> ImageSettings: ...
    @property
    def cleaning(self) -> CleaningSettings: ...
    @property
    def spacing(self) -> SpacingSettings: ...
    @property
    def size(self) -> Size | None: ...
    @property
    def given(self) -> tuple[str, ...]: ...


def recipe_settings(args: RecipeArgs) -> dict[str, Any]:
    """The settings that the user named, for `open_traverse`; the others stay as the source has them."""
    owned = {"size": args.size} | vars(args.windows) | vars(args.images) | vars(args.cleaning)
    return {name: owned[name] for name in args.given if name in owned}


def spacing_given(args: RecipeArgs) -> SpacingSettings | None:
    """How far apart images are to be kept, where the user said it."""
    return args.spacing if set(args.given) & set(vars(args.spacing)) else None
