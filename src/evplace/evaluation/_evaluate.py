"""One localizer on one query traverse, judged by where the query really was."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from pathlib import Path as FilePath
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import EvaluationError
from evplace.core.tables import MEMORY_BYTES
from evplace.evaluation import RECALLS_AT, ItemImages, Result, hits_at, measure, sample
from evplace.evaluation._checkpoint import Checkpoint
from evplace.evaluation._measures import Floats
from evplace.evaluation.truth import Truth, by_cells, by_places, by_radius, only_views
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.localizer._drive import Answering, Answers
from evplace.matchers import Path
from evplace.placemap import PlaceMap
from evplace.places import PlaceGrid, PlaceRuns
from evplace.scorers import Rows
from evplace.sources.tracks import Track

Rule = Literal["places", "view", "radius"]
Progress = Callable[[int, int, str], None]
"""Called with (queries done, queries in all, what is being done)."""
MARGIN_M = 1000.0
"""A query further than this from all of the map's ground is taken for a mistake."""
RADIUS_M = 25.0
"""The field's usual radius."""


def evaluate(
    localizer: Localizer,
    query: Traverse,
    truth: Truth | None = None,
    rule: Rule = "places",
    reference: Traverse | None = None,
    answers: Answers = "live",
    radius_m: float = RADIUS_M,
    keep_scores: bool | None = None,
    progress: Progress | None = None,
    checkpoint: FilePath | None = None,
) -> Result:
    """Localise the whole `query` and measure the answers: "live" ones, or those of "hindsight".

    Without `truth`, the positions are: by `rule` places, an answer is right in the query's cell or one of its
    eight neighbours (paper, section 3.4), and a query is seen where the map has any such cell. By view it is
    seen only where the map holds a reference within 20 m that looks within 34 degrees the same way. By radius
    an answer is right at most `radius_m` metres from the query. `reference`, the map's own drive, lends a
    network's map the images of the samples; a map of images has them.

    The score rows are kept where `keep_scores` says so; by default where memory holds them. Live, a call that
    was stopped goes on from the file `checkpoint`, which is written every minute and removed at the end.
    Raises EvaluationError where query and map share no ground, or the truth or reference do not fit;
    PlaceMapError where the query was not made as the map was.
    """
    started = time.perf_counter()
    show = item_images(localizer.map, query, reference)
    truth = truth or truth_of(localizer.map, query, rule, radius_m)
    heard = hear(localizer, query, [truth], answers, None, keep_scores, progress, checkpoint)
    result = judged(localizer, query, heard, 0)
    result = dataclasses.replace(result, took_s=round(heard.took_s + time.perf_counter() - started, 3))
    return sample(result, query.images, show) if show is not None else result


@dataclasses.dataclass(frozen=True)
class Heard:
    """What a localizer has said of a whole traverse, and how its rows stand by some truths."""

    path: Path
    """(n,) answers."""
    delay: int
    """Images that came before an answer was known, at most."""
    rows: Rows | None
    """(n, items), where they were kept."""
    hits: list[Floats]
    """Of each truth (n, N, 3): see `hits_at`."""
    truths: list[Truth]
    answers: Answers
    took_s: float
    """Seconds of calls before this, which were stopped."""


def hear(
    localizer: Localizer,
    query: Traverse,
    truths: list[Truth],
    answers: Answers,
    rows: Rows | None = None,
    keep: bool | None = None,
    progress: Progress | None = None,
    checkpoint: FilePath | None = None,
) -> Heard:
    """Have the whole `query` answered; each row is seen once and forgotten, unless `keep` says otherwise.

    `rows` as in `Localizer.answers`; `keep` and `checkpoint` as in `evaluate`.
    """
    cells = len(query) * len(localizer.map.items)
    kept = 4 * cells <= MEMORY_BYTES if keep is None else keep
    answering = Answering(localizer, query, answers, rows, kept)
    in_memory = answering.rows is None or 4 * cells <= MEMORY_BYTES
    file = None
    if checkpoint is not None and answers == "live" and in_memory:
        file = Checkpoint(checkpoint, localizer, query, truths, answers)
    hits, took_s = _hits(answering, query, truths, progress, file)
    path = answering.path()
    if file is not None:
        file.remove()
    return Heard(path, answering.delay, answering.rows if kept else rows, hits, truths, answers, took_s)


def _hits(
    answering: Answering,
    query: Traverse,
    truths: list[Truth],
    progress: Progress | None,
    file: Checkpoint | None,
) -> tuple[list[Floats], float]:
    """Of each truth (n, N, 3) the hits of each row; and seconds of calls before this."""
    hits = [np.zeros((len(query), len(RECALLS_AT), 3)) for _ in truths]
    began, took_s = time.perf_counter(), 0.0
    state = file.found() if file is not None else None
    if state is not None:
        answering.resume(state["answering"])
        hits, took_s = state["hits"], state["took_s"]
    for queries, rows in answering:
        for truth, of in zip(truths, hits, strict=True):
            of[queries] = hits_at(rows, _right(truth, queries), RECALLS_AT)
        if progress is not None:
            progress(int(queries[-1]) + 1, len(query), "")
        if file is not None and file.is_due:
            passed = took_s + time.perf_counter() - began
            file.save({"answering": answering.state, "hits": hits, "took_s": passed})
    for at in np.flatnonzero(query.counts == 0):  # no image: by chance
        for truth, of in zip(truths, hits, strict=True):
            of[at] = hits_at(np.zeros((1, truth.n_items)), _right(truth, np.array([at])), RECALLS_AT)[0]
    return hits, took_s


def _right(truth: Truth, queries: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(k, items) what is right for some queries, which need not stand together."""
    return np.concatenate([truth.block(slice(int(at), int(at) + 1)) for at in queries])


def judged(localizer: Localizer, query: Traverse, heard: Heard, number: int) -> Result:
    """The figures of what `localizer` has said, by the truth of that number."""
    place_map = localizer.map
    settings = {
        "answers": heard.answers,
        "map": place_map.settings,
        "matcher": localizer.settings,
        "query": query.info.get("source"),
    }
    return measure(
        heard.path, heard.truths[number], heard.rows, place_map.items.position, query.t_us, settings,
        xy_in(place_map, query), heard.delay, heard.hits[number],
    )  # fmt: skip


def truth_of(
    place_map: PlaceMap, query: Traverse, rule: Rule = "places", radius_m: float = RADIUS_M
) -> Truth:
    """Which items of a map are right for each image of a query."""
    track = _same_zone(place_map, query.track)
    if isinstance(place_map.places, PlaceRuns):
        return _by_runs(place_map, place_map.places, query)
    if track is None:
        raise EvaluationError("the query has no positions: give its `track`, or the `truth` as a matrix")
    _check_overlap(place_map, track)
    if rule == "radius":
        return by_radius(track.xy, place_map.items.position, radius_m)
    truth = _by_place(place_map, place_map.places, track)
    return only_views(truth, track, _references(place_map)) if rule == "view" else truth


def xy_in(place_map: PlaceMap, query: Traverse) -> NDArray[np.float64] | None:
    """(queries, 2) the query's positions in metres of the map's zone; None without any."""
    track = _same_zone(place_map, query.track)
    return track.xy if track is not None else None


def item_images(place_map: PlaceMap, query: Traverse, reference: Traverse | None) -> ItemImages | None:
    """What shows the map's items: its own images, else the images of `reference`; None without either.

    Raises EvaluationError where the reference's images are not like those of the query.
    """
    if place_map.images_of([0]) is not None:
        return lambda items: np.asarray(place_map.images_of(items))
    if reference is None:
        return None
    if reference.images.shape[1:] != query.images.shape[1:]:
        raise EvaluationError(
            f"the reference drive has images of shape {reference.images.shape[1:]}, the query of "
            f"{query.images.shape[1:]}: give the drive that the map was learned from"
        )
    return lambda items: np.asarray(reference.images[_middle_images(place_map, reference, items)])


def _middle_images(place_map: PlaceMap, reference: Traverse, items: NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) for each place (n,) the image of the reference drive nearest to its centre."""
    if isinstance(place_map.places, PlaceRuns):
        every = place_map.places.every
        return np.minimum(items * every + every // 2, len(reference) - 1)
    track = _same_zone(place_map, reference.track)
    if track is None or not track.known.any():
        raise EvaluationError("the reference drive has no positions: give a traverse with a track")
    apart = np.hypot(*(place_map.items.position[items, None] - track.xy[None]).transpose(2, 0, 1))
    return np.asarray(np.nanargmin(apart, axis=1), np.int64)


def _by_place(place_map: PlaceMap, places: object, track: Track) -> Truth:
    assert isinstance(places, PlaceGrid)
    if place_map.items.are_places:
        return by_places(places, track.xy)
    return by_cells(track.xy, place_map.items.position, places.cell_m, places.origin)


def _by_runs(place_map: PlaceMap, places: PlaceRuns, query: Traverse) -> Truth:
    """Query and map in step: place i of the query is place i of the map."""
    truth = by_places(places, query.xy)
    if place_map.items.are_places:
        return truth
    columns = place_map.items.place
    return dataclasses.replace(truth, block=lambda part: truth.block(part)[:, columns], n_items=len(columns))


def _references(place_map: PlaceMap) -> Track:
    xy, heading = place_map.drive[:, :2], place_map.drive[:, 2]
    return Track.local(np.arange(len(xy)), xy, heading)


def _same_zone(place_map: PlaceMap, track: Track | None) -> Track | None:
    zone = place_map.zone
    if track is None or zone is None or (track.zone, track.northern) == zone:
        return track
    return track.in_zone(*zone)


def _check_overlap(place_map: PlaceMap, track: Track) -> None:
    """A query a long way from the whole map is a mistake, not a query of unseen places."""
    known = place_map.drive[:, :2]
    known = known[np.isfinite(known).all(axis=1)]
    if not len(known):
        raise EvaluationError("no position of the map's drive is known: train it again with its track")
    low, high = np.nanmin(known, axis=0) - MARGIN_M, np.nanmax(known, axis=0) + MARGIN_M
    if not ((track.xy >= low) & (track.xy <= high)).all(axis=1).any():
        raise EvaluationError(
            f"query and map share no ground: the map spans {_span(known)}, the query {_span(track.xy)} "
            "(metres east and north)"
        )


def _span(xy: NDArray[np.float64]) -> str:
    xy = xy[np.isfinite(xy).all(axis=1)]
    if not len(xy):
        return "nothing that is known"
    (west, south), (east, north) = np.nanmin(xy, axis=0), np.nanmax(xy, axis=0)
    return f"{west:.0f} to {east:.0f}, {south:.0f} to {north:.0f}"
