"""Traverses in memory and on disk, from recordings and from folders of images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from conftest import Drive
from evplace.core.errors import OutputError, TrackError, TraverseError
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.recipe import Recipe
from evplace.imaging.traverse import Traverse, new_traverse
from evplace.imaging.windows import WindowSettings
from evplace.sources.tracks import Track


def write_npz(path: Path, drive: Drive) -> Path:
    events = drive.events
    np.savez(path, t=events.t_us, x=events.x, y=events.y, p=events.p, size=np.array(events.size))
    return path


def test_a_saved_traverse_comes_back(day: Traverse, tmp_path: Path) -> None:
    day.save(tmp_path / "day")
    loaded = Traverse.load(tmp_path / "day")
    np.testing.assert_array_equal(loaded.images, day.images)
    np.testing.assert_array_equal(loaded.t_us, day.t_us)
    np.testing.assert_array_equal(loaded.counts, day.counts)
    np.testing.assert_array_equal(loaded.xy, day.xy)
    assert isinstance(loaded.images, np.memmap)
    assert loaded.info == day.info


def test_a_recording_becomes_its_event_images(night_drive: Drive, night: Traverse, tmp_path: Path) -> None:
    file = write_npz(tmp_path / "night.npz", night_drive)
    found = open_traverse(file, track=night_drive.track, size=(80, 60), time_unit="us")
    np.testing.assert_array_equal(found.images, night.images)
    np.testing.assert_array_equal(found.t_us, night.t_us)
    np.testing.assert_array_equal(found.xy, night.xy)
    half = open_traverse(
        file, recipe=Recipe(windows=WindowSettings("1/15")), width=40, size=(80, 60), time_unit="us"
    )
    assert half.images.shape == (30, 90, 40)
    assert half.track is None


def test_a_folder_of_images(tmp_path: Path) -> None:
    for number in range(3):
        Image.fromarray(np.full((40, 60, 3), number, np.uint8)).save(tmp_path / f"{number}.png")
    found = open_traverse(tmp_path)
    assert found.images.shape == (3, 90, 160, 3)
    assert found.counts.tolist() == [-1, -1, -1]
    assert found.images[2, 0, 0].tolist() == [2, 2, 2]
    Image.fromarray(np.zeros((41, 60, 3), np.uint8)).save(tmp_path / "3.png")
    with pytest.raises(TraverseError, match=r"3\.png is \(41, 60, 3\)"):
        open_traverse(tmp_path)


def test_a_track_of_another_time_is_refused(night_drive: Drive, tmp_path: Path) -> None:
    file = write_npz(tmp_path / "night.npz", night_drive)
    later = Track.local(night_drive.track.t_us + 10**9, night_drive.track.xy)
    with pytest.raises(TrackError, match="do not overlap"):
        open_traverse(file, track=later, size=(80, 60), time_unit="us")


def test_a_part_of_a_traverse(day: Traverse) -> None:
    part = day[10:20]
    assert len(part) == 10
    np.testing.assert_array_equal(part.xy, day.xy[10:20])


def test_what_is_no_traverse_is_told(day: Traverse, tmp_path: Path) -> None:
    with pytest.raises(TraverseError, match="cannot read"):
        Traverse.load(tmp_path / "nothing")
    day.save(tmp_path / "day")
    with pytest.raises(OutputError, match="exists"):
        day.save(tmp_path / "day")
    images = tmp_path / "day" / "images.npy"
    images.write_bytes(images.read_bytes()[:-100])
    with pytest.raises(TraverseError, match="damaged"):
        Traverse.load(tmp_path / "day")
    with pytest.raises(TraverseError, match="equally many"):
        Traverse(day.images, day.t_us[1:], day.counts)


def test_nothing_half_written_is_left(day: Traverse, tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), new_traverse(tmp_path / "day", {}) as writer:
        writer.add(day.images[0], 1)
        raise KeyboardInterrupt
    with pytest.raises(TraverseError, match="no image came"), new_traverse(tmp_path / "day", {}):
        pass
    assert list(tmp_path.iterdir()) == []
