"""GPS logs -> Track: times, latitude and longitude, and metres in ONE UTM zone.

One file a format, found by content. Each file holds `Settings`, a frozen dataclass (may be empty);
`PRESETS`, named Settings (may be empty); `recognises(head) -> bool`, given a file's first bytes; and
`read(path, settings) -> Fixes`.
"""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from evplace.core import families, settings
from evplace.core.errors import SettingsError, TrackError
from evplace.sources.tracks._fixes import Fixes
from evplace.sources.tracks._track import Track

__all__ = ["Fixes", "Track", "open_track"]

_HEAD_BYTES = 65536


def open_track(
    path: str | Path,
    preset: str | None = None,
    offset_us: int = 0,
    zone: int | None = None,
    northern: bool | None = None,
    **values: object,
) -> Track:
    """The track in a GPS log: NMEA, GPX or csv, recognised by its content.

    `offset_us` is added to every time. `zone` (1 to 60) and `northern` force the UTM zone, as a query
    must be in its map's zone; by default it is the first fix's. `values` are the format's settings, over
    those of `preset`: see `evplace.sources.tracks.csv.Settings` for column names and units.

    Fixes that cannot be used are left out and counted in `Track.dropped`.
    Raises TrackError where the file cannot be read or holds no usable fix, SettingsError for a setting.
    """
    path = Path(path)
    part = _format_of(path)
    chosen = settings.make(part.Settings, values, _preset(part, preset))
    try:
        fixes: Fixes = part.read(path, chosen)
        return Track.of(fixes, offset_us, zone, northern)
    except TrackError as error:
        raise TrackError(f"{path}: {error}") from error


def _format_of(path: Path) -> ModuleType:
    """The part that reads this file, by the file's first bytes."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        raise TrackError(f"cannot read the GPS log {path}: {error.strerror}") from error
    if not head.strip():
        raise TrackError(f"{path} is empty: give a GPS log with fixes in it")
    known = families.names("tracks")
    for name in known:
        part: ModuleType = families.load("tracks", name)
        if part.recognises(head):
            return part
    raise TrackError(f"{path} is no GPS log that is known here: give one of {', '.join(known)}")


def _preset(part: ModuleType, name: str | None) -> object | None:
    if name is None:
        return None
    if name not in part.PRESETS:
        known = ", ".join(sorted(part.PRESETS)) or "none"
        raise SettingsError(f"'{name}' is no preset of {part.__name__}: known are {known}")
    preset: object = part.PRESETS[name]
    return preset
