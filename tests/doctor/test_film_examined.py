"""Films: a blob that moves by known amounts, at known times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.core.errors import SettingsError
from evplace.doctor import Curve, Examination, examine
from evplace.sources.frames import open_frames


def film(folder: Path, places: list[float], times_s: list[float] | None = None) -> Path:
    """One image a place, with the blob at that column."""
    y, x = np.mgrid[:48, :64]
    for number, at in enumerate(places):
        light = 20 + 200 * np.exp(-((x - at) ** 2 + (y - 24.0) ** 2) / 60.0)
        Image.fromarray(light.astype(np.uint8)).save(folder / f"{number:04d}.png")
    if times_s is not None:
        (folder / "timestamps.txt").write_text("".join(f"{time}\n" for time in times_s))
    return folder


def there_and_back(n: int, step: float) -> list[float]:
    return [20 + step * (k % 12 if k // 12 % 2 == 0 else 12 - k % 12) for k in range(n)]


def even(n: int, fps: float) -> list[float]:
    return [k / fps for k in range(n)]


def state(found: Examination, name: str) -> str:
    return found.named(name).state


def test_slow_and_even_is_good(tmp_path: Path) -> None:
    found = examine(film(tmp_path, there_and_back(60, 0.5), even(60, 50)))
    assert [state(found, name) for name in ("frame times", "repeated frames", "image motion")] == ["good"] * 3
    assert found.named("frame times").value == pytest.approx(50)
    assert found.named("image motion").value == pytest.approx(0.5, rel=0.5)
    assert found.facts["frames"] == 60
    assert [drawing.name for drawing in found.drawings] == ["motion"]


def test_fast_frames_ask_for_more_a_second(tmp_path: Path) -> None:
    motion = examine(film(tmp_path, there_and_back(60, 3.0), even(60, 50))).named("image motion")
    assert motion.state == "bad"
    assert motion.value is not None
    assert motion.value > 1.5
    assert f"about {50 * motion.value:.0f} frames a second" in motion.advice


def test_repeated_frames(tmp_path: Path) -> None:
    places = np.repeat(there_and_back(30, 0.5), 2).tolist()
    repeated = examine(film(tmp_path, places, even(60, 50))).named("repeated frames")
    assert (repeated.state, repeated.value) == ("bad", pytest.approx(100 * 30 / 59))


def test_a_hole_and_made_up_times(tmp_path: Path) -> None:
    times = np.array(even(60, 50))
    times[40:] += 0.5
    places = there_and_back(60, 0.5)
    times_found = examine(film(tmp_path, places, times.tolist())).named("frame times")
    assert times_found.state == "bad"
    assert "1 comes late" in times_found.sentence
    (tmp_path / "timestamps.txt").unlink()
    made_up = examine(tmp_path, fps=25).named("frame times")
    assert (made_up.state, made_up.value) == ("look", pytest.approx(25))
    assert "`fps`" in made_up.sentence
    assert "`fps`" not in made_up.advice


@pytest.mark.parametrize("unit", [1e6, 1e-3])
def test_times_in_the_wrong_unit_are_bad(tmp_path: Path, unit: float) -> None:
    times = [time * unit for time in even(20, 55)]
    found = examine(film(tmp_path, there_and_back(20, 0.5), times)).named("frame times")
    assert found.state == "bad"
    assert "in seconds?" in found.advice


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf"), 1e9])
def test_rates_that_cannot_be(tmp_path: Path, fps: float) -> None:
    with pytest.raises(SettingsError, match="'fps'"):
        examine(film(tmp_path, there_and_back(3, 0.5)), fps=fps)
    with pytest.raises(SettingsError, match="'fps'"):
        open_frames(tmp_path, fps=fps)


def test_frames_of_two_sizes(tmp_path: Path) -> None:
    film(tmp_path, there_and_back(20, 0.5), even(20, 50))
    Image.fromarray(np.zeros((10, 10), np.uint8)).save(tmp_path / "0007.png")
    frames = examine(tmp_path).named("frames")
    assert (frames.state, frames.value) == ("bad", 20)
    assert "2 times" in frames.sentence


def test_one_frame_makes_no_events(tmp_path: Path) -> None:
    assert examine(film(tmp_path, [20.0], [0.0])).named("frames").state == "bad"


def test_a_frame_that_cannot_be_read_is_left_out(tmp_path: Path) -> None:
    film(tmp_path, there_and_back(20, 0.5), even(20, 50))
    (tmp_path / "0010.png").write_bytes(b"no image")
    found = examine(tmp_path)
    assert found.facts["frames"] == 19
    assert found.fault is not None
    assert "0010.png" in found.fault
    assert state(found, "reading") == "bad"


def test_a_video(tmp_path: Path) -> None:
    av = pytest.importorskip("av", reason="videos need the extra 'video'")
    pictures = film(tmp_path, there_and_back(30, 0.5))
    with av.open(str(tmp_path / "made.mp4"), "w") as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.width, stream.height = 64, 48
        for number in range(30):
            frame = av.VideoFrame.from_image(Image.open(pictures / f"{number:04d}.png").convert("RGB"))
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    found = examine(tmp_path / "made.mp4")
    assert found.facts["frames"] == 30
    assert found.named("frame times").value == pytest.approx(25)
    (curve,) = found.drawings
    assert isinstance(curve, Curve)
    assert len(curve.x) == 29
