"""Which images of a drive are kept: one every so many metres, or one every so many events.

A car that waits at a light makes hundreds of images of one view. Images are judged one after another as they
are made, so that those left out never take room.

By distance, an image is kept once it was taken `every_m` metres from the last kept one, as the crow flies:
summed up along the track, the noise of GPS would let a standing car travel. By events, it is kept once
`every_events` events have come since the last kept one: a standing camera hardly sees any. Both
rules are ours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from evplace.core.errors import SettingsError
from evplace.sources.tracks import Track

REASONS = ("near", "no_position", "few_events", "empty")
"""Why images are left out; the keys of `Spacer.left_out`."""


@dataclass(frozen=True)
class SpacingSettings:
    """How far apart the kept images are; all are kept by default."""

    every_m: float = 0.0
    """Metres between two kept images, which needs a track; 0 keeps all."""
    every_events: int = 0
    """Events between two kept images; 0 keeps all."""

    def __post_init__(self) -> None:
        if not 0 <= self.every_m < math.inf or self.every_events < 0:
            raise SettingsError(
                f"images every {self.every_m} m and every {self.every_events} events: give 0 or more"
            )
        if self.every_m and self.every_events:
            raise SettingsError("'every_m' and 'every_events' both say which images are kept: give one")


class Spacer:
    """Says of one image after another whether it is kept."""

    def __init__(self, settings: SpacingSettings | None = None, track: Track | None = None) -> None:
        """SettingsError where images are to be kept by distance and there is no track."""
        self.settings = settings or SpacingSettings()
        if self.settings.every_m and track is None:
            raise SettingsError("images every so many metres need the drive's positions: give its `track`")
        self.left_out = dict.fromkeys(REASONS, 0)
        """Images left out so far, by reason: too near the last kept one, without position, after too few
        events, without events."""
        self._track = track
        self._last: tuple[float, float] | None = None
        self._events = 0

    def keeps(self, t_us: int, events: int) -> bool:
        """Whether the image at `t_us`, made of so many `events` (-1 for a camera image), is kept.

        Empty images and images without position are left out where there is a choice. SettingsError for a
        camera image where images are kept by events.
        """
        if not (self.settings.every_m or self.settings.every_events):
            return True
        reason = self._reason(t_us, events)
        if reason is not None:
            self.left_out[reason] += 1
        return reason is None

    def _reason(self, t_us: int, events: int) -> str | None:
        """Why the image is left out; None where it is kept, which is remembered."""
        if events == 0:
            return "empty"
        return self._far(t_us) if self.settings.every_m else self._busy(events)

    def _far(self, t_us: int) -> str | None:
        assert self._track is not None
        here = self._track.at([t_us])
        if not here.known[0]:
            return "no_position"
        position = (float(here.easting[0]), float(here.northing[0]))
        if self._last is not None and math.dist(position, self._last) < self.settings.every_m:
            return "near"
        self._last = position
        return None

    def _busy(self, events: int) -> str | None:
        if events < 0:
            raise SettingsError("camera images have no events to keep them by: give `every_m` and a `track`")
        self._events += events
        if self._events < self.settings.every_events:
            return "few_events"
        self._events = 0
        return None
