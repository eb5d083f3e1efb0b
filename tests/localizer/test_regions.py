"""Images that are compared with what is near a rough position alone, or near the last match."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import Drive
from evplace.core import families
from evplace.core.errors import PlaceMapError, SettingsError, TrackError
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer
from evplace.localizer._regions import FASTEST_MPS, Regions
from evplace.matchers.bayes import Bayes
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid, PlaceRuns
from evplace.sources.tracks import Track

WEST, NORTH = 500_000.0, 4_000_000.0
"""Where the made street begins; it goes east, 2 m a window."""


@pytest.fixture(scope="module")
def fused(day: Traverse, places: PlaceGrid) -> PlaceMap:
    return train(day, places)


def accepting() -> Bayes:
    """The made street is too short to be measured: what is right is accepted."""
    return Bayes(threshold=0.2)


@pytest.mark.parametrize("scorer", sorted(set(families.names("scorers")) - {"network", "notebook"}))
def test_scores_of_some_items_are_those_of_a_whole_row(
    scorer: str, day: Traverse, night: Traverse, places: PlaceGrid
) -> None:
    where = Localizer(train(day, places, scorer))
    items = np.array([41, 3, 3, 20])
    if hasattr(where.scorer, "averaging"):
        pytest.skip("takes several images")
    for image in night.images[::20]:
        wanted = where.rows(image[None])[0][items]
        np.testing.assert_allclose(where.row_of(image, items), wanted, atol=1e-4 * np.abs(wanted).max())


def test_near_a_track_only_what_is_near_is_answered(fused: PlaceMap, night: Traverse) -> None:
    where = Localizer(fused, accepting(), near_m=20.0, track=night.track)
    found = list(where.match_traverse(night))
    assert len(found) == len(night)
    assert {match.compared for match in found} == {"position"}
    for match, at in zip(found, night.xy, strict=True):
        assert match.position is not None
        assert np.hypot(*(match.position - at)) <= 20 * 2
    off = [
        np.hypot(*(match.position - at)) for match, at in zip(found, night.xy, strict=True) if match.position
    ]
    assert np.median(off) <= 4


def test_a_track_that_is_wrong_leads_to_where_it_says(fused: PlaceMap, night: Traverse) -> None:
    there = WEST + 100, NORTH
    where = Localizer(fused, accepting(), near_m=10.0, track=lambda _: there)
    for match in where.match_traverse(night):
        assert match.position is not None
        assert abs(match.position[0] - there[0]) <= 15


def test_where_no_reference_is_near_nothing_is_compared(fused: PlaceMap, night: Traverse) -> None:
    where = Localizer(fused, accepting(), near_m=50.0, track=lambda _: (WEST, NORTH + 5000))
    found = list(where.match_traverse(night[:5]))
    assert [(match.item, match.state, match.compared) for match in found] == [(-1, "unseen", "position")] * 5


def test_without_a_position_all_are_compared(fused: PlaceMap, night: Traverse) -> None:
    wanted = list(Localizer(fused, accepting()).match_traverse(night))
    assert {match.compared for match in wanted} == {"all"}
    for near in (Localizer(fused, accepting(), near_m=50.0, track=lambda _: None),):
        assert list(near.match_traverse(night)) == wanted
    lost = Localizer(fused, Bayes(threshold=1.0), near_m=50.0)  # nothing is accepted, so no match is the last
    assert {match.compared for match in lost.match_traverse(night)} == {"all"}


def test_a_track_that_begins_later_is_used_from_then_on(fused: PlaceMap, night: Traverse) -> None:
    assert night.track is not None
    begins = int(night.t_us[20])
    late = dataclasses.replace(
        night.track, **{name: getattr(night.track, name)[20:]
                        for name in ("t_us", "latitude", "longitude", "easting", "northing", "heading_deg")}
    )  # fmt: skip
    where = Localizer(fused, accepting(), near_m=30.0, track=late)
    for match in where.match_traverse(night):
        assert match.compared == ("position" if match.t_us >= begins else "all")


def test_near_the_last_match_what_is_near_is_answered(fused: PlaceMap, night: Traverse) -> None:
    where = Localizer(fused, accepting(), near_m=30.0)
    found = list(where.match_traverse(night))
    compared = [match.compared for match in found]
    first = compared.index("match")
    assert 0 < first < 20
    assert set(compared[:first]) == {"all"}
    assert compared[first:].count("match") > 20
    wanted = list(Localizer(fused, accepting()).match_traverse(night))
    assert np.mean([abs(a.item - b.item) <= 2 for a, b in zip(found, wanted, strict=True)]) > 0.9


def test_packets_of_events_go_the_same_way(fused: PlaceMap, night_drive: Drive, night: Traverse) -> None:
    where = Localizer(fused, accepting(), near_m=30.0, track=night.track)
    pushed = list(where.push(night_drive.events)) + list(where.finish())
    where.reset()
    wanted = list(where.match_traverse(night))
    assert [match for match in pushed if match.state != "no-events"] == wanted


@given(st.lists(st.tuples(st.floats(-50, 170), st.floats(-40, 40)), min_size=1, max_size=8), st.floats(5, 80))
def test_all_that_is_near_is_compared_and_nothing_far(
    fused: PlaceMap, ways: list[tuple[float, float]], near_m: float
) -> None:
    where = iter(ways)
    regions = Regions(fused, near_m, lambda _: (WEST + (at := next(where))[0], NORTH + at[1]))
    for east, north in ways:
        compared, items = regions.at(0)
        assert compared == "position"
        assert items is not None
        away = np.hypot(*(fused.items.position - [WEST + east, NORTH + north]).T)
        assert set(np.flatnonzero(away <= near_m)) <= set(items)
        assert (away[items] <= 2 * near_m + 1e-6).all()


def test_a_match_is_a_rough_position_for_a_while(fused: PlaceMap) -> None:
    regions = Regions(fused, 100.0)
    assert regions.at(0) == ("all", None)
    regions.found(1_000_000, (WEST + 50, NORTH))
    for_s = 100 / FASTEST_MPS
    assert regions.at(1_000_000).compared == "match"
    assert regions.at(1_000_000 + round(for_s * 1e6)).compared == "match"
    assert regions.at(1_000_000 + round(for_s * 1e6) + 1).compared == "all"


def test_what_cannot_be_asked_is_refused(
    fused: PlaceMap, day: Traverse, night: Traverse, image_map: PlaceMap
) -> None:
    for near_m in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(SettingsError, match="`near_m` is metres above 0"):
            Localizer(fused, near_m=near_m)
    with pytest.raises(SettingsError, match="`track` says where to compare, and `near_m` how far"):
        Localizer(fused, track=night.track)
    with pytest.raises(SettingsError, match="compare all references: leave out `near_m`"):
        Localizer(fused, near_m=20.0).answers(night)
    lost = Traverse(day.images, day.t_us, day.counts, None, day.recipe)
    with pytest.raises(PlaceMapError, match="no item of the map has a position"):
        Localizer(train(lost, PlaceRuns(len(day), every=10), "ncc"), near_m=20.0)
    assert night.track is not None
    on_earth = dataclasses.replace(image_map, zone=(32, True))
    with pytest.raises(TrackError, match="local plane and positions on the Earth"):
        Localizer(on_earth, near_m=20.0, track=Track.local([0, 1], [[0.0, 0.0], [1.0, 0.0]]))
