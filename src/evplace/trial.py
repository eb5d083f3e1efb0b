"""A trial: one localizer on one query traverse, judged by where the query really was."""

from __future__ import annotations

import dataclasses
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evplace.errors import EvaluationError
from evplace.evaluation import Result, measure
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.places import PlaceGrid, PlaceRuns
from evplace.tracks import Track
from evplace.traverse import Traverse
from evplace.truth import Truth, by_cells, by_places, only_views

Rule = Literal["places", "view"]
MARGIN_M = 1000.0
"""A query further than this from all of the map's ground is taken for a mistake."""


def evaluate(where: Localizer, query: Traverse, truth: Truth | None = None, rule: Rule = "places") -> Result:
    """Localise the whole `query` and measure the answers.

    Without `truth`, the positions are: by `rule` places, an answer is right in the query's cell or one of its
    eight neighbours (paper, section 3.4), and a query is seen where the map has any such cell. By view it is
    seen only where the map holds a reference within 20 m that looks within 34 degrees the same way.
    Raises EvaluationError where query and map share no ground, or the truth does not fit.
    """
    truth = truth or truth_of(where.map, query, rule)
    path, rows = where.path(query)
    settings = {
        "map": where.map.settings,
        "scorer": where.map.scorer,
        "matcher": where.settings,
        "query": query.info.get("source"),
    }
    return measure(path, truth, rows, where.map.items.position, query.t_us, settings)


def truth_of(place_map: PlaceMap, query: Traverse, rule: Rule = "places") -> Truth:
    """Which items of a map are right for each image of a query."""
    track = _same_zone(place_map, query.track)
    if isinstance(place_map.places, PlaceRuns):
        return _by_runs(place_map, place_map.places, query)
    if track is None:
        raise EvaluationError("the query has no positions: give its track, or the truth as a matrix")
    _check_overlap(place_map, track)
    truth = _by_place(place_map, place_map.places, track)
    return only_views(truth, track, _references(place_map)) if rule == "view" else truth


def _by_place(place_map: PlaceMap, places: object, track: Track) -> Truth:
    assert isinstance(places, PlaceGrid)
    if place_map.items_are_places:
        return by_places(places, track.xy)
    return by_cells(track.xy, place_map.items.position, places.cell_m, places.origin)


def _by_runs(place_map: PlaceMap, places: PlaceRuns, query: Traverse) -> Truth:
    """Query and map in step: place i of the query is place i of the map."""
    truth = by_places(places, query.xy)
    if place_map.items_are_places:
        return truth
    columns = place_map.items.place
    return dataclasses.replace(truth, block=lambda part: truth.block(part)[:, columns], n_items=len(columns))


def _references(place_map: PlaceMap) -> Track:
    xy, heading = place_map.drive[:, :2], place_map.drive[:, 2]
    return Track.local(np.arange(len(xy)), xy, heading)


def _same_zone(place_map: PlaceMap, track: Track | None) -> Track | None:
    zone = place_map.settings.get("zone")
    if track is None or zone is None or [track.zone, track.northern] == zone:
        return track
    moved: Track = track.in_zone(*zone)
    return moved


def _check_overlap(place_map: PlaceMap, track: Track) -> None:
    """A query a long way from the whole map is a mistake, not a query of unseen places."""
    known = place_map.drive[:, :2]
    low, high = np.nanmin(known, axis=0) - MARGIN_M, np.nanmax(known, axis=0) + MARGIN_M
    if not ((track.xy >= low) & (track.xy <= high)).all(axis=1).any():
        raise EvaluationError(
            f"query and map share no ground: the map spans {_span(known)}, the query {_span(track.xy)} "
            "(metres east and north)"
        )


def _span(xy: NDArray[np.float64]) -> str:
    (west, south), (east, north) = np.nanmin(xy, axis=0), np.nanmax(xy, axis=0)
    return f"{west:.0f} to {east:.0f}, {south:.0f} to {north:.0f}"
