"""Seven conditions, part of the frozen `city-v1`: the only thing that changes between drives of one path."""

from __future__ import annotations

import math
from dataclasses import dataclass

from evplace.core.errors import SettingsError
from evplace_lab.city.light import Light
from evplace_lab.city.texture import Colour


@dataclass(frozen=True)
class Condition:
    """A weather and a time of day; radiances in the units of `light`, set by eye and then frozen."""

    ambient: Colour
    zenith: Colour
    horizon: Colour
    night: float = 0.0
    sun: Colour = (0.0, 0.0, 0.0)
    towards_sun: Colour = (0.3, 0.3, 0.9)
    fog: float = 0.0008
    wet: float = 0.0
    snow: float = 0.0
    headlights: float = 0.0
    lamps: float = 0.0
    windows: float = 0.0
    clouds: float = 0.0
    glow: float = 0.0
    rain: bool = False
    """Streaks in the air and drops on the lens."""
    snowing: bool = False
    """Flakes in the air."""
    veil: float = 0.0
    """Light of the sun scattered in the lens when it shines into it."""

    def light(self) -> Light:
        """The same, as the loops read it."""
        length = math.sqrt(sum(value * value for value in self.towards_sun))
        x, y, z = (value / length for value in self.towards_sun)
        return Light(
            night=self.night,
            sun=self.sun,
            towards_sun=(x, y, z),
            ambient=self.ambient,
            zenith=self.zenith,
            horizon=self.horizon,
            fog=self.fog,
            wet=self.wet,
            snow=self.snow,
            headlights=self.headlights,
            lamps=self.lamps,
            windows=self.windows,
            clouds=self.clouds,
            glow=self.glow,
        )


CONDITIONS = {
    "day": Condition(
        sun=(3.0, 2.8, 2.45),
        towards_sun=(0.50, -0.38, 0.95),
        ambient=(0.75, 0.85, 1.05),
        zenith=(0.35, 0.62, 1.35),
        horizon=(1.25, 1.40, 1.60),
        clouds=0.7,
        glow=2.0,
    ),
    "night": Condition(
        night=1.0,
        ambient=(0.006, 0.007, 0.011),
        zenith=(0.003, 0.004, 0.009),
        horizon=(0.012, 0.011, 0.014),
        headlights=14.0,
        lamps=14.0,
        windows=0.45,
    ),
    "rain": Condition(
        ambient=(0.62, 0.66, 0.72),
        zenith=(0.50, 0.54, 0.60),
        horizon=(0.75, 0.79, 0.84),
        fog=0.0055,
        wet=0.85,
        clouds=0.35,
        rain=True,
    ),
    "dusk": Condition(
        night=0.6,
        sun=(0.5, 0.24, 0.10),
        towards_sun=(-0.85, 0.30, 0.16),
        ambient=(0.09, 0.08, 0.12),
        zenith=(0.05, 0.06, 0.14),
        horizon=(0.45, 0.22, 0.12),
        fog=0.001,
        headlights=4.0,
        lamps=8.0,
        windows=0.3,
        clouds=0.5,
        glow=1.0,
    ),
    "fog": Condition(
        ambient=(0.75, 0.77, 0.80),
        zenith=(0.80, 0.82, 0.84),
        horizon=(0.84, 0.86, 0.88),
        fog=0.03,
        wet=0.1,
    ),
    "snow": Condition(
        ambient=(0.78, 0.82, 0.90),
        zenith=(0.66, 0.69, 0.74),
        horizon=(0.86, 0.88, 0.92),
        fog=0.006,
        snow=0.9,
        snowing=True,
    ),
    "lowsun": Condition(
        sun=(3.2, 2.3, 1.35),
        towards_sun=(0.98, 0.14, 0.17),
        ambient=(0.42, 0.48, 0.62),
        zenith=(0.30, 0.48, 0.95),
        horizon=(1.30, 1.12, 0.90),
        fog=0.0015,
        clouds=0.3,
        glow=6.0,
        veil=1.0,
    ),
}
"""Every condition by name."""


def condition(name: str) -> Condition:
    """The condition of that name; SettingsError, with the known names, where there is none."""
    if name not in CONDITIONS:
        raise SettingsError(f"unknown condition '{name}': known are {', '.join(CONDITIONS)}")
    return CONDITIONS[name]
