"""How a stream of events is cleaned before its images are made."""

from __future__ import annotations

import math
from dataclasses import dataclass

from evplace.core.errors import SettingsError


@dataclass(frozen=True)
class CleaningSettings:
    """What is taken out of the events; nothing by default, as in the paper."""

    mask_hot: bool = False
    """Leave out the pixels that fire by themselves, measured over the whole recording before it is read."""
    static_mask: bool = False
    """Leave out the regions that hardly ever see a change (the bonnet), measured in the same way."""
    refractory_us: int = 0
    """Leave out what follows an event of the same pixel by less than this, in microseconds; 0: nothing."""
    flicker_hz: float = 0.0
    """Leave out what comes and goes at this frequency, in hertz: 100 for lamps on 50 Hz mains; 0: nothing."""

    def __post_init__(self) -> None:
        if self.refractory_us < 0:
            raise SettingsError(
                f"the setting 'refractory_us' cannot be {self.refractory_us}: it takes 0 or more"
            )
        if not 0 <= self.flicker_hz < math.inf:
            raise SettingsError(f"the setting 'flicker_hz' cannot be {self.flicker_hz}: it takes 0 or more")

    @property
    def measured(self) -> bool:
        """Whether the whole recording has to be seen first."""
        return self.mask_hot or self.static_mask
