from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.core.errors import DatasetError, TraverseError
from evplace.drives.datasets import drives, matching, open_drive
from evplace.drives.to_traverse import open_traverse
from made_sets import picture, write_own


def write_film(folder: Path, timed: bool = True) -> None:
    folder.mkdir()
    for n in range(4):
        Image.fromarray(picture(n)).save(folder / f"{n}.png")
    if timed:
        (folder / "timestamps.txt").write_text("".join(f"{1_700_000_000 + n * 0.5}\n" for n in range(4)))


def test_recordings_images_and_logs_of_one_name(tmp_path: Path) -> None:
    write_own(tmp_path)
    (tmp_path / "README.md").write_text("my drives\n")
    write_film(tmp_path / "film")
    (tmp_path / "night.csv").rename(tmp_path / "film.csv")
    (tmp_path / "day_hot_pixels.txt").write_text("1,2\n")
    assert matching(tmp_path) == ["own"]
    assert drives(tmp_path) == ["day", "film", "night"]
    day = open_traverse(tmp_path, drive="day")
    assert day.track is not None
    assert day.track.known.all()
    assert day.mask is not None
    assert np.argwhere(day.mask).tolist() == [[2, 1]]
    (tmp_path / "film_hot_pixels.txt").write_text("1,2\n")  # of no use for images
    film = open_traverse(tmp_path, drive="film")
    assert film.recipe.kind == "frames"
    assert film.track is not None
    assert film.track.known.all()
    with pytest.raises(DatasetError, match=r"night.npz has no GPS log: put one of night.nmea, night.gpx"):
        open_drive(tmp_path, "night")


def test_images_need_times(tmp_path: Path) -> None:
    write_own(tmp_path, ("day", "film"))
    (tmp_path / "film.npz").unlink()
    write_film(tmp_path / "film", timed=False)
    with pytest.raises(TraverseError, match=r"film have no times: put them into timestamps.txt"):
        open_drive(tmp_path, "film")


def test_two_recordings_of_one_name(tmp_path: Path) -> None:
    write_own(tmp_path, ("day",))
    write_film(tmp_path / "day")
    with pytest.raises(DatasetError, match=r"several recordings of 'day': day, day.npz"):
        open_drive(tmp_path)


def test_recordings_without_any_log_are_no_set(tmp_path: Path) -> None:
    write_own(tmp_path)
    for log in tmp_path.glob("*.csv"):
        log.unlink()
    assert matching(tmp_path) == []
