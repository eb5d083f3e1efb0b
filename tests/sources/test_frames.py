"""Folders of images: order, times, lists and what can be wrong with them."""

from __future__ import annotations

from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from evplace.core.errors import SettingsError, TraverseError
from evplace.sources.frames import _natural, image_files, is_frames, open_frames


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


STARTS = {
    "s": 1_587_452_582,
    "ms": 1_587_452_582_000,
    "us": 1_587_452_582_000_000,
    "ns": 1_587_452_582 * 10**9,
}
"""2020-04-21 07:03:02 in each unit."""


@pytest.mark.parametrize("unit", STARTS)
@pytest.mark.parametrize("given", [False, True])
def test_dates_in_any_unit(folder: Path, unit: str, given: bool) -> None:
    second = STARTS[unit] // STARTS["s"]
    times = [STARTS[unit], STARTS[unit] + second, STARTS[unit] + 3 * second]
    (folder / "timestamps.txt").write_text("# a remark\n" + "\n".join(map(str, times)))
    frames = open_frames(folder, time_unit=unit if given else None)
    assert (frames.t_us - STARTS["us"]).tolist() == [0, 1_000_000, 3_000_000]
    assert len(frames.notes) == (not given and unit != "s")
    assert all(f"taken in {unit}, in which they are dates" in note for note in frames.notes)


@pytest.mark.parametrize(
    ("unit", "text"), [("s", "1.5"), ("ms", "1500"), ("us", "1.5e6"), ("ns", "1500000000")]
)
def test_times_that_are_no_dates_are_of_the_given_unit(folder: Path, unit: str, text: str) -> None:
    (folder / "timestamps.txt").write_text(f"0\n1\n{text}\n".replace("\n1\n", f"\n{float(text) / 2}\n"))
    assert open_frames(folder, time_unit=unit).t_us.tolist() == [0, 750_000, 1_500_000]


@pytest.mark.parametrize("step", [33_333, 33_333_333, 61])
def test_slow_images_are_told(folder: Path, step: int) -> None:
    (folder / "timestamps.txt").write_text(f"0\n{step}\n{2 * step}\n")
    frames = open_frames(folder)
    assert frames.t_us.tolist() == [0, step * 1_000_000, 2 * step * 1_000_000]
    assert f"{step:,} s apart" in frames.notes[0]
    assert "`time_unit`" in frames.notes[0]


NAMES = {
    "EuRoC (ns)": ["1403636579763555584", "1403636579813555456", "1403636579863555584"],
    "RobotCar (us)": ["1418133736861408", "1418133736923898", "1418133736986388"],
    "TUM (s)": ["1305031102.175304", "1305031102.211214", "1305031102.243211"],
    "ms": ["1587452582000", "1587452582033", "1587452582067"],
    "whole s": ["1587452582", "1587452583", "1587452585"],
    "behind a word": ["frame_1587452582000", "frame_1587452582033", "frame_1587452582067"],
}


@pytest.mark.parametrize("kind", NAMES)
def test_times_in_names_are_used_and_told(tmp_path: Path, kind: str) -> None:
    for name in reversed(NAMES[kind]):
        Image.fromarray(np.zeros((3, 4), np.uint8)).save(tmp_path / f"{name}.png")
    frames = open_frames(tmp_path)
    assert frames.timed
    exact = [Decimal(name.rpartition("_")[2]) for name in NAMES[kind]]
    scale = {"E": 10**-3, "R": 1, "T": 10**6, "m": 10**3, "w": 10**6, "b": 10**3}[kind[0]]
    assert frames.t_us.tolist() == pytest.approx([float(value) * scale for value in exact], abs=1)
    assert np.diff(frames.t_us).tolist() == pytest.approx(np.diff(exact).astype(float) * scale, abs=1.5)
    assert "the times of the images are those in their names" in frames.notes[0]
    (tmp_path / "timestamps.txt").write_text("0\n1\n2\n")
    assert open_frames(tmp_path).t_us.tolist() == [0, 1_000_000, 2_000_000]


@pytest.mark.parametrize(
    "names",
    [
        ["1", "2", "3"],
        ["000001", "000002"],
        ["20200421070302", "20200421070303"],
        ["1587452582", "other"],
        ["left_1587452582", "right_1587452582"],
        ["b_1587452582", "a_1587452583"],
    ],
)
def test_names_that_are_no_times(tmp_path: Path, names: list[str]) -> None:
    for name in names:
        (tmp_path / f"{name}.png").touch()
    listing = tmp_path / "list.csv"
    listing.write_text("\n".join(f"{name}.png" for name in names[:: -1 if names[0][0] == "b" else 1]))
    frames = open_frames(tmp_path, listing if names[0][0] == "b" else None)
    assert (frames.timed, frames.notes) == (False, ())


def test_a_unit_makes_times_of_any_numbers_in_names(folder: Path) -> None:
    assert open_frames(folder, time_unit="ms").t_us.tolist() == [1000, 9000, 10_000]
    (folder / "other.png").touch()
    with pytest.raises(SettingsError, match="no times of the unit ms"):
        open_frames(folder, time_unit="ms")
    with pytest.raises(SettingsError, match="takes s, ms, us or ns"):
        open_frames(folder, time_unit="min")


@pytest.mark.parametrize("name", ["._image_1.png", ".hidden.png", ".png", ".1.jpg", "._.tif"])
def test_hidden_files_are_no_images(folder: Path, name: str) -> None:
    (folder / name).write_bytes(b"\x00\x05\x16\x07 Mac OS X")
    assert [image[0, 0] for image in open_frames(folder)] == [1, 9, 10]
    for file in folder.glob("image_*"):
        file.unlink()
    assert not is_frames(folder)


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
