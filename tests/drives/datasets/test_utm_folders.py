from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import utm
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from evplace.core.errors import OutputError, TrackError, TraverseError
from evplace.drives.datasets import drives, open_drive, utm_folders
from evplace.drives.datasets.utm_folders import write_images
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.traverse import Traverse
from evplace.sources.tracks import Fixes, Track
from made_sets import SAN_FRANCISCO, write_utm


def some_drive(colours: bool = False) -> Traverse:
    """Three images of Brisbane, the second without a position."""
    t_us = np.array([1_500_000, 2_500_000, 3_500_000])
    fixes = Fixes(t_us[[0, 2]], np.array([-27.5, -27.5001]), np.array([152.9, 152.9002]), np.full(2, np.nan))
    shape = (3, 8, 16, 3) if colours else (3, 8, 16)
    images = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape) // 16 * 16
    return Traverse(images, t_us, np.full(3, -1), Track.of(fixes).at(t_us, max_gap_s=0.1))


def test_database_and_queries(tmp_path: Path) -> None:
    write_utm(tmp_path, "database", [SAN_FRANCISCO, SAN_FRANCISCO.replace("4388.51", "4390.51")])
    write_utm(tmp_path, "queries", [SAN_FRANCISCO])
    assert drives(tmp_path) == ["database", "queries"]
    found = open_traverse(tmp_path, drive="database")
    assert found.images.shape == (2, 90, 160)
    assert found.track is not None
    assert (found.track.zone, found.track.northern) == (10, True)
    assert found.track.easting.tolist() == [544388.51, 544390.51]
    assert found.track.latitude[0] == pytest.approx(37.70098, abs=1e-4)


def test_only_the_first_two_fields_are_required(tmp_path: Path) -> None:
    write_utm(tmp_path / "images" / "test", "queries", ["@100.5@200.25", "@101.5@200.25"])
    found = open_traverse(tmp_path, drive="queries")
    assert found.track is not None
    assert found.track.zone == 0
    assert found.track.xy.tolist() == [[100.5, 200.25], [101.5, 200.25]]


def test_further_fields_may_be_anything(tmp_path: Path) -> None:
    write_utm(tmp_path, "database", ["@100.5@200.25@a street", "@101.5@200.25@10@", "@102.5@200.25@000123"])
    track = open_drive(tmp_path).track
    assert track is not None
    assert (track.zone, track.easting.tolist()) == (0, [100.5, 101.5, 102.5])


def test_images_of_several_sizes_and_folders(tmp_path: Path) -> None:
    place = write_utm(tmp_path, "queries", ["@100.5@200.25", "@101.5@200.25"])
    (place / "night").mkdir()
    Image.new("RGB", (40, 20), (9, 9, 9)).save(place / "night" / "@102.5@200.25@.jpg")
    found = open_traverse(tmp_path, drive="queries")
    assert found.images[:, 0, 0].tolist() == [0, 20, 9]


@pytest.mark.parametrize(
    ("names", "words"),
    [
        ([SAN_FRANCISCO, "@0544388.51@4172758.25@11@S"], r"mixes UTM zones: 10S in .*, 11S in "),
        ([SAN_FRANCISCO, "@0544388.51@4172758.25"], r"mixes UTM zones: 10S in .*, none in "),
        (
            ["@0544388.51@4172758.25@10@S", "@0544389.51@4172758.25@10@H"],
            "mixes UTM zones: 10S in .*, 10H in",
        ),
        (["@nan@4172758.25@10@S"], "position is not a number"),
        (["@east@4172758.25@10@S"], "must begin with @UTM_east@UTM_north@"),
        (["@0544388.51@4172758.25@61@S"], "no UTM zone '61S'"),
        (["@0544388.51@99172758.25@10@S"], "lies outside its UTM zone"),
    ],
)
def test_names_that_cannot_be_used(tmp_path: Path, names: list[str], words: str) -> None:
    write_utm(tmp_path, "database", names)
    with pytest.raises(TrackError, match=words):
        open_drive(tmp_path)


@pytest.mark.parametrize("colours", [False, True])
def test_what_is_written_is_read_back(tmp_path: Path, colours: bool) -> None:
    drive = some_drive(colours)
    assert drive.track is not None
    assert write_images(drive, tmp_path / "database") == 2
    names = sorted(file.name for file in (tmp_path / "database").iterdir())
    assert names[0].startswith("@0490122.74@6958179.20@56@J@-27.50000@0152.90000@")
    assert names[0].endswith("@@t1500000us@.jpg")
    assert all(len(name.split("@")) == 16 for name in names)
    back = open_traverse(tmp_path)
    assert back.t_us.tolist() == [1_500_000, 3_500_000]
    assert back.track is not None
    np.testing.assert_allclose(back.xy, drive.xy[[0, 2]], atol=0.01)
    assert back.images.shape[3:] == drive.images.shape[3:]


def test_a_local_plane_is_written_without_a_zone(tmp_path: Path) -> None:
    drive = some_drive()
    flat = dataclasses.replace(drive, track=Track.local(drive.t_us, [[0, 0], [1, 0], [-2.5, 0]]))
    assert write_images(flat, tmp_path / "queries") == 3
    assert (tmp_path / "queries" / "@0000001.00@0000000.00@@@@@@@@@@@@t2500000us@.jpg").exists()
    assert open_traverse(tmp_path).xy[:, 0].tolist() == [0, 1, -2.5]


def test_images_of_one_time_and_place_are_all_written(tmp_path: Path) -> None:
    drive = some_drive()
    still = dataclasses.replace(drive, t_us=np.full(3, 7), track=Track.local(drive.t_us, [[1, 2]] * 3))
    assert write_images(still, tmp_path / "queries") == 3
    assert len(open_traverse(tmp_path)) == 3


def test_what_cannot_be_written(tmp_path: Path) -> None:
    drive = some_drive()
    with pytest.raises(TrackError, match="no positions"):
        write_images(dataclasses.replace(drive, track=None), tmp_path / "a")
    two = dataclasses.replace(drive, images=np.zeros((3, 8, 16, 2), np.uint8))
    with pytest.raises(TraverseError, match="images of 2 channels"):
        write_images(two, tmp_path / "a")
    (tmp_path / "a").mkdir()
    with pytest.raises(OutputError, match="exists"):
        write_images(drive, tmp_path / "a")
    assert list((tmp_path / "a").iterdir()) == []


@given(st.floats(-80, 84))
def test_letters_of_the_bands(latitude: float) -> None:
    assert utm_folders._letter(latitude) == utm.latitude_to_zone_letter(latitude)
