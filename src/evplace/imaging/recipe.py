"""How the images of a drive are made, as one value that travels with them.

A traverse and a map each carry their recipe. Images that were made otherwise cannot be compared, so a query
is made by the map's recipe, and one that was made by another is refused.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any, Literal

from evplace.core import settings
from evplace.core.errors import SettingsError, TraverseError
from evplace.core.events import Size
from evplace.imaging.images import ImageSettings
from evplace.imaging.windows import WindowSettings
from evplace.sources.cleaning import CleaningSettings

Kind = Literal["events", "frames"]
"""Event images, simulated where there are no events; or the camera's own images."""
OF_FRAMES = ("width", "height", "crop_bottom", "resize", "tone")
"""Settings of images that camera images take."""
OF_EVENTS = ("dt", "count", "representation", "blur", "blur_last", "saturation", "tau_ms", "bins")
"""Settings that camera images do not take."""
OF_THE_DRIVE = ("mask_hot", "static_mask")
"""Which pixels are broken or see the bonnet differs from drive to drive."""


@dataclass(frozen=True)
class Recipe:
    """How images are made."""

    kind: Kind | None = None
    """"events", or "frames": a camera's own images; None where a source may have either."""
    size: Size | None = None
    """Width and height of the sensor in pixels; None where the source says it."""
    windows: WindowSettings = field(default_factory=WindowSettings)
    """How events are cut; frames are not."""
    images: ImageSettings = field(default_factory=ImageSettings)
    """How a window of events, or a frame, becomes an image."""
    cleaning: CleaningSettings = field(default_factory=CleaningSettings)
    """What is taken out of the events; frames have none."""

    def changed(self, **values: object) -> Recipe:
        """The same with other values of single settings: `recipe.changed(dt="1/60", width=80)`.

        SettingsError for an unknown name or a value that cannot be.
        """
        for name in values:
            if name not in _OWNERS:
                raise SettingsError(f"unknown setting '{name}': known are {', '.join(sorted(_OWNERS))}")
        parts: dict[str, Any] = {name: values[name] for name in ("kind", "size") if name in values}
        for part in ("windows", "images", "cleaning"):
            named = {name: value for name, value in values.items() if _OWNERS[name] == part}
            if named:
                own = getattr(self, part)
                parts[part] = settings.make(type(own), named, own)
        return dataclasses.replace(self, **parts)

    def to_dict(self) -> dict[str, Any]:
        """As plain values, for JSON; `from_dict` reads them."""
        return settings.to_dict(self)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Recipe:
        """The recipe that `to_dict` wrote; SettingsError where it is damaged."""
        size = values.get("size")
        if size is not None and not _is_size(size):
            raise SettingsError(f"the size of the sensor cannot be {size!r}: it takes a width and a height")
        if values.get("kind") not in (None, "events", "frames"):
            raise SettingsError(f"the kind of images cannot be {values['kind']!r}: 'events' or 'frames'")
        return cls(
            values.get("kind"),
            None if size is None else (size[0], size[1]),
            _part(WindowSettings, values, "windows"),
            _part(ImageSettings, values, "images"),
            _part(CleaningSettings, values, "cleaning"),
        )

    def differences(self, other: Recipe) -> dict[str, tuple[object, object]]:
        """Setting -> its values here and there, where images made by the two differ."""
        here, there = self._effective(), other._effective()
        names = [name for name in here if name in there and None not in (here[name], there[name])]
        apart = {name: (here[name], there[name]) for name in names if here[name] != there[name]}
        return {"kind": apart["kind"]} if "kind" in apart else apart

    def require_same(self, other: Recipe, here: str, there: str, way_out: str) -> None:
        """TraverseError with both values where images made by the two recipes cannot be compared.

        `here` and `there` name what was made by each, `way_out` says what to do. Masks of hot and static
        pixels belong to the drive and may differ.
        """
        apart = {name: pair for name, pair in self.differences(other).items() if name not in OF_THE_DRIVE}
        for name, (ours, theirs) in apart.items():
            more = f" (and {', '.join(list(apart)[1:])})" if len(apart) > 1 else ""
            raise TraverseError(
                f"{here} was made with {name} {shown(ours)}, {there} with {shown(theirs)}{more}: {way_out}"
            )

    def _effective(self) -> dict[str, object]:
        """The settings that make a difference to the images."""
        images = {name: value for name, value in vars(self.images).items() if name != "tone"}
        if self.kind == "frames":
            aspect = None if self.size is None else Fraction(*self.size)
            taken = {name: getattr(self.images, name) for name in OF_FRAMES}
            return {"kind": self.kind, "aspect ratio of the sensor": aspect} | taken
        windows = {"count": self.windows.count} | ({} if self.windows.count else {"dt": self.windows.seconds})
        idle = {"saturation", "tau_ms", "bins"} - set(self.images.used)
        idle |= set() if self.images.blur else {"blur_last"}
        images = {name: value for name, value in images.items() if name not in idle}
        return {"kind": self.kind, "sensor size": self.size} | windows | images | vars(self.cleaning)


def shown(value: object) -> str:
    """A setting's value as people write it."""
    if isinstance(value, tuple):
        return "x".join(map(str, value))
    return str(value)


def _is_size(size: object) -> bool:
    return (
        isinstance(size, list | tuple)
        and len(size) == 2
        and all(isinstance(side, int) and not isinstance(side, bool) and 0 < side < 1 << 16 for side in size)
    )


def _part(kind: type[Any], values: Mapping[str, Any], name: str) -> Any:
    """One of the recipe's parts; settings that an older version did not know have their defaults."""
    given = values.get(name)
    if given is not None and not isinstance(given, Mapping):
        raise SettingsError(f"the settings '{name}' cannot be {given!r}: they are a table")
    return settings.make(kind, given or {})


_OWNERS: dict[str, str] = {"kind": "", "size": ""} | {
    field.name: part
    for part, kind in (
        ("windows", WindowSettings),
        ("images", ImageSettings),
        ("cleaning", CleaningSettings),
    )
    for field in dataclasses.fields(kind)
}
"""Name of a setting -> the part of the recipe that holds it."""
