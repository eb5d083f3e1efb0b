"""Events in, matches out: packets change nothing, files and evaluation go the same way."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conftest import Drive, make_drive, make_traverse
from evplace.core.errors import PlaceMapError, RecordingError, SettingsError
from evplace.core.events import Events
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer, Match
from evplace.placemap import PlaceMap
from evplace.places import PlaceGrid
from evplace.scorers._network.training import train


def pushed(where: Localizer, packets: list[Events]) -> list[Match]:
    where.reset()
    found = [match for packet in packets for match in where.push(packet)]
    return found + list(where.finish())


@pytest.mark.parametrize("kind", ["image_map", "network_map"])
@pytest.mark.parametrize("matcher", ["best", "local"])
def test_events_are_answered_as_their_traverse_is(
    kind: str, matcher: str, request: pytest.FixtureRequest, night_drive: Drive, night: Traverse
) -> None:
    where = Localizer(request.getfixturevalue(kind), matcher)
    live = pushed(where, [night_drive.events])
    path, _ = where.path(night)
    assert [match.t_us for match in live] == night.t_us.tolist()
    assert [match.item for match in live] == path.item.tolist()
    assert [match.state == "localised" for match in live] == path.accepted.tolist()
    np.testing.assert_allclose([match.score for match in live], path.score, atol=1e-5)


@settings(max_examples=10)
@given(cuts=st.lists(st.integers(0, 40_000), max_size=12))
def test_the_size_of_packets_changes_nothing(
    image_map: PlaceMap, night_drive: Drive, cuts: list[int]
) -> None:
    where = Localizer(image_map, "best")
    events = night_drive.events
    edges = [0, *sorted(min(cut, len(events)) for cut in cuts), len(events)]
    parts = [events[a:b] for a, b in itertools.pairwise(edges)]
    assert pushed(where, parts) == pushed(where, [events])


def test_it_finds_the_way(image_map: PlaceMap, night: Traverse, places: PlaceGrid) -> None:
    path, rows = Localizer(image_map, "best").path(night)
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
    path, rows = Localizer(image_map, "best").path(traverse)
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
    with pytest.raises(PlaceMapError, match="same image settings"):
        Localizer(image_map).path(Traverse(day.images[:, :50], day.t_us, day.counts))
    frames = Traverse(day.images, day.t_us, day.counts, day.track, {"input": "frames"})
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
