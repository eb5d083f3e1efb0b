"""Events in, matches out: packets change nothing, files and evaluation go the same way."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conftest import Drive, make_drive, make_traverse
from evplace.core import families
from evplace.core.errors import PlaceMapError, RecordingError, SettingsError
from evplace.core.events import Events
from evplace.evaluation._evaluate import evaluate
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer, Match
from evplace.matchers.local import Local
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid


def pushed(where: Localizer, packets: list[Events]) -> list[Match]:
    where.reset()
    found = [match for packet in packets for match in where.push(packet)]
    return found + list(where.finish())


def in_pieces(events: Events, cuts: list[int]) -> list[Events]:
    edges = [0, *sorted(min(cut, len(events)) for cut in cuts), len(events)]
    return [events[a:b] for a, b in itertools.pairwise(edges)]


FITTED = {"local": {"tau1": 0.5}, "seqslam": {"ds": 7, "mu": 1.0}}
"""Settings that fit this short street; the other matchers take their defaults."""


@pytest.mark.parametrize("matcher", families.names("matchers"))
@settings(max_examples=6)
@given(cuts=st.lists(st.integers(0, 40_000), max_size=12))
def test_packets_of_any_size_and_their_traverse_are_answered_alike(
    matcher: str, image_map: PlaceMap, night_drive: Drive, night: Traverse, cuts: list[int]
) -> None:
    """Pushed in any pieces, as a traverse, or evaluated: the same answers, to the last bit."""
    where = Localizer(image_map, matcher, **FITTED.get(matcher, {}))
    live = pushed(where, in_pieces(night_drive.events, cuts))
    where.reset()
    assert list(where.match_traverse(night)) == live
    measured = evaluate(where, night).answers
    answered = {match.t_us: match for match in live}
    for at, t_us in enumerate(night.t_us.tolist()):
        match = answered.get(t_us)
        if match is None:
            assert measured.item[at] == -1
            assert not measured.accepted[at]
            continue
        assert measured.item[at] == match.item
        assert measured.accepted[at] == (match.state == "localised")
        np.testing.assert_equal(measured.score[at], match.score)


def test_a_network_is_pushed_and_evaluated_alike(
    network_map: PlaceMap, night_drive: Drive, night: Traverse
) -> None:
    where = Localizer(network_map, "local")
    live = pushed(where, [night_drive.events])
    path = where.answers(night).path
    assert [match.t_us for match in live] == night.t_us.tolist()
    assert [match.item for match in live] == path.item.tolist()
    assert [match.score for match in live] == path.score.tolist()


def test_the_same_localizer_answers_live_and_in_hindsight(image_map: PlaceMap, night: Traverse) -> None:
    where = Localizer(image_map, "seqslam", ds=7, mu=0.0)
    live, hindsight = where.answers(night), where.answers(night, "hindsight")
    assert live.delay == 3
    assert hindsight.delay == len(night) - 1
    np.testing.assert_array_equal(live.path.item, hindsight.path.item)
    assert (live.path.item[-3:] == -1).all()
    again = where.answers(night, rows=live.rows)
    np.testing.assert_array_equal(again.path.score, live.path.score)


def test_a_matcher_by_name_and_as_an_object_are_the_same(image_map: PlaceMap, night: Traverse) -> None:
    named = Localizer(image_map, "local", K=2, tau1=0.6)
    given_one = Localizer(image_map, Local(K=2, tau1=0.6))
    assert named.settings == given_one.settings
    for ours, theirs in zip(named.answers(night).path, given_one.answers(night).path, strict=True):
        np.testing.assert_array_equal(ours, theirs)
    with pytest.raises(SettingsError, match="put them into the object"):
        Localizer(image_map, Local(), K=2)


def test_it_finds_the_way(image_map: PlaceMap, night: Traverse, places: PlaceGrid) -> None:
    path, rows, _ = Localizer(image_map, "best").answers(night)
    assert rows.shape == (len(night), len(image_map.items))
    assert places.accepts(image_map.items.place[path.item], night.xy).mean() > 0.95


def test_matches_say_where(image_map: PlaceMap, night_drive: Drive) -> None:
    match = pushed(Localizer(image_map, "best"), [night_drive.events])[10]
    assert match.state == "localised"
    assert match.place == image_map.items.place[match.item]
    assert match.position == tuple(image_map.items.position[match.item])


def test_empty_windows_are_told_and_skipped(image_map: PlaceMap, night_drive: Drive) -> None:
    events = night_drive.events
    quiet = (events.t_us < 500_000) | (events.t_us > 900_000)
    gap = Events(events.t_us[quiet], events.x[quiet], events.y[quiet], events.p[quiet], events.size)
    found = pushed(Localizer(image_map, "best"), [gap])
    states = [match.state for match in found]
    assert states.count("no-events") == 12
    assert len(found) == 60
    assert [match.t_us for match in found] == sorted(match.t_us for match in found)
    traverse = make_traverse(Drive(gap, night_drive.track))
    path, rows, _ = Localizer(image_map, "best").answers(traverse)
    assert [m.item for m in found] == path.item.tolist()
    assert not rows[traverse.counts == 0].any()


def test_a_stranger_is_unseen(network_map: PlaceMap) -> None:
    rng = np.random.default_rng(4)
    x, y = rng.integers(0, 80, 3000), rng.integers(0, 60, 3000)
    noise = Events.of(np.sort(rng.integers(0, 100_000, 3000)), x, y, x % 2, (80, 60))
    states = {match.state for match in pushed(Localizer(network_map, "local", tau1=0.9999999), [noise])}
    assert states == {"unseen"}


def test_another_sensor_or_another_kind_of_image_is_refused(
    image_map: PlaceMap, day: Traverse, places: PlaceGrid
) -> None:
    with pytest.raises(RecordingError, match="80x60 pixels, this recording has 320x240"):
        list(Localizer(image_map).push(Events.of([0], [0], [0], [True], (320, 240))))
    with pytest.raises(PlaceMapError, match="with the map's recipe"):
        Localizer(image_map).answers(Traverse(day.images[:, :50], day.t_us, day.counts))
    frames = dataclasses.replace(day, recipe=Recipe("frames", (80, 60)))
    with pytest.raises(PlaceMapError, match="cannot localise events"):
        list(Localizer(train(frames, places, scorer="sad")).push(make_drive().events))


def test_matchers_and_their_settings_are_checked(image_map: PlaceMap) -> None:
    with pytest.raises(SettingsError, match="known are"):
        Localizer(image_map, "nearest")
    with pytest.raises(SettingsError, match="unknown setting 'k'"):
        Localizer(image_map, "local", k=3)
    with pytest.raises(SettingsError, match="no preset"):
        Localizer(image_map, "local", preset="printed")


def test_no_events_no_matches(image_map: PlaceMap) -> None:
    assert pushed(Localizer(image_map), [Events.empty((80, 60))]) == []
    assert pushed(Localizer(image_map), []) == []
