from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.core.errors import DamagedRecordingError, InputError, MissingExtraError
from evplace.core.events import Events
from evplace.sources import film as films
from evplace.sources.film import is_video, open_film
from evplace.sources.simulators.esim import simulate
from evplace.sources.simulators.recording import SimulatedRecording


def picture(k: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    y, x = np.mgrid[:48, :64]
    return (128 + 100 * np.sin((x + k) / 6.0) * np.cos(y / 9.0)).astype(np.uint8)


def write_images(folder: Path, count: int, times: list[float] | None = None) -> Path:
    folder.mkdir()
    for k in range(count):
        Image.fromarray(picture(k)).save(folder / f"frame_{k:04d}.png")
    if times is not None:
        (folder / "timestamps.txt").write_text("".join(f"{t}\n" for t in times))
    return folder


def write_video(path: Path, count: int) -> Path:
    av = pytest.importorskip("av")
    with av.open(
        str(path), "w", options={"movflags": "faststart"} if path.suffix == ".mp4" else {}
    ) as container:
        stream = container.add_stream("mpeg4", rate=50)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = 64, 48, "yuv420p", 4_000_000
        for k in range(count):
            frame = av.VideoFrame.from_ndarray(picture(k), format="gray")
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def test_a_folder_with_times(tmp_path: Path) -> None:
    film = open_film(write_images(tmp_path / "film", 4, [1.0, 1.01, 1.03, 1.06]))
    assert film.size == (64, 48)
    assert [t for t, _ in film] == [1_000_000, 1_010_000, 1_030_000, 1_060_000]
    np.testing.assert_array_equal(next(iter(film))[1], picture(0))


def test_a_folder_without_times_goes_by_its_rate(tmp_path: Path) -> None:
    film = open_film(write_images(tmp_path / "film", 3), fps=100)
    assert [t for t, _ in film] == [0, 10_000, 20_000]


def test_colour_becomes_grey(tmp_path: Path) -> None:
    (tmp_path / "film").mkdir()
    for k in range(2):
        Image.new("RGB", (8, 6), (255, 0, 10 * k)).save(tmp_path / "film" / f"{k}.png")
    _, first = next(iter(open_film(tmp_path / "film")))
    assert first.shape == (6, 8)
    assert first[0, 0] == 76


def test_a_video_has_its_own_times(tmp_path: Path) -> None:
    film = open_film(write_video(tmp_path / "film.mp4", 6))
    frames = list(film)
    assert film.size == (64, 48)
    assert [t for t, _ in frames] == [20_000 * k for k in range(6)]
    assert np.abs(frames[3][1].astype(int) - picture(3)).mean() < 12


def test_images_as_they_are(tmp_path: Path) -> None:
    film = open_film(write_video(tmp_path / "film.mp4", 4))
    images = list(film.images())
    assert film.timed
    assert [t for t, _ in images] == [20_000 * k for k in range(4)]
    assert images[0][1].shape == (48, 64, 3)
    folder = open_film(write_images(tmp_path / "film", 3), fps=0.5)
    assert not folder.timed
    assert [(t, image.shape) for t, image in folder.images()][1] == (2_000_000, (48, 64))
    assert is_video(tmp_path / "film.mp4")
    assert not is_video(tmp_path / "film")


def test_a_film_reads_like_a_recording(tmp_path: Path) -> None:
    recording = SimulatedRecording(open_film(write_images(tmp_path / "film", 4)))
    assert recording.size == (64, 48)
    assert recording.path == tmp_path / "film"
    first, again = (Events.concatenate(list(recording.packets())) for _ in range(2))
    assert len(first) > 50
    assert np.array_equal(first.t_us, again.t_us)


def test_events_come_from_a_film(tmp_path: Path) -> None:
    film = open_film(write_images(tmp_path / "film", 8))
    assert len(Events.concatenate(list(simulate(film, film.size)))) > 100


def test_real_frames_give_events(data: Path) -> None:
    film = open_film(data / "frames" / "vid2e")
    assert film.size == (240, 180)
    assert len(list(film)) == 161


def test_films_that_cannot_be_used_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no video or folder"):
        open_film(tmp_path / "nothing.mp4")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no images"):
        open_film(tmp_path / "empty")
    repeated = write_images(tmp_path / "repeated", 3, [1.0, 1.0, 2.0])
    with pytest.raises(InputError, match="does not come after"):
        open_film(repeated)
    missing = write_images(tmp_path / "missing", 3, [1.0, 2.0])
    with pytest.raises(InputError, match="2 times for 3 images"):
        open_film(missing)
    one = open_film(write_images(tmp_path / "one", 1))
    with pytest.raises(InputError, match="two are needed at least, 1 came"):
        list(simulate(one, one.size))


def test_two_sizes_are_refused(tmp_path: Path) -> None:
    folder = write_images(tmp_path / "film", 2)
    Image.new("L", (32, 48)).save(folder / "frame_0002.png")
    film = open_film(folder)
    with pytest.raises(InputError, match="32x48 came to a sensor of 64x48"):
        list(simulate(film, film.size))


def test_a_video_that_cannot_be_decoded(tmp_path: Path) -> None:
    pytest.importorskip("av")
    (tmp_path / "noise.mp4").write_bytes(bytes(range(256)) * 40)
    with pytest.raises(InputError, match="cannot decode the video"):
        open_film(tmp_path / "noise.mp4")


@pytest.mark.parametrize("suffix", ["mp4", "mkv"])
def test_a_video_that_was_cut_off(tmp_path: Path, suffix: str) -> None:
    whole = write_video(tmp_path / f"film.{suffix}", 60)
    assert len(list(open_film(whole))) == 60
    cut = tmp_path / f"cut.{suffix}"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    frames = iter(open_film(cut))
    good = []
    with pytest.raises(DamagedRecordingError, match=r"header states 1\.200 s: it was cut off"):
        good.extend(frames)
    assert 10 < len(good) < 50


@pytest.mark.parametrize("bad", [[2], [0], [3], [0, 2], [1, 2, 3]])
def test_broken_images_are_left_out_and_counted(tmp_path: Path, bad: list[int]) -> None:
    film = open_film(write_images(tmp_path / "film", 4))
    for number in bad:
        (tmp_path / "film" / f"frame_{number:04d}.png").write_bytes(b"no image")
    good = []
    told = rf"^{len(bad)} of 4 images cannot be read and are left out, the first: .*frame_{bad[0]:04d}\.png"
    with pytest.raises(DamagedRecordingError, match=told):
        good.extend(t_us for t_us, _ in film.images())
    times = film.frames.t_us.tolist() if film.frames is not None else []
    assert good == [t_us for number, t_us in enumerate(times) if number not in bad]
    assert len(open_film(tmp_path / "film").size) == 2


def test_images_of_which_none_can_be_read(tmp_path: Path) -> None:
    for number in range(3):
        (tmp_path / f"{number}.png").write_bytes(b"no image")
    with pytest.raises(InputError, match=r"none of 3 images can be read: .*0\.png"):
        open_film(tmp_path)


def test_frames_of_one_time_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    film = open_film(write_video(tmp_path / "film.mp4", 6))
    monkeypatch.setattr(films, "round", lambda value: min(round(value), 40_000), raising=False)
    with pytest.raises(
        DamagedRecordingError, match=r"at 0\.040000 s does not come after the one at 0\.040000 s"
    ):
        list(film)


def test_a_video_is_turned_upright(tmp_path: Path) -> None:
    video = write_video(tmp_path / "film.mp4", 2)
    (_, lying), *_ = open_film(video)
    content = bytearray(video.read_bytes())
    at = content.index(b"tkhd") + 44
    quarter_clockwise = (0, 1 << 16, 0, -1 << 16, 0, 0, 48 << 16, 0, 1 << 30)
    content[at : at + 36] = struct.pack(">9i", *quarter_clockwise)
    video.write_bytes(content)
    film = open_film(video)
    assert film.size == (48, 64)
    (_, upright), *_ = film
    np.testing.assert_array_equal(upright, np.rot90(lying, -1))


def test_a_missing_package_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    (tmp_path / "film.mp4").write_bytes(b"0")
    with pytest.raises(MissingExtraError, match=r"evplace\[video\]"):
        open_film(tmp_path / "film.mp4")
    assert films.open_film is open_film
