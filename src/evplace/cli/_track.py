"""The flags of a track, shared by all commands that take one."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from evplace.cli._settings import NAME, Pairs, Part, SettingsFlags, a_preset_of
from evplace.core import families
from evplace.core.errors import SettingsError
from evplace.sources.tracks import Track, format_of, open_track
from evplace.sources.tracks._track import MAX_SPEED_MPS

MOST_S = 1e10
"""Seconds by which a track may be shifted: three centuries, more than any two clocks differ by."""


def _format(args: TrackFlags) -> tuple[str, type[Any], Mapping[str, Any]] | None:
    """The format of the track's log, its settings and presets."""
    if args.track is None or NAME in str(args.track):  # of many drives: each is asked for its own
        return None
    name = format_of(args.track)
    return f"the track format '{name}'", *families.settings_of("tracks", name)


@dataclass(frozen=True, kw_only=True)
class TrackFlags(SettingsFlags):
    """Where the drive was, and how its log is to be read."""

    PARTS: ClassVar[tuple[Part, ...]] = (Part("track_set", "track_preset", "track", _format),)

    track: Path | None = None
    """Log of the same drive's positions: NMEA, GPX, csv, TUM or EuRoC poses, or a ROS bag."""
    track_preset: Annotated[str | None, a_preset_of("tracks")] = None
    """A preset of the log's format."""
    track_set: Pairs = ()
    """A setting of the log's format, as name=value: a csv file's columns and units, a bag's topic."""
    track_offset: float = 0.0
    """Seconds to add to the log's times."""
    track_date: str | None = None
    """Day of the first fix, as 2020-04-21, for a log without dates; else the recording's is taken."""
    track_max_speed: float = MAX_SPEED_MPS
    """Fastest that the vehicle goes, in m/s: fixes that need more are left out."""
    track_keep: Literal["before", "after", "both"] | None = None
    """Which side is right where the log's clock was set, or its positions leapt; of a clock also both."""

    def opened_track(self) -> Track | None:
        """The track; None without one. SettingsError where flags say how to read one that is not given."""
        if self.track is None:
            self._refuse_others()
            return None
        if not abs(self.track_offset) <= MOST_S:
            raise SettingsError(f"the track cannot be shifted by {self.track_offset} s: give seconds")
        return open_track(
            self.track,
            self.track_preset,
            round(self.track_offset * 1e6),
            date=self.track_date,
            max_speed_mps=self.track_max_speed,
            keep=self.track_keep,
            **dict(self.track_set),  # type: ignore[arg-type]  # checked by the format
        )

    def _refuse_others(self) -> None:
        """SettingsError where a flag of a track is set."""
        own = [field for field in dataclasses.fields(TrackFlags) if field.name.startswith("track_")]
        if any(getattr(self, field.name) != field.default for field in own):
            flags = ", ".join(f"--{field.name.replace('_', '-')}" for field in own)
            raise SettingsError(f"{flags} need a --track")
