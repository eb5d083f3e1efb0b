"""Folders of images: order, times, lists and what can be wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.errors import TraverseError
from evplace.frames import open_frames


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for number in (10, 9, 1):
        Image.fromarray(np.full((3, 4), number, np.uint8)).save(tmp_path / f"image_{number}.png")
    return tmp_path


def test_images_stand_in_the_order_of_their_numbers(folder: Path) -> None:
    frames = open_frames(folder, fps=10)
    assert [image[0, 0] for image in frames] == [1, 9, 10]
    assert frames.t_us.tolist() == [0, 100_000, 200_000]
    assert not frames.timed


def test_a_list_chooses_and_orders(folder: Path) -> None:
    (folder / "list.csv").write_text("Image_name,index\nimage_10.png,0\nimage_1.png,1\n")
    assert [image[0, 0] for image in open_frames(folder, folder / "list.csv")] == [10, 1]


def test_times_are_read_in_seconds(folder: Path) -> None:
    (folder / "timestamps.txt").write_text("0.5\n0.75\n1.000001\n")
    frames = open_frames(folder)
    assert frames.timed
    assert frames.t_us.tolist() == [500_000, 750_000, 1_000_001]


def test_real_frames(data: Path) -> None:
    frames = open_frames(data / "frames" / "vid2e" / "images")
    assert len(frames) == 161
    assert frames.t_us[1] == 1866
    assert next(iter(frames)).shape[:2] == (180, 240)


@pytest.mark.parametrize("times", ["0\n1\n", "0\n0\n1\n", "0\nnow\n2\n", "0\ninf\n1\n"])
def test_times_that_do_not_fit_are_refused(folder: Path, times: str) -> None:
    (folder / "timestamps.txt").write_text(times)
    with pytest.raises(TraverseError, match=r"timestamps\.txt"):
        open_frames(folder)


def test_other_faults_are_told(folder: Path, tmp_path: Path) -> None:
    (folder / "list.csv").write_text("image_10.png\nimage_77.png\n")
    with pytest.raises(TraverseError, match="image_77"):
        open_frames(folder, folder / "list.csv")
    with pytest.raises(TraverseError, match="no folder"):
        open_frames(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(TraverseError, match="holds no images"):
        open_frames(tmp_path / "empty")
    (folder / "image_9.png").write_bytes(b"no image")
    with pytest.raises(TraverseError, match="cannot read the image"):
        list(open_frames(folder))
