"""The flags of a track, shared by all commands that take one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from evplace.cli._settings import Pairs, Part, SettingsFlags, a_preset_of
from evplace.core import families
from evplace.core.errors import SettingsError
from evplace.sources.tracks import Track, format_of, open_track

MOST_S = 1e10
"""Seconds by which a track may be shifted: three centuries, more than any two clocks differ by."""


def _format(args: TrackFlags) -> tuple[str, type[Any], Mapping[str, Any]] | None:
    """The format of the track's log, its settings and presets."""
    if args.track is None:
        return None
    name = format_of(args.track)
    return f"the track format '{name}'", *families.settings_of("tracks", name)


@dataclass(frozen=True, kw_only=True)
class TrackFlags(SettingsFlags):
    """Where the drive was, and how its log is to be read."""

    PARTS: ClassVar[tuple[Part, ...]] = (Part("track_set", "track_preset", "track", _format),)

    track: Path | None = None
    """GPS log of the same drive: NMEA, GPX or csv."""
    track_preset: Annotated[str | None, a_preset_of("tracks")] = None
    """A preset of the log's format."""
    track_set: Pairs = ()
    """A setting of the log's format, as name=value: a csv file's columns and units."""
    track_offset: float = 0.0
    """Seconds to add to the log's times."""

    def opened_track(self) -> Track | None:
        """The track; None without one. SettingsError where flags say how to read one that is not given."""
        if self.track is None:
            if self.track_preset is not None or self.track_set or self.track_offset:
                raise SettingsError("--track-preset, --track-set and --track-offset need a --track")
            return None
        if not abs(self.track_offset) <= MOST_S:
            raise SettingsError(f"the track cannot be shifted by {self.track_offset} s: give seconds")
        return open_track(
            self.track,
            self.track_preset,
            round(self.track_offset * 1e6),
            **dict(self.track_set),  # type: ignore[arg-type]  # checked by the format
        )
