"""What to drive: the settings of a set of traverses, saved with it."""

from __future__ import annotations

from dataclasses import dataclass

from evplace.core.errors import SettingsError
from evplace.core.settings import to_dict
from evplace.imaging.windows import WindowSettings
from evplace.sources.simulators.esim import PRESETS
from evplace_lab.city.camera import LEAST_GAIN, MOST_GAIN
from evplace_lab.city.conditions import CONDITIONS, condition

VERSION = "city-v1"
"""The town, the conditions, the drives and the sensors are frozen under this name."""


@dataclass(frozen=True)
class CitySettings:
    """A set of drives."""

    conditions: tuple[str, ...] = ("day", "night", "rain")
    """Of day, night, rain, dusk, fog, snow, lowsun."""
    paths: tuple[int, ...] = (1, 2)
    """1 and 2 are the benchmark's, which share about 60 per cent; more are drawn by the seed."""
    sensors: tuple[str, ...] = ("ideal", "weak", "from-8bit")
    """Of the sensor presets; the colour camera is always there."""
    fps: int = 120
    """Frames a second that are rendered, a multiple of `image_hz`. Binary images agree with those from
    480 frames at an IoU of about .94 at 120 and .87 at 60 (measured)."""
    width: int = 160
    """Columns of sensor and camera."""
    height: int = 120
    """Rows of sensor and camera."""
    image_hz: int = 10
    """Images kept a second, of events and of colour at the same times."""
    dt: str = "1/30"
    """Seconds of events in an image, as a fraction (paper: 1/60, 1/16 and 1/30 for its three data sets)."""
    most_gain: float = MOST_GAIN
    """Largest gain of the colour camera. At 4, a fixed camera's, nights are dark; 64 exposes them fully, with
    the noise that such a gain brings."""
    route_length_m: float = 0.0
    """Where routes are cut off, metres; 0 drives them to the end (about 2 km)."""
    seed: int = 0
    """Draws the town, and everything in it."""
    keep_events: bool = False
    """Keep the events too, with logs of the positions: about 150 MB for each minute and sensor."""

    def __post_init__(self) -> None:
        for name in self.conditions:
            condition(name)
        for name in self.sensors:
            if name not in PRESETS:
                raise SettingsError(f"unknown sensor '{name}': known are {', '.join(PRESETS)}")
        for name in ("fps", "width", "height", "image_hz"):
            if getattr(self, name) < 1:
                raise SettingsError(
                    f"the setting '{name}' cannot be {getattr(self, name)}: it must be above 0"
                )
        if self.most_gain < LEAST_GAIN:
            raise SettingsError(f"'most_gain' cannot be {self.most_gain}: it takes {LEAST_GAIN} or more")
        if not self.conditions or not self.paths or min(self.paths) < 1:
            raise SettingsError("give at least one condition and one path; paths are numbered from 1")
        if self.fps % self.image_hz:
            raise SettingsError(f"'fps' {self.fps} must be a multiple of 'image_hz' {self.image_hz}")
        if self.window_us * self.image_hz > 1_000_000:
            raise SettingsError(f"'dt' {self.dt} is longer than the time between images: lower 'image_hz'")
        if self.route_length_m and self.route_length_m < 60:
            raise SettingsError(
                f"'route_length_m' cannot be {self.route_length_m}: 60 at least, or 0 for all"
            )

    @property
    def window_us(self) -> int:
        """dt in microseconds."""
        return round(WindowSettings(dt=self.dt).seconds * 1_000_000)

    def drives(self) -> list[tuple[str, int]]:
        """Every (condition, path)."""
        return [(name, path) for path in self.paths for name in self.conditions]

    def of_drive(self) -> dict[str, object]:
        """What decides the content of one drive: all but which drives there are."""
        plain = to_dict(self)
        return {key: plain[key] for key in sorted(plain) if key not in ("conditions", "paths")}


def drive_name(name: str, path: int) -> str:
    """The folder of a drive: day-1."""
    return f"{name}-{path}"


def drive_number(name: str, path: int) -> int:
    """A number of its own for each drive, for the noise."""
    return path * 100 + list(CONDITIONS).index(name)
