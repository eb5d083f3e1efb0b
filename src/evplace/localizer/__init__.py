"""The whole method on one screen: events in, matches out.

    events -> cleaned -> window -> event image -> score row -> matcher's step -> Match

Files, live cameras and evaluation all go this way; the size of the packets changes nothing. What only
hindsight knows is asked for by name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PartError, PlaceMapError, RecordingError
from evplace.core.events import Events, Size
from evplace.core.settings import make, to_dict
from evplace.core.tables import empty_rows
from evplace.imaging.activity import Activity
from evplace.imaging.averaging import Averager
from evplace.imaging.recipe import shown
from evplace.imaging.stream import EventImage, EventImages
from evplace.imaging.traverse import Traverse
from evplace.localizer._drive import BLOCK, Answered, Answering, Answers
from evplace.localizer._regions import Compared, Regions, Rough
from evplace.matchers import Answer, Estimate, Matcher, Seen
from evplace.matchers import State as StateOfAnswer
from evplace.matchers._checks import check_answer
from evplace.matchers._parts import InParts
from evplace.placemap import PlaceMap, default_matcher
from evplace.scorers import ComparesSome, OpenScorer, Rows, Verifies
from evplace.sources.cleaning import MaskSource, read_mask
from evplace.sources.readers import Canvas
from evplace.sources.tracks import Track

State = StateOfAnswer | Literal["no-events"]
"""What a match is worth: see `evplace.matchers.State`; no-events: the window was empty."""
SURE = ("localised", "standing")
"""The states of matches that the method stands by."""
FOLLOWS_US = 33_333
"""How long after the last image of one clock the first of another is taken to be, in microseconds."""


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
    compared: Compared = "all"
    """What its image was compared with: all of the map, or what is near a position or the last match."""


class Localizer:
    """Finds a later drive in a map; remembers the drive so far, so take a fresh one for each drive."""

    def __init__(
        self,
        place_map: PlaceMap,
        matcher: str | Matcher | None = None,
        preset: str | None = None,
        mask: MaskSource | None = None,
        near_m: float | None = None,
        track: Track | Rough | None = None,
        **settings: object,
    ) -> None:
        """For one map, with its own matcher, or another by name, preset and settings, or an object.

        `Localizer(campus, matchers.Local(K=5))` and `Localizer(campus, "local", K=5)` are the same; settings
        without a name are those of the map's own matcher. Events are cleaned as those of the map were. Which
        pixels are hot belongs to the drive, so a map that was learned without hot pixels needs the drive's
        own `mask` (see `evplace.sources.cleaning.read_mask`, and `pixel_mask` to measure it).

        With `near_m`, images are compared with the references within so many metres of a rough position
        alone: that of `track`, the drive's own or a function of a time that gives east and north in the
        map's metres or None; without one, that of the last match. Where there is none all are compared;
        `Match.compared` says which. Raises SettingsError for an unknown matcher, preset or setting,
        PlaceMapError for `near_m` with a map without positions.
        """
        self.map = place_map
        self.matcher: Matcher = _matcher(place_map, matcher, preset, settings)
        """The matcher with its settings; `reset` begins with it anew."""
        self.mask = mask
        """Pixels of the drive to leave out; it counts from the first packet of a drive."""
        self.scorer: OpenScorer = place_map.scoring()
        with families.blaming("scorers", place_map.scorer):
            self._distances = bool(self.scorer.distances)
        self._route = place_map.route(learned=type(self.matcher) is type(place_map.matcher))
        self._near = near_m, track
        self.reset()

    @property
    def settings(self) -> dict[str, Any]:
        """The resolved settings of the matcher, with its name."""
        probabilistic = {"probabilistic": True} if getattr(self.matcher, "probabilistic", False) else {}
        return {"name": families.name_of("matchers", self.matcher)} | to_dict(self.matcher) | probabilistic

    def reset(self) -> None:
        """Forget the drive so far."""
        with families.blaming("matchers", self.matcher):
            self._following = InParts(self.matcher, self._route, self._distances)
            if self._near[0] is None:
                self._following.within(None)  # what is wrong with the map is said now
        self._regions = Regions(self.map, *self._near)
        self._stepped = 0
        self.image: NDArray[np.uint8] | None = None
        """The last image that was matched."""
        self._images: EventImages | None = None
        self._seeing = _Seeing(self.map)
        self._clock = _Clock()
        self._times_us: dict[int, tuple[int, Compared]] = {}

    def push(self, events: Events) -> Iterator[Match]:
        """The matches of all windows that `events` bring to their end."""
        if self._images is None:
            self._images = self._open_images(events.size)
        for image in self._images.push(events):
            yield from self._matches_of(image)

    def canvas(self, size: Size) -> Canvas | None:
        """What `Recording.packets` may mark the events of a sensor of that size on: see `EventImages`.

        The packets are to be pushed here. Raises what the first `push` would.
        """
        self._images = self._images or self._open_images(size)
        return self._images.canvas

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
        if self._images is not None:
            for image in self._images.finish():
                yield from self._matches_of(image)
        self._images = None
        self._clock.begin_anew()

    def finish(self) -> Iterator[Match]:
        """The matches that are still to come when the drive is over: that of the last window is one."""
        if self._images is not None:
            for image in self._images.finish():
                yield from self._matches_of(image)
        yield from self._matches(self._finish())

    def push_image(self, image: NDArray[np.uint8], t_us: int) -> Iterator[Match]:
        """The matches that become known with one more image (h, w) or (h, w, C)."""
        self.image = image
        mean, seen = self._seeing.see(image, self._clock.passed(t_us))
        region = self._regions.at(t_us)
        if region.items is not None and not len(region.items):
            yield Match(t_us, -1, -1, None, np.nan, "unseen", compared=region.compared)
            return
        self._times_us[self._stepped] = t_us, region.compared
        with families.blaming("matchers", self.matcher):
            wanted = self._following.within(region.items)
        rows, told = self._scored(mean[None], [seen], wanted)
        yield from self._matches(self._step(rows[0], told[0]))

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
        yield from self._matches(self._finish())

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        """(n, items) score rows of images as the scorer takes them, averaged where it wants them so.

        PlaceMapError where they have not the shape of the map's.
        """
        self._check_shape(images)
        with families.blaming("scorers", self.map.scorer):
            rows = self.scorer.rows(images)
        check_rows(rows, len(images), self.map)
        return rows

    def row_of(self, image: NDArray[np.uint8], items: NDArray[np.int64]) -> Rows:
        """(len(items),) the scores of some items alone, for an image that may be compared."""
        if isinstance(self.scorer, ComparesSome):
            with families.blaming("scorers", self.map.scorer):
                rows: Rows = self.scorer.some(image[None], items)
        else:
            rows = self.rows(image[None])[:, items]
        check_rows(rows, 1, self.map, len(items))
        row: Rows = rows[0]
        return row

    def answers(self, query: Traverse, answers: Answers = "live", rows: Rows | None = None) -> Answered:
        """One answer for each image of a whole traverse; this localizer forgets what it had seen before.

        "live": what `push` would have said of each image, from those before it and, where a matcher looks
        ahead, from as many after it as it waits for. "hindsight": the matcher's `path`, from all images.
        Images without events are answered with -1, and their rows are zero. `rows` are what another localizer
        of this map gave for this traverse in the same way, so that they need not be scored again.
        PlaceMapError where the query's images were not made as the map's, SettingsError with `near_m`.
        """
        answering = Answering(self, query, answers, rows, keep=True)
        for _ in answering:
            pass
        path = answering.path()
        assert answering.rows is not None
        return Answered(path, answering.rows, answering.delay)

    def seen_of(self, query: Traverse) -> tuple[list[Seen], Rows]:
        """What a matcher sees of each image of a traverse, and their rows (n, items), made in blocks."""
        rows, seen = empty_rows(len(query), len(self.map.items)), list[Seen]()
        for start in range(0, len(query), BLOCK):
            part = np.arange(start, min(start + BLOCK, len(query)))
            rows[part], more = self._scored(*self._shown(query, part))
            seen += more
        return seen, rows

    def _shown(self, query: Traverse, part: NDArray[np.int64]) -> tuple[NDArray[np.uint8], list[Seen]]:
        """Some images of a traverse as the scorer is shown them, and what the matcher is told of them."""
        pairs = [self._seeing.see(np.asarray(query.images[at]), int(query.t_us[at])) for at in part]
        return np.stack([mean for mean, _ in pairs]), [one for _, one in pairs]

    def _scored(
        self, images: NDArray[np.uint8], seen: list[Seen], items: NDArray[np.int64] | None = None
    ) -> tuple[Rows, list[Seen]]:
        """(n, items) the scores of images as the scorer is shown them; `seen` is told what verifies."""
        if not isinstance(self.scorer, Verifies):
            return (self.rows(images) if items is None else self.row_of(images[0], items)[None]), seen
        self._check_shape(images)
        with families.blaming("scorers", self.map.scorer):
            scored = self.scorer.scored(images, items)
        for rows in scored:
            check_rows(rows, len(images), self.map, None if items is None else len(items))
        pairs = zip(seen, scored.verifying, strict=True)
        return scored.rows, [one._replace(verifying=row) for one, row in pairs]

    def _check_shape(self, images: NDArray[np.uint8]) -> None:
        if images.shape[1:] != self.map.image_shape:
            raise PlaceMapError(
                f"the map was made from images of shape {self.map.image_shape}, these are "
                f"{images.shape[1:]}: make them with the map's recipe"
            )

    def _step(self, row: Rows, seen: Seen) -> list[Answer]:
        with families.blaming("matchers", self.matcher):
            answers = self._following.step(row, seen)
        self._stepped += 1
        return self._checked(answers)

    def _finish(self) -> list[Answer]:
        with families.blaming("matchers", self.matcher):
            answers = self._following.finish()
        return self._checked(answers)

    def _checked(self, answers: list[Answer]) -> list[Answer]:
        for answer in answers:
            check_answer(answer, self._stepped, len(self.map.items), self.matcher)
        return answers

    def _matches_of(self, image: EventImage) -> Iterator[Match]:
        if image.window.events:
            yield from self.push_image(image.image, image.window.t_us)
        else:
            yield _no_events(image.window.t_us)

    def _matches(self, answers: list[Answer]) -> Iterator[Match]:
        for answer in answers:
            t_us, compared = self._times_us[answer.query]
            for query in [query for query in self._times_us if query <= answer.query]:
                del self._times_us[query]
            match = self._match(t_us, answer, compared)
            if answer.accepted and match.position is not None:
                self._regions.found(t_us, match.position)
            yield match

    def _match(self, t_us: int, answer: Answer, compared: Compared) -> Match:
        """An answer of the matcher, with what the map knows of its item."""
        state: StateOfAnswer = "localised" if answer.accepted else "unseen"
        if answer.item < 0:
            return Match(t_us, -1, -1, None, answer.score, "unseen", compared=compared)
        items, more = self.map.items, answer.estimate or Estimate(state, math.nan, math.nan, ())
        easting, northing = items.position[answer.item]
        heading = float(items.heading_deg[answer.item])
        return Match(
            t_us, answer.item, int(items.place[answer.item]),
            None if np.isnan(easting) else (float(easting), float(northing)),
            answer.score, more.state, more.probability, more.uncertainty_m,
            None if np.isnan(heading) else heading, more.others, compared,
        )  # fmt: skip

    def _open_images(self, size: Size) -> EventImages:
        recipe = self.map.recipe
        if recipe is None or recipe.kind != "events":
            made = "camera images" if recipe is not None else "images whose making is not known"
            raise PlaceMapError(f"the map was made from {made}: it cannot localise events")
        if recipe.size is not None and tuple(size) != recipe.size:
            raise RecordingError(
                f"the map was made with a sensor of {shown(recipe.size)} pixels, this recording has "
                f"{shown(tuple(size))}: give the map's own sensor, or train a map with this one"
            )
        mask = None if self.mask is None else read_mask(self.mask, size)
        return EventImages(size, recipe, mask)


class _Seeing:
    """What a map's scorer is shown of an image, and what its matcher is told of it."""

    def __init__(self, place_map: PlaceMap) -> None:
        averaging = getattr(place_map.scorer, "averaging", None)
        self._averager = Averager(averaging) if averaging is not None else None
        self._activity = Activity(of_events=place_map.recipe is None or place_map.recipe.kind == "events")

    def see(self, image: NDArray[np.uint8], t_us: int) -> tuple[NDArray[np.uint8], Seen]:
        """The image, averaged with those before it where the scorer wants that."""
        mean = image if self._averager is None else self._averager.push(image, t_us)
        return mean, Seen(t_us, self._activity.push(mean))


class _Clock:
    """The time of a drive, which goes on where the camera's clock begins anew."""

    def __init__(self) -> None:
        self._shift_us = 0
        self._last_us: int | None = None
        self._anew = False

    def begin_anew(self) -> None:
        """The next time is of another clock."""
        self._anew = self._last_us is not None

    def passed(self, t_us: int) -> int:
        """A time of the camera's clock as one of the drive; the first of another clock follows the last."""
        if self._anew and self._last_us is not None:
            self._shift_us, self._anew = self._last_us + FOLLOWS_US - t_us, False
        self._last_us = t_us + self._shift_us
        return self._last_us


def _matcher(
    place_map: PlaceMap, matcher: str | Matcher | None, preset: str | None, settings: Mapping[str, object]
) -> Matcher:
    """The matcher that is asked for: by default the map's own, with other settings where some are given."""
    own = place_map.matcher or default_matcher(place_map)
    made: Matcher = (
        make(type(own), settings, own)
        if matcher is None and preset is None
        else families.make("matchers", own if matcher is None else matcher, preset, settings)
    )
    return made


def check_rows(rows: object, images: int, place_map: PlaceMap, items: int | None = None) -> None:
    """PartError where a scorer gives anything but finite (images, items) scores; of all items or some."""
    wanted = (images, len(place_map.items) if items is None else items)
    unfinite = ""
    if isinstance(rows, np.ndarray) and rows.shape == wanted and rows.dtype.kind in "fiu":
        if np.isfinite(rows).all():
            return
        unfinite = " with NaN or infinity"
    kind = f"{rows.dtype} {rows.shape}" if isinstance(rows, np.ndarray) else type(rows).__name__
    raise PartError(
        f"{families.described('scorers', place_map.scorer)} must give finite scores {wanted} for {images} "
        f"images and {wanted[1]} items, it gave {kind}{unfinite}"
    )


def _no_events(t_us: int) -> Match:
    return Match(t_us, -1, -1, None, np.nan, "no-events")


__all__ = ["SURE", "Answered", "Answers", "Localizer", "Match", "State", "check_rows"]
