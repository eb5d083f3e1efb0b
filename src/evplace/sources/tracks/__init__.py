"""Logs of positions -> Track: times, latitude and longitude, and metres in ONE UTM zone.

One file a format, found by content. Each file holds `Settings`, a frozen dataclass (may be empty);
`PRESETS`, named Settings (may be empty); `recognises(head) -> bool`, given a file's first bytes; and
`read(path, settings) -> Fixes`.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from evplace.core import families, settings
from evplace.core.errors import EvplaceError, SettingsError, TrackError
from evplace.core.storage import is_stream
from evplace.sources._times import DAY_US, day_of
from evplace.sources.tracks import bag
from evplace.sources.tracks._fixes import Fixes, Keep
from evplace.sources.tracks._track import MAX_SPEED_MPS, Track

__all__ = ["Fixes", "Track", "format_of", "open_track"]

_HEAD_BYTES = 65536
MOST_MPS = 10_000.0
"""Satellites are slower."""


def open_track(
    path: str | Path,
    preset: str | None = None,
    offset_us: int = 0,
    zone: int | None = None,
    northern: bool | None = None,
    date: str | None = None,
    max_speed_mps: float = MAX_SPEED_MPS,
    keep: Keep | None = None,
    **values: object,
) -> Track:
    """The track in a log of positions, recognised by its content: see `evplace list tracks`.

    `offset_us` is added to every time. `zone` (1 to 60) and `northern` force the UTM zone, as a query
    must be in its map's zone; by default it is that of the middle fix. `date` (YYYY-MM-DD) is the day of the
    first fix, for a log without dates. `values` are the format's settings, over those of `preset`: see
    `evplace.sources.tracks.csv.Settings` for column names and units.

    Fixes that cannot be used are left out, counted in `Track.dropped` and shown in `Track.notes`: those
    without a position, and those that cannot be true, as no vehicle goes faster than `max_speed_mps` or
    otherwise than its log's own speed and course say. Where the log's clock was set on the way, or its
    positions leapt for good, `keep` ("before", "after", of a clock also "both") says which side is right. A
    slow drift of the positions shows only against a speed and course of the log's own: else it is not
    checked. A log that breaks off gives its good part, and `Track.fault` says so.

    Raises TrackError where the file cannot be read or holds no usable fix, SettingsError for a setting.
    """
    path = Path(path)
    if not 0 < max_speed_mps <= MOST_MPS:
        raise SettingsError(f"'max_speed_mps' is over 0 and up to {MOST_MPS:g} m/s, not {max_speed_mps}")
    name = format_of(path)
    kind, presets = families.settings_of("tracks", name)
    chosen = settings.make(kind, values, settings.preset_of(f"the track format '{name}'", presets, preset))
    part = families.load("tracks", name)
    try:
        with families.blaming("tracks", part, OSError):
            fixes: Fixes = part.read(path, chosen)
        days_us = _day_us(date, fixes.dated)
        track = Track.of(fixes, offset_us + days_us, zone, northern, max_speed_mps, keep)
    except TrackError as error:
        raise TrackError(f"{path}: {error}") from error
    return track if date is None else replace(track, dated=True)


def _day_us(date: str | None, dated: bool) -> int:
    """Microseconds from 1970 to the midnight of `date`."""
    if date is None:
        return 0
    if dated:
        raise SettingsError(f"the log has dates of its own: leave out the date {date}")
    try:
        return day_of(date) * DAY_US
    except ValueError:
        raise SettingsError(f"the date {date!r} cannot be read: write it as 2020-04-21") from None


def format_of(path: Path) -> str:
    """The name of the format of a log, by the file's first bytes; TrackError where none is known."""
    if path.is_dir() and bag.recognises_folder(path):
        return "bag"
    if is_stream(path):
        raise TrackError(f"{path} is a pipe or a device: logs are read from files, so save it first")
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
