"""Learn a map: a scorer learns the drive, and the matcher what the map tells of itself."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PartError, SettingsError
from evplace.imaging.activity import activity
from evplace.imaging.traverse import Traverse
from evplace.matchers import Learned as LearnedByMatcher
from evplace.matchers import LearnsMore, Matcher, Route, RouteMatcher, Rows
from evplace.matchers.bayes import Bayes
from evplace.matchers.local import Local
from evplace.placemap import Items, PlaceMap
from evplace.placemap._parts import JoinedRows
from evplace.places import Places
from evplace.scorers import Descriptor, Learned, Learning, Scorer, Verifies, require, scorer_of, usable
from evplace.scorers.fused import Fused
from evplace.scorers.network import Network

MOST_OWN = 3000
"""Own images of a map of several drives on which it is measured."""
MOST_CELLS, LEAST_OWN = 10_000_000, 150
"""Own images times items, for a drive that comes to a large map: seconds; but no fewer images than this."""


def train(
    reference: Traverse,
    places: Places,
    scorer: str | Scorer | Descriptor | None = None,
    preset: str | None = None,
    learning: Learning | None = None,
    matcher: str | Matcher | None = None,
    **settings: object,
) -> PlaceMap:
    """Learn the map of `places` from the traverse `reference`.

    Without more it is `fused`, matched by `bayes`: nothing is trained, and no torch is needed. The preset
    "paper" is the paper's method: the network of Table 1, and Algorithm 1. Else `scorer` is a name, with
    `settings` over those of its `preset`, or an object such as `scorers.NCC(sigma=1)`: network is trained; to
    ncc and the like the images themselves are the map. `matcher` is what the map remembers to be matched with
    (by default bayes, and Algorithm 1 where the items are places); it learns what the map tells of itself.
    Raises SettingsError for an unknown name or setting, TraverseError where no image has a place.
    """
    named = default_scorer(preset) if scorer is None else scorer
    part: Scorer | Descriptor = families.make("scorers", named, preset, settings)
    chosen = None if matcher is None else families.make("matchers", matcher, None, {})
    require(part)  # what is wrong with the parts is said before the work
    made = learned_map(reference, places, part, learning or Learning())
    if chosen is None:
        by = preset if preset in Local.presets and made.items.are_places else None
        return calibrate(made, Local.presets[by] if by else None)
    return calibrate(made, chosen)


def default_scorer(preset: str | None) -> str:
    """The scorer where none is named: the one that a preset is of; SettingsError where it is of neither."""
    if preset is None or preset in Fused.presets:
        return "fused"
    if preset in Network.presets:
        return "network"
    known = ", ".join(sorted({*Fused.presets, *Network.presets}))
    raise SettingsError(
        f"there is no preset '{preset}': known are {known}; others are of a scorer that is named"
    )


def default_matcher(place_map: PlaceMap) -> Matcher:
    """What a map is matched with that remembers no matcher."""
    return Local() if place_map.items.are_places else Bayes()


def calibrate(place_map: PlaceMap, matcher: Matcher | None = None) -> PlaceMap:
    """The map with what its matcher, or another one from now on, learns of it from its own images.

    It stays as it is where its items are places, or its matcher learns nothing.
    """
    chosen = matcher or place_map.matcher or default_matcher(place_map)
    place_map = dataclasses.replace(place_map, matcher=chosen, learned=None)
    if not _has_images(place_map) or not isinstance(chosen, RouteMatcher):
        return place_map
    own = OwnRows(place_map)
    with families.blaming("matchers", chosen):
        learned = chosen.learn(own.route(_content(place_map)), own.rows)
    return dataclasses.replace(place_map, learned=learned or None)


def calibrate_more(place_map: PlaceMap, before: LearnedByMatcher | None, new: int) -> PlaceMap:
    """The same for a map to which the drives from number `new` on have just come.

    Of a large map, only these are measured, so that it costs no more than a drive does; what was known of the
    others, `before`, is kept.
    """
    matcher: object = place_map.matcher
    most = max(MOST_CELLS // len(place_map.items), LEAST_OWN)
    if before is None or not isinstance(matcher, LearnsMore) or most >= _images(place_map):
        return calibrate(place_map)
    own = OwnRows(place_map, range(new, len(place_map.parts)), most)
    content = _content(dataclasses.replace(place_map, parts=place_map.parts[new:]))
    with families.blaming("matchers", matcher):
        learned = matcher.learn_more(before, own.route(content), own.rows)
    return dataclasses.replace(place_map, learned=learned or None)


def _images(place_map: PlaceMap) -> int:
    """How many own images a map is measured on."""
    return min(sum(len(part.item) for part in place_map.parts), MOST_OWN)


def _has_images(place_map: PlaceMap) -> bool:
    return not place_map.items.are_places and place_map.images_of([0]) is not None


class OwnRows:
    """The score rows of a map's own images: of several drives, as many of each, one behind the other."""

    def __init__(self, place_map: PlaceMap, drives: range | None = None, most: int = MOST_OWN) -> None:
        """Of some of its drives, by their numbers; None for all. `most` is how many images in all."""
        self._map, self._scoring = place_map, place_map.scoring()
        parts = place_map.parts
        self._first = np.cumsum([0, *(len(part.item) for part in parts)])
        chosen = drives or range(len(parts))
        self._many = {drive: min(len(parts[drive].item), most // len(chosen)) for drive in chosen}
        self._images = [(drive, at) for drive, many in self._many.items() for at in range(many)]
        self._last: tuple[slice, Sequence[Rows]] | None = None

    def route(self, content: float) -> Route:
        """What a matcher learns from, besides the rows; `content` is what the images usually show."""
        parts = self._map.parts
        own = [parts[drive].item[:many] for drive, many in self._many.items()] if parts else None
        verifying = self.verifying if isinstance(self._scoring, Verifies) else None
        return self._map.route()._replace(content=content, own=own, verifying=verifying)

    def rows(self, images: slice) -> Rows:
        """(n, items) of some of them. Of several drives, none counts that an image has with itself."""
        return self._scored(images)[0]

    def verifying(self, images: slice) -> Rows:
        """(n, items) those that verify."""
        return self._scored(images)[1]

    def _scored(self, images: slice) -> Sequence[Rows]:
        """`rows`, and where the scorer verifies, those that do; made once, since both are asked for."""
        if self._last is None or self._last[0] != images:
            with families.blaming("scorers", self._map.scorer):
                self._last = images, self._score(images)
        return self._last[1]

    def _score(self, images: slice) -> Sequence[Rows]:
        if self._map.parts:
            each = [self._others(*image) for image in self._images[images]]
            return [np.concatenate(rows) for rows in zip(*each, strict=True)]
        references = self._map.references
        assert references is not None
        some = np.asarray(references[images])
        if isinstance(self._scoring, Verifies):
            return self._scoring.scored(some)
        return [self._scoring.rows(some)]

    def _others(self, drive: int, at: int) -> list[Rows]:
        """(1, items) of one image of a map of several drives: `rows`, and those that verify, if any do."""
        image = self._map.parts[drive].map.images_of([at])
        assert isinstance(self._scoring, JoinedRows)
        assert image is not None
        found = self._scoring.of_references(image)
        for rows in found:
            rows[0, self._first[drive] + at] = rows[0].min()
        return [self._scoring.best(rows) for rows in found]


def _content(place_map: PlaceMap) -> float:
    """What the map's references usually show; NaN of camera images, which no longer follow one another."""
    if place_map.recipe is None or place_map.recipe.kind != "events":
        return math.nan
    maps = [part.map for part in place_map.parts] or [place_map]
    shown = [activity(one.references, of_events=True) for one in maps if one.references is not None]
    return float(np.median(np.concatenate(shown)))


def learned_map(
    reference: Traverse, places: Places, part: Scorer | Descriptor, learning: Learning
) -> PlaceMap:
    """The map as its scorer learns it."""
    _, used = usable(reference, places)
    track = reference.track
    heading = track.heading_deg if track is not None else np.full(len(reference), np.nan)
    drive = np.column_stack([reference.xy, heading])
    with families.blaming("scorers", part):
        learned = scorer_of(part).learn(reference, places, learning)
    _check_learned(learned, len(reference), part)
    return PlaceMap(
        part,
        places,
        _learned_items(learned, reference, places, drive),
        drive[used],
        learned.content,
        reference.images.shape[1:],
        reference.recipe,
        (track.zone, track.northern) if track is not None else None,
        {key: reference.info[key] for key in ("source", "spacing") if key in reference.info},
    )


def _check_learned(learned: object, images: int, part: object) -> None:
    """PartError where a scorer has learned something that no map can hold."""
    fault = (
        _fault_of(learned, images) if isinstance(learned, Learned) else f"it gave {type(learned).__name__}"
    )
    if fault is not None:
        raise PartError(
            f"{families.described('scorers', part)} must learn arrays and bytes, and which images its items "
            f"are: {fault}"
        )


def _fault_of(learned: Learned, images: int) -> str | None:
    content: object = learned.content
    if not isinstance(content, Mapping):
        return f"its content is {type(content).__name__}"
    odd = [type(value).__name__ for value in content.values() if not isinstance(value, np.ndarray | bytes)]
    if odd:
        return f"its content holds {odd[0]}"
    if learned.images is not None and not _are_indices(learned.images, images):
        return f"its items are not some of the {images} images"
    return None


def _are_indices(chosen: object, images: int) -> bool:
    return (
        isinstance(chosen, np.ndarray)
        and chosen.ndim == 1
        and chosen.dtype.kind in "iu"
        and bool(np.all((chosen >= 0) & (chosen < images)))
    )


def _learned_items(
    learned: Learned, reference: Traverse, places: Places, drive: NDArray[np.float64]
) -> Items:
    if learned.images is None:
        return Items(np.arange(places.n), places.centres(), np.full(places.n, np.nan), are_places=True)
    labels = places.label(places.where(reference.xy))
    chosen = drive[learned.images]
    times = np.asarray(reference.t_us[learned.images], np.int64)
    return Items(labels[learned.images], chosen[:, :2], chosen[:, 2], t_us=times)
