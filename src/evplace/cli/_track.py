"""The flags of a track, shared by all commands that take one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro

from evplace.core import settings
from evplace.core.errors import SettingsError
from evplace.sources.tracks import Track, open_track

MOST_S = 1e10
"""Seconds by which a track may be shifted: three centuries, more than any two clocks differ by."""


@dataclass(frozen=True, kw_only=True)
class TrackFlags:
    """Where the drive was, and how its log is to be read."""

    track: Path | None = None
    """GPS log of the same drive: NMEA, GPX or csv."""
    track_preset: str | None = None
    """A preset of the log's format, for example nordland."""
    track_set: tyro.conf.UseAppendAction[tuple[str, ...]] = ()
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
            **settings.from_pairs(self.track_set),  # type: ignore[arg-type]  # checked by the format
        )
