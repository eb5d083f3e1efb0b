"""Folders of images: order, times, lists and what can be wrong with them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from evplace.core.errors import TraverseError
from evplace.sources.frames import _natural, image_files, open_frames


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


def test_16_bits_are_scaled_to_8(tmp_path: Path) -> None:
    deep = np.array([[0, 256, 257, 32_896, 65_535]], np.uint16)
    Image.fromarray(deep).save(tmp_path / "0.png")
    Image.fromarray(deep.astype(">u2")).save(tmp_path / "1.tif")
    for image in open_frames(tmp_path):
        assert image.dtype == np.uint8
        assert image.tolist() == [[0, 0, 1, 128, 255]]


@pytest.mark.parametrize("kind", [np.float32, np.int32])
def test_32_bits_are_refused(tmp_path: Path, kind: type[np.generic]) -> None:
    Image.fromarray(np.full((3, 4), 0.5).astype(kind)).save(tmp_path / "0.tif")
    with pytest.raises(TraverseError, match=r"0\.tif has 32 bits a pixel"):
        list(open_frames(tmp_path))


def test_images_that_are_too_large_are_refused(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 5)
    with pytest.raises(TraverseError, match=r"image_1\.png is too large"):
        list(open_frames(folder))


@given(
    st.permutations(["1.png", "a.png", "a1.bmp", "a1.png", "a01b.png", "a2.png", "left_1.png", "right_1.png"])
)
def test_the_order_does_not_hang_on_the_file_system(names: list[str]) -> None:
    wanted = ["1.png", "a.png", "a1.bmp", "a1.png", "a01b.png", "a2.png", "left_1.png", "right_1.png"]
    assert [file.name for file in sorted(map(Path, names), key=_natural)] == wanted


def test_names_that_are_decimal_numbers(tmp_path: Path) -> None:
    names = ["1305031102.25", "1305031102.5", "1305031103.1"]
    for name in reversed(names):
        (tmp_path / f"{name}.png").touch()
    assert [file.stem for file in image_files(tmp_path)] == names


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
