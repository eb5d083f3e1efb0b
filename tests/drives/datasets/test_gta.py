from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.core.errors import DatasetError, TrackError, TraverseError
from evplace.drives.datasets import drives, open_drive
from evplace.drives.to_traverse import open_traverse
from evplace.sources.film import Film
from made_sets import write_gta


def test_frames_and_poses(tmp_path: Path) -> None:
    place = write_gta(tmp_path, images=12)
    write_gta(tmp_path, "night")
    assert drives(tmp_path) == ["day", "night"]
    assert drives(place) == ["day"]
    drive = open_drive(tmp_path, "day")
    assert isinstance(drive.source, Film)
    assert [t_us for t_us, _ in drive.source][:3] == [0, 16_666, 33_333]
    assert drive.source.frames is not None
    assert [file.name for file in drive.source.frames.files][-2:] == ["10.jpg", "11.jpg"]
    assert drive.track is not None
    assert drive.track.zone == 0
    np.testing.assert_allclose(drive.track.xy[:2], [[-100, 50], [-99.8, 50]])
    assert drive.track.heading_deg[0] == 90


def test_events_by_default_and_colours(tmp_path: Path) -> None:
    write_gta(tmp_path)
    events = open_traverse(tmp_path)
    assert (events.recipe.kind, events.recipe.windows.dt) == ("events", "1/60")
    assert open_traverse(tmp_path, kind="frames").images.shape == (6, 90, 160, 3)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("dataset/images/6.jpg 1 2 3 4 5 6\n", "names 1 images that .* lacks, first 6.jpg"),
        ("dataset/images/0.jpg 1 2 3\n", "line 7: an image's name and six numbers"),
        ("dataset/images/0.jpg 1 nan 3 4 5 6\n", "line 7: the pose is not a number"),
    ],
)
def test_poses_that_do_not_fit(tmp_path: Path, line: str, words: str) -> None:
    poses = write_gta(tmp_path) / "6dpose_list.txt"
    poses.write_text(poses.read_text() + line)
    with pytest.raises((TrackError, TraverseError), match=words):
        open_drive(tmp_path)


def test_missing_parts(tmp_path: Path) -> None:
    place = write_gta(tmp_path)
    poses = (place / "6dpose_list.txt").read_text()
    (place / "6dpose_list.txt").write_text("\n")
    with pytest.raises(TrackError, match="holds no poses"):
        open_drive(tmp_path)
    (place / "6dpose_list.txt").write_text(poses)
    for file in (place / "images").iterdir():
        file.unlink()
    with pytest.raises(DatasetError, match="images are missing"):
        open_drive(tmp_path)
