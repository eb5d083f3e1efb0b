"""A localizer on a query traverse: both rules, runs, zones, and what does not fit."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from evplace.core import tables
from evplace.core.errors import EvaluationError
from evplace.evaluation._evaluate import evaluate, truth_of
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.matchers import _kept
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid, PlaceRuns
from evplace.sources.tracks import Track


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


def test_samples_come_from_the_map_or_from_its_drive(
    image_map: PlaceMap, network_map: PlaceMap, day: Traverse, night: Traverse
) -> None:
    own = evaluate(Localizer(image_map, "best"), night).samples
    assert own is not None
    assert len(own.query) == 8
    np.testing.assert_array_equal(own.images[:, 0], night.images[own.query])
    lent = evaluate(Localizer(network_map, "best"), night, reference=day)
    assert lent.samples is not None
    assert lent.true_item is not None
    centre = network_map.items.position[lent.true_item[lent.samples.query[0]]]
    nearest = np.argmin(np.hypot(*(day.xy - centre).T))
    np.testing.assert_array_equal(lent.samples.images[0, 2], day.images[nearest])
    assert evaluate(Localizer(network_map, "best"), night).samples is None


def test_samples_of_runs_show_the_middle_of_each(day: Traverse) -> None:
    drive = dataclasses.replace(day, track=None)
    place_map = train(drive, PlaceRuns(len(day), every=10), "network", steps=2, batch=8)
    result = evaluate(Localizer(place_map, "best"), drive, reference=drive)
    assert result.samples is not None
    assert result.true_item is not None
    np.testing.assert_array_equal(
        result.samples.images[:, 2], day.images[result.true_item[result.samples.query] * 10 + 5]
    )


def test_a_reference_that_does_not_fit_is_told(network_map: PlaceMap, day: Traverse, night: Traverse) -> None:
    with pytest.raises(EvaluationError, match="reference drive has images of shape"):
        evaluate(Localizer(network_map), night, reference=dataclasses.replace(day, images=day.images[:, ::2]))
    with pytest.raises(EvaluationError, match="reference drive has no positions"):
        evaluate(Localizer(network_map), night, reference=dataclasses.replace(day, track=None))


def test_results_keep_positions_and_time(image_map: PlaceMap, night: Traverse) -> None:
    result = evaluate(Localizer(image_map, "best"), night)
    np.testing.assert_array_equal(result.query_xy, night.xy)
    np.testing.assert_array_equal(result.item_xy, image_map.items.position)
    assert result.took_s is not None
    assert np.nanmedian(result.error_m) < 5


@pytest.mark.parametrize("answers", ["live", "hindsight"])
def test_rows_that_memory_does_not_hold_give_the_same_result(
    image_map: PlaceMap, night: Traverse, answers: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Some images without events are passed over."""
    counts = night.counts.copy()
    counts[3:5] = 0
    drive = dataclasses.replace(night, counts=counts)
    held = evaluate(Localizer(image_map), drive, answers=answers)
    monkeypatch.setattr(tables, "MEMORY_BYTES", 0)
    monkeypatch.setattr(_kept, "MEMORY_BYTES", 0)
    written = evaluate(Localizer(image_map), drive, answers=answers)
    assert isinstance(written.scores, np.memmap)
    assert written.figures == held.figures
    np.testing.assert_array_equal(written.scores, held.scores)
