"""Matches as files: each format holds what the matches say, and what our own readers find again."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from evplace.cli import main
from evplace.core import families
from evplace.core.errors import OutputError
from evplace.exports import Located, format_of, located, of_track
from evplace.imaging.traverse import Traverse
from evplace.localizer import Match
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid, PlaceRuns
from evplace.sources.tracks import Track, open_track

EAST, NORTH = 500_000.0, 5_000_000.0
PLACES = [
    Match(1_000_000 + 100_000 * i, i, i // 3, (EAST + 2.0 * i, NORTH), 0.9, "localised", 0.95, 3.0, 90.0)
    for i in range(40)
]
UNSURE = dataclasses.replace(PLACES[0], t_us=900_000, state="unseen", probability=math.nan)
NO_EVENTS = Match(800_000, -1, -1, None, math.nan, "no-events")


@pytest.fixture
def town(day: Traverse) -> PlaceMap:
    """A map in UTM zone 32."""
    assert day.track is not None
    made = train(day, PlaceGrid.from_track(day.track), "ncc", matcher="best")
    return dataclasses.replace(made, zone=(32, True))


def text(name: str, matches: Sequence[Match], place_map: PlaceMap) -> str:
    lines = families.load("exports", name).lines(located(matches, place_map))
    return "".join(f"{line}\n" for line in lines)


@pytest.mark.parametrize("name", ["gpx", "nmea", "csv", "tum"])
def test_our_own_reader_finds_the_sure_positions_again(name: str, town: PlaceMap, tmp_path: Path) -> None:
    path = tmp_path / f"drive.{name}"
    path.write_text(text(name, [NO_EVENTS, UNSURE, *PLACES], town))
    found = open_track(path)
    wanted = [match for match in PLACES if match.position is not None]
    if name == "csv":  # all matches stand in it
        wanted = [UNSURE, *wanted]
    assert found.t_us.tolist() == [match.t_us for match in wanted]
    assert found.zone == (0 if name == "tum" else 32)
    np.testing.assert_allclose(found.xy, [match.position for match in wanted], atol=0.03)


def test_geojson_is_a_collection_of_points(town: PlaceMap) -> None:
    found = json.loads(text("geojson", [NO_EVENTS, UNSURE, *PLACES], town))
    assert found["type"] == "FeatureCollection"
    assert len(found["features"]) == len(PLACES)
    first = found["features"][0]
    longitude, latitude = first["geometry"]["coordinates"]
    assert (round(longitude), round(latitude)) == (9, 45)
    assert first["properties"]["state"] == "localised"
    assert json.loads(text("geojson", [], town))["features"] == []


def test_gpx_begins_a_segment_after_each_gap(town: PlaceMap) -> None:
    root = ElementTree.fromstring(text("gpx", [*PLACES[:5], UNSURE, NO_EVENTS, *PLACES[5:8]], town))
    space = "{http://www.topografix.com/GPX/1/1}"
    segments = root.findall(f"{space}trk/{space}trkseg")
    assert [len(segment) for segment in segments] == [5, 3]


def test_json_lines_hold_null_for_what_is_unknown(town: PlaceMap) -> None:
    first, second = map(json.loads, text("json", [NO_EVENTS, PLACES[3]], town).splitlines())
    assert first["latitude"] is None
    assert first["score"] is None
    assert second["position"] == [EAST + 6, NORTH]


def test_tum_turns_x_where_the_camera_looks(town: PlaceMap) -> None:
    north = dataclasses.replace(PLACES[0], heading_deg=0.0)
    last = [float(cell) for cell in text("tum", [north], town).splitlines()[-1].split()]
    assert last[:4] == [1.0, EAST, NORTH, 0.0]
    np.testing.assert_allclose(last[6:], [math.sqrt(0.5), math.sqrt(0.5)], atol=1e-6)


def test_a_map_without_degrees_says_which_formats_there_are(town: PlaceMap, day: Traverse) -> None:
    plane = dataclasses.replace(town, zone=(0, True))
    for name in ("gpx", "geojson", "nmea"):
        with pytest.raises(OutputError, match="choose csv, json or tum"):
            format_of(None, name, plane)
    format_of(None, "tum", plane)
    bare = train(dataclasses.replace(day, track=None), PlaceRuns(len(day), 4, 0), "ncc", matcher="best")
    with pytest.raises(OutputError, match="choose csv or json"):
        format_of(None, "tum", bare)
    with pytest.raises(OutputError, match="cannot tell the format"):
        format_of(Path("a.xyz"), None, town)


def test_a_track_is_written_as_a_log(town: PlaceMap, tmp_path: Path) -> None:
    track = Track.local(np.arange(50) * 100_000, np.column_stack([np.arange(50) * 2.0, np.zeros(50)]))
    found: list[Located] = list(of_track(track))
    assert [one.match.t_us for one in found] == track.t_us.tolist()
    assert all(one.is_sure for one in found)


def test_localize_writes_what_its_file_is_called(
    street: Path, files: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("gpx", "geojson", "nmea", "tum", "jsonl", "csv"):
        out = tmp_path / f"night.{name}"
        words = ["localize", str(street), f"{files}/night.aedat4", "--matcher", "best", "-o", str(out)]
        assert main(words) == 0
        form = "json" if name == "jsonl" else name
        assert main([*words[:-2], "--format", form]) == 0
        assert capsys.readouterr().out == out.read_text()


def test_nothing_is_written_before_the_input_is_open(
    street: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    missing: Any = tmp_path / "missing.aedat4"
    for out in ([], ["-o", str(tmp_path / "out.gpx")]):
        assert main(["localize", str(street), str(missing), *out]) == 2
        assert capsys.readouterr().out == ""
        assert list(tmp_path.iterdir()) == []
