"""A film as an event recording: what an event camera would have recorded of it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from evplace.core.events import Events, Size
from evplace.sources.film import Film
from evplace.sources.simulators.esim import PRESETS, SensorSettings, simulate


@dataclass(frozen=True)
class SimulatedRecording:
    """Reads like a `Recording`; its events are simulated anew each time."""

    film: Film
    """What the camera sees."""
    sensor: SensorSettings = PRESETS["from-8bit"]
    """The event camera; films are gamma-coded in 8 bits."""
    seed: int = 0
    """Draws the pixels' thresholds and the noise."""
    dropped: dict[str, int] = field(default_factory=dict)
    """Nothing is left out."""

    @property
    def path(self) -> Path:
        """Where the film is."""
        return self.film.path

    @property
    def size(self) -> Size:
        """(width, height) of the sensor: the film's."""
        return self.film.size

    @property
    def notes(self) -> list[str]:
        """What was guessed of the film's times."""
        return self.film.notes

    def packets(self) -> Iterator[Events]:
        """The events from the start, one packet for each image but the first; errors as `simulate`."""
        return simulate(self.film, self.size, self.sensor, self.seed)
