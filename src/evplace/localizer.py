"""The whole method on one screen: events in, matches out.

    events -> cleaned -> window -> event image -> score row -> matcher's step -> Match

Files, live cameras and evaluation all go this way; the size of the packets changes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core import settings
from evplace.core.errors import PlaceMapError, RecordingError
from evplace.core.events import Events
from evplace.imaging.images import ImageSettings
from evplace.imaging.stream import EventImage, EventImages
from evplace.imaging.traverse import Traverse
from evplace.imaging.windows import WindowSettings
from evplace.matchers import Answer, Matcher, Path, open_matcher, resolved_settings
from evplace.placemap import PlaceMap
from evplace.scorers import Rows, open_scorer
from evplace.sources.cleaning import CleaningSettings, MaskSource, read_mask

State = Literal["localised", "unseen", "no-events"]


@dataclass(frozen=True, slots=True)
class Match:
    """Where the camera was at one time."""

    t_us: int
    """End of the window, in microseconds."""
    item: int
    """The map item: a place or a reference image; -1 where there is none."""
    place: int
    """The item's place, -1 where there is none."""
    position: tuple[float, float] | None
    """The item's easting and northing in metres; None where unknown."""
    score: float
    """The matcher's confidence, larger is better; NaN where it has none."""
    state: State
    """localised; unseen: the map has never been here; no-events: the window was empty."""


class Localizer:
    """Finds a later drive in a map; remembers the drive so far, so take a fresh one for each drive."""

    def __init__(
        self,
        place_map: PlaceMap,
        matcher: str = "local",
        preset: str | None = None,
        mask: MaskSource | None = None,
        **matcher_settings: object,
    ) -> None:
        """For one map, with a matcher by name, one of its presets, and its settings.

        Events are cleaned as those of the map were. Which pixels are hot belongs to the drive, so a map that
        was learned without hot pixels needs the drive's own `mask` (see `evplace.sources.cleaning.read_mask`,
        and `pixel_mask` to measure it). Raises SettingsError for an unknown matcher, preset or setting.
        """
        self.map = place_map
        self.scorer = open_scorer(place_map)
        self._recipe = (matcher, preset, matcher_settings)
        self.mask = mask
        """Pixels of the drive to leave out; it counts from the first packet of a drive."""
        self.reset()

    @property
    def settings(self) -> dict[str, Any]:
        """The resolved settings of the matcher, with its name."""
        name, preset, values = self._recipe
        return {"name": name} | resolved_settings(name, preset, **values)

    @property
    def cleaning(self) -> CleaningSettings:
        """How the map's events were cleaned, and so are those of a drive."""
        return settings.make(CleaningSettings, self.map.settings.get("cleaning") or {})

    def reset(self) -> None:
        """Forget the drive so far."""
        name, preset, values = self._recipe
        self._matcher: Matcher = open_matcher(name, preset, self.scorer.distances, **values)
        self._images: EventImages | None = None
        self._times_us: list[int] = []

    def push(self, events: Events) -> Iterator[Match]:
        """The matches of all windows that `events` bring to their end."""
        if self._images is None:
            self._images = self._open_images(events)
        for image in self._images.push(events):
            yield from self._matches_of(image)

    def finish(self) -> Iterator[Match]:
        """The match of the last window, when the drive is over."""
        if self._images is not None:
            for image in self._images.finish():
                yield from self._matches_of(image)

    def push_image(self, image: NDArray[np.uint8], t_us: int) -> Iterator[Match]:
        """The matches that become known with one more image (h, w) or (h, w, C)."""
        self._times_us.append(t_us)
        answer = self._matcher.step(self.rows(image[None])[0])
        if answer is not None:
            yield self._match(self._times_us[answer.query], answer)

    def match_traverse(self, traverse: Traverse) -> Iterator[Match]:
        """The matches of a traverse's images, as `push` would give them for its events."""
        for image, t_us, count in zip(traverse.images, traverse.t_us, traverse.counts, strict=True):
            if count == 0:
                yield _no_events(int(t_us))
            else:
                yield from self.push_image(image, int(t_us))

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """(n, items) score rows of images; PlaceMapError where they are not such as the map was made from."""
        if images.shape[1:] != self.map.image_shape:
            raise PlaceMapError(
                f"the map was made from images of shape {self.map.image_shape}, these are "
                f"{images.shape[1:]}: make the traverse with the same image settings"
            )
        return self.scorer.rows(images)

    def path(self, traverse: Traverse, rows: Rows | None = None) -> tuple[Path, Rows]:
        """A whole traverse in hindsight: one answer an image, and the score rows (n, items).

        Images without events are answered with -1, and their rows are zero. `rows` are what another
        localizer of this map gave for this traverse, so that they need not be scored again. This localizer
        forgets what it had seen before.
        """
        self.reset()
        filled = np.flatnonzero(traverse.counts != 0)
        if rows is None:
            rows = np.zeros((len(traverse), len(self.map.items)), np.float32)
            rows[filled] = self.rows(np.asarray(traverse.images[filled]))
        self._matcher.extend(rows[filled])
        found = self._matcher.path()
        item = np.full(len(traverse), -1, np.int64)
        score = np.full(len(traverse), np.nan)
        accepted = np.zeros(len(traverse), np.bool_)
        item[filled], score[filled], accepted[filled] = found.item, found.score, found.accepted
        return Path(item, score, accepted), rows

    def _matches_of(self, image: EventImage) -> Iterator[Match]:
        if image.window.events:
            yield from self.push_image(image.image, image.window.t_us)
        else:
            yield _no_events(image.window.t_us)

    def _match(self, t_us: int, answer: Answer) -> Match:
        """An answer of the matcher, with what the map knows of its item."""
        state: State = "localised" if answer.accepted else "unseen"
        if answer.item < 0:
            return Match(t_us, -1, -1, None, answer.score, "unseen")
        easting, northing = self.map.items.position[answer.item]
        position = None if np.isnan(easting) else (float(easting), float(northing))
        return Match(t_us, answer.item, int(self.map.items.place[answer.item]), position, answer.score, state)

    def _open_images(self, events: Events) -> EventImages:
        if self.map.settings.get("input") != "events":
            raise PlaceMapError("the map was made from camera images: it cannot localise events")
        learned = self.map.settings["sensor"]
        if list(events.size) != list(learned):
            raise RecordingError(
                f"the map was made with a sensor of {learned[0]}x{learned[1]} pixels, "
                f"this recording has {events.size[0]}x{events.size[1]}"
            )
        windows = settings.make(WindowSettings, self.map.settings["windows"])
        images = settings.make(ImageSettings, self.map.settings["images"])
        mask = None if self.mask is None else read_mask(self.mask, events.size)
        return EventImages(events.size, windows, images, self.cleaning, mask)


def _no_events(t_us: int) -> Match:
    return Match(t_us, -1, -1, None, np.nan, "no-events")
