"""A localizer on a query traverse: both rules, runs, zones, and what does not fit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from evplace.errors import EvaluationError
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.places import PlaceGrid, PlaceRuns
from evplace.tracks import Track
from evplace.training import train
from evplace.traverse import Traverse
from evplace.trial import evaluate, truth_of


def moved(traverse: Traverse, xy: np.ndarray, heading_deg: float | None = None) -> Traverse:
    headings = None if heading_deg is None else np.full(len(traverse), heading_deg)
    return dataclasses.replace(traverse, track=Track.local(traverse.t_us, xy, headings))


def test_a_drive_is_found_in_its_own_map(image_map: PlaceMap, day: Traverse) -> None:
    figures = evaluate(Localizer(image_map, "best"), day).figures
    assert figures["accuracy"] == 1
    assert figures["recall@1"] == 1
    assert figures["gallery_spacing_m"] == pytest.approx(2.0)


@pytest.mark.parametrize("kind", ["image_map", "network_map"])
def test_the_other_direction_is_another_view(
    kind: str, request: pytest.FixtureRequest, night: Traverse
) -> None:
    place_map: PlaceMap = request.getfixturevalue(kind)
    back = moved(night, night.xy, heading_deg=270.0)
    assert truth_of(place_map, back, "places").seen.all()
    assert not truth_of(place_map, back, "view").seen.any()
    assert truth_of(place_map, night, "view").seen.all()


def test_a_side_street_is_unseen(image_map: PlaceMap, night: Traverse) -> None:
    side = moved(night, night.xy + np.array([0.0, 200.0]))
    result = evaluate(Localizer(image_map, "best", threshold=2.0), side)
    assert result.figures["seen"] == 0
    assert result.figures["accuracy"] == 1  # nothing was accepted, and nothing was there


def test_runs_are_judged_in_step(day: Traverse, night: Traverse) -> None:
    places = PlaceRuns(len(day), every=5, tolerance=1)
    for scorer in ("sad", "ncc"):
        place_map = train(dataclasses.replace(day, track=None), places, scorer)
        truth = truth_of(place_map, night)
        assert truth.n_items == len(day)
        assert truth.right[0].sum() == 10
        assert evaluate(Localizer(place_map, "best"), night).figures["accuracy"] > 0.9


def test_what_does_not_fit_is_told(image_map: PlaceMap, night: Traverse) -> None:
    with pytest.raises(EvaluationError, match="no positions"):
        evaluate(Localizer(image_map), dataclasses.replace(night, track=None))
    with pytest.raises(EvaluationError, match="share no ground"):
        evaluate(Localizer(image_map), moved(night, night.xy + 1e5))


def test_a_query_is_put_into_the_maps_zone(day: Traverse) -> None:
    """The same road, once in zone 32 and once in zone 33, which meet at 12 degrees east."""
    import utm

    longitude = np.linspace(11.999, 12.001, len(day))
    latitude = np.full(len(day), 48.0)
    tracks = []
    for zone in (32, 33):
        easting, northing, _, _ = utm.from_latlon(latitude, longitude, force_zone_number=zone)
        heading = np.full(len(day), 90.0)
        tracks.append(Track(day.t_us, latitude, longitude, easting, northing, heading, zone, True))
    here, there = (dataclasses.replace(day, track=track) for track in tracks)
    assert here.track is not None
    place_map = train(here, PlaceGrid.from_track(here.track), "sad")
    assert abs(there.xy - here.xy).max() > 1e5
    figures = evaluate(Localizer(place_map, "best"), there).figures
    assert (figures["accuracy"], figures["unseen"]) == (1, 0)
