"""All the cleaning that settings ask for, in one go."""

from __future__ import annotations

from evplace.core.errors import SettingsError
from evplace.core.events import Events, Size
from evplace.sources.cleaning._flicker import FlickerFilter
from evplace.sources.cleaning._pixels import Mask, Refractory, without
from evplace.sources.cleaning._settings import CleaningSettings


class Cleaner:
    """Cleans one packet after the other; the size of the packets changes nothing.

    Masked pixels go first, then flicker, which is told from every event of a pixel, then the repeats.
    """

    def __init__(
        self, size: Size, settings: CleaningSettings | None = None, mask: Mask | None = None
    ) -> None:
        """For a sensor of `size` (width, height); `mask` (H, W) is True at the pixels to leave out.

        Raises SettingsError where the settings ask for a measured mask and there is none.
        """
        settings = settings or CleaningSettings()
        if settings.measured and mask is None:
            raise SettingsError(
                "`mask_hot` and `static_mask` are measured over a whole recording, and a stream has none "
                "yet: give a `mask` (a file of x,y lines or a .npy file)"
            )
        self.dropped: dict[str, int] = {}
        """Reason -> events left out so far; only the reasons that were asked for."""
        self._mask = mask
        self._flicker = FlickerFilter(size, settings.flicker_hz) if settings.flicker_hz else None
        self._refractory = Refractory(size, settings.refractory_us) if settings.refractory_us else None

    def push(self, events: Events) -> Events:
        """The events that are kept, of the next packet; the same object where nothing is asked for."""
        if self._mask is not None:
            events = self._told("masked", events, without(events, self._mask))
        if self._flicker is not None:
            events = self._told("flicker", events, self._flicker.push(events))
        if self._refractory is not None:
            events = self._told("refractory", events, self._refractory.push(events))
        return events

    @property
    def masks_alone(self) -> bool:
        """Whether no more is left out than the events of masked pixels."""
        return self._flicker is None and self._refractory is None

    def count(self, reason: str, events: int) -> None:
        """So many more events were left out for that reason."""
        self.dropped[reason] = self.dropped.get(reason, 0) + events

    def _told(self, reason: str, before: Events, after: Events) -> Events:
        self.count(reason, len(before) - len(after))
        return after
