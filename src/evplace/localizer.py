"""The whole method on one screen: events in, matches out.

    events -> cleaned -> window -> event image -> score row -> matcher's step -> Match

Files, live cameras and evaluation all go this way; the size of the packets changes nothing. What only
hindsight knows is asked for by name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PartError, PlaceMapError, RecordingError
from evplace.core.events import Events
from evplace.core.settings import to_dict
from evplace.imaging.recipe import shown
from evplace.imaging.stream import EventImage, EventImages
from evplace.imaging.traverse import Traverse
from evplace.matchers import Answer, Estimate, Matcher, Matching, Path, stepped
from evplace.matchers import State as StateOfAnswer
from evplace.matchers._checks import check_answer, check_path
from evplace.placemap import PlaceMap
from evplace.scorers import OpenScorer, Rows, scorer_of
from evplace.sources.cleaning import MaskSource, read_mask

Answers = Literal["live", "hindsight"]
"""What the camera would have been told as it drove; or what is known once the drive is over."""
State = StateOfAnswer | Literal["no-events"]
"""What a match is worth: see `evplace.matchers.State`; no-events: the window was empty."""


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
    """What it is worth."""
    probability: float = math.nan
    """That the camera is near the item and looks the same way; NaN where the matcher does not say it."""
    uncertainty_m: float = math.nan
    """Radius around the position that holds the camera with a probability of 68 %, if it is on the map; NaN
    where the matcher does not say it."""
    heading_deg: float | None = None
    """Where the item looks, clockwise from north; None where unknown."""
    others: tuple[int, ...] = ()
    """The next best items, at other places, best first, where the matcher says them."""


class Answered(NamedTuple):
    """What a localizer says of a whole traverse."""

    path: Path
    """One answer an image."""
    rows: Rows
    """(n, items) the score rows."""
    delay: int
    """Images that came before an answer was known, at most."""


class Localizer:
    """Finds a later drive in a map; remembers the drive so far, so take a fresh one for each drive."""

    def __init__(
        self,
        place_map: PlaceMap,
        matcher: str | Matcher = "local",
        preset: str | None = None,
        mask: MaskSource | None = None,
        **settings: object,
    ) -> None:
        """For one map, with a matcher by name, one of its presets, and its settings; or with an object.

        `Localizer(campus, matchers.Local(K=5))` and `Localizer(campus, "local", K=5)` are the same. Events
        are cleaned as those of the map were. Which pixels are hot belongs to the drive, so a map that was
        learned without hot pixels needs the drive's own `mask` (see `evplace.sources.cleaning.read_mask`,
        and `pixel_mask` to measure it). Raises SettingsError for an unknown matcher, preset or setting.
        """
        self.map = place_map
        self.matcher: Matcher = families.make("matchers", matcher, preset, settings)
        """The matcher with its settings; `reset` begins with it anew."""
        self.mask = mask
        """Pixels of the drive to leave out; it counts from the first packet of a drive."""
        with families.blaming("scorers", place_map.scorer):
            self.scorer: OpenScorer = scorer_of(place_map.scorer).open(place_map.content)
            self._distances = bool(self.scorer.distances)
        self.reset()

    @property
    def settings(self) -> dict[str, Any]:
        """The resolved settings of the matcher, with its name."""
        return {"name": families.name_of("matchers", self.matcher)} | to_dict(self.matcher)

    def reset(self) -> None:
        """Forget the drive so far."""
        with families.blaming("matchers", self.matcher):
            self._matching: Matching = self.matcher.start(self._distances)
        self._stepped = 0
        self.image: NDArray[np.uint8] | None = None
        """The last image that was matched."""
        self._images: EventImages | None = None
        self._times_us: list[int] = []

    def push(self, events: Events) -> Iterator[Match]:
        """The matches of all windows that `events` bring to their end."""
        if self._images is None:
            self._images = self._open_images(events)
        for image in self._images.push(events):
            yield from self._matches_of(image)

    def tick(self, t_us: int) -> Iterator[Match]:
        """The matches of all windows that are over once no event up to `t_us` will come any more.

        A camera at rest sends nothing: its windows are closed by time. Where events do come later than that,
        they belong to the window that is open then.
        """
        if self._images is not None:
            for image in self._images.tick(t_us):
                yield from self._matches_of(image)

    def new_clock(self) -> Iterator[Match]:
        """The match of the open window; times start anew with the next event, on the same drive.

        For a camera that was started again: what the matcher knows of the drive is kept.
        """
        yield from self.finish()
        self._images = None

    def finish(self) -> Iterator[Match]:
        """The match of the last window, when the drive is over."""
        if self._images is not None:
            for image in self._images.finish():
                yield from self._matches_of(image)

    def push_image(self, image: NDArray[np.uint8], t_us: int) -> Iterator[Match]:
        """The matches that become known with one more image (h, w) or (h, w, C)."""
        self.image = image
        self._times_us.append(t_us)
        answer = self._step(self.rows(image[None])[0])
        if answer is not None:
            yield self._match(self._times_us[answer.query], answer)

    def match_traverse(self, traverse: Traverse) -> Iterator[Match]:
        """The matches of a traverse's images, as `push` would give them for its events.

        PlaceMapError where its images were not made as the map's.
        """
        self.map.require_same(traverse)
        for image, t_us, count in zip(traverse.images, traverse.t_us, traverse.counts, strict=True):
            if count == 0:
                yield _no_events(int(t_us))
            else:
                yield from self.push_image(image, int(t_us))

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """(n, items) score rows of images; PlaceMapError where they have not the shape of the map's."""
        if images.shape[1:] != self.map.image_shape:
            raise PlaceMapError(
                f"the map was made from images of shape {self.map.image_shape}, these are "
                f"{images.shape[1:]}: make them with the map's recipe"
            )
        with families.blaming("scorers", self.map.scorer):
            rows = self.scorer.rows(images)
        check_rows(rows, len(images), self.map)
        return rows

    def answers(self, query: Traverse, answers: Answers = "live", rows: Rows | None = None) -> Answered:
        """One answer for each image of a whole traverse; this localizer forgets what it had seen before.

        "live": what `push` would have said of each image, from those before it and, where a matcher looks
        ahead, from as many after it as it waits for. "hindsight": the matcher's `path`, from all images.
        Images without events are answered with -1, and their rows are zero. `rows` are what another localizer
        of this map gave for this traverse in the same way, so that they need not be scored again.
        PlaceMapError where the query's images were not made as the map's.
        """
        self.map.require_same(query)
        self.reset()
        filled = np.flatnonzero(query.counts != 0)
        if rows is None:
            rows = self._rows_of(query, filled, answers)
        live = answers == "live"
        found, delay = stepped(self._step, rows[filled]) if live else self._in_hindsight(rows[filled])
        item = np.full(len(query), -1, np.int64)
        score = np.full(len(query), np.nan)
        accepted = np.zeros(len(query), np.bool_)
        item[filled], score[filled], accepted[filled] = found.item, found.score, found.accepted
        return Answered(Path(item, score, accepted), rows, delay)

    def _rows_of(self, query: Traverse, filled: NDArray[np.int64], answers: Answers) -> Rows:
        """(n, items): live, image by image, since the size of a batch may change the last bits of a score."""
        rows = np.zeros((len(query), len(self.map.items)), np.float32)
        if answers == "live":
            for at in filled:
                rows[at] = self.rows(np.asarray(query.images[at : at + 1]))[0]
        elif len(filled):
            rows[filled] = self.rows(np.asarray(query.images[filled]))
        return rows

    def _in_hindsight(self, rows: Rows) -> tuple[Path, int]:
        with families.blaming("matchers", self.matcher):
            self._matching.extend(rows)
            found = self._matching.path()
        check_path(found, len(rows), len(self.map.items), self.matcher)
        return found, max(0, len(rows) - 1)

    def _step(self, row: Rows) -> Answer | None:
        with families.blaming("matchers", self.matcher):
            answer = self._matching.step(row)
        self._stepped += 1
        check_answer(answer, self._stepped, len(self.map.items), self.matcher)
        return answer

    def _matches_of(self, image: EventImage) -> Iterator[Match]:
        if image.window.events:
            yield from self.push_image(image.image, image.window.t_us)
        else:
            yield _no_events(image.window.t_us)

    def _match(self, t_us: int, answer: Answer) -> Match:
        """An answer of the matcher, with what the map knows of its item."""
        state: StateOfAnswer = "localised" if answer.accepted else "unseen"
        if answer.item < 0:
            return Match(t_us, -1, -1, None, answer.score, "unseen")
        items, more = self.map.items, answer.estimate or Estimate(state, math.nan, math.nan, ())
        easting, northing = items.position[answer.item]
        heading = float(items.heading_deg[answer.item])
        return Match(
            t_us, answer.item, int(items.place[answer.item]),
            None if np.isnan(easting) else (float(easting), float(northing)),
            answer.score, more.state, more.probability, more.uncertainty_m,
            None if np.isnan(heading) else heading, more.others,
        )  # fmt: skip

    def _open_images(self, events: Events) -> EventImages:
        recipe = self.map.recipe
        if recipe is None or recipe.kind != "events":
            made = "camera images" if recipe is not None else "images whose making is not known"
            raise PlaceMapError(f"the map was made from {made}: it cannot localise events")
        if recipe.size is not None and tuple(events.size) != recipe.size:
            raise RecordingError(
                f"the map was made with a sensor of {shown(recipe.size)} pixels, this recording has "
                f"{shown(tuple(events.size))}: give the map's own sensor, or train a map with this one"
            )
        mask = None if self.mask is None else read_mask(self.mask, events.size)
        return EventImages(events.size, recipe, mask)


def check_rows(rows: object, images: int, place_map: PlaceMap) -> None:
    """PartError where a scorer gives anything but finite (images, items) scores."""
    wanted = (images, len(place_map.items))
    kind, unfinite = type(rows).__name__, ""
    if isinstance(rows, np.ndarray):
        kind = f"{rows.dtype} {rows.shape}"
        if rows.shape == wanted and rows.dtype.kind in "fiu":
            if np.isfinite(rows).all():
                return
            unfinite = " with NaN or infinity"
    raise PartError(
        f"{families.described('scorers', place_map.scorer)} must give finite scores {wanted} for {images} "
        f"images and {wanted[1]} items, it gave {kind}{unfinite}"
    )


def _no_events(t_us: int) -> Match:
    return Match(t_us, -1, -1, None, np.nan, "no-events")
