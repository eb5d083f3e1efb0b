"""GPS logs -> Track: times, latitude and longitude, and metres in ONE UTM zone.

One file a format, found by content. Each file holds `Settings`, a frozen dataclass (may be empty);
`PRESETS`, named Settings (may be empty); `recognises(head) -> bool`, given a file's first bytes; and
`read(path, settings) -> Fixes`.
"""

from __future__ import annotations

from pathlib import Path

from evplace.core import families, settings
from evplace.core.errors import EvplaceError, TrackError
from evplace.sources.tracks._fixes import Fixes
from evplace.sources.tracks._track import Track

__all__ = ["Fixes", "Track", "format_of", "open_track"]

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
    name = format_of(path)
    kind, presets = families.settings_of("tracks", name)
    chosen = settings.make(kind, values, settings.preset_of(f"the track format '{name}'", presets, preset))
    part = families.load("tracks", name)
    try:
        with families.blaming("tracks", part, OSError):
            fixes: Fixes = part.read(path, chosen)
        return Track.of(fixes, offset_us, zone, northern)
    except TrackError as error:
        raise TrackError(f"{path}: {error}") from error


def format_of(path: Path) -> str:
    """The name of the format of a GPS log, by the file's first bytes; TrackError where none is known."""
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError as error:
        raise TrackError(f"cannot read the GPS log {path}: {error.strerror}") from error
    if not head.strip():
        raise TrackError(f"{path} is empty: give a GPS log with fixes in it")
    faults: list[EvplaceError] = []
    for name in families.recognising("tracks", lambda part: part.recognises(head), faults):
        return name
    known = ", ".join(families.names("tracks"))
    raise TrackError(
        f"{path} is no GPS log that is known here: give one of {known}{families.besides(faults)}"
    )
