from __future__ import annotations

import dataclasses
import hashlib
import itertools
import platform
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from evplace.cli import main
from evplace.core.errors import OutputError, SettingsError
from evplace.core.events import Events
from evplace.core.settings import to_dict
from evplace.core.workers import start
from evplace.drives import datasets
from evplace.drives.to_traverse import open_traverse
from evplace.imaging.traverse import Traverse
from evplace.sources.readers import open_recording
from evplace_lab.city import CitySettings, Film, Progress, build_town, generate, moving_preview, preview
from evplace_lab.city.recording import record_drive

SMALL = CitySettings(
    conditions=("day", "night"),
    paths=(1,),
    sensors=("ideal", "from-8bit"),
    fps=30,
    width=64,
    height=48,
    route_length_m=60.0,
)


HALF_A_DRIVE = """
import sys, threading
from evplace.core.workers import serve
from evplace_lab.city import worker

def work(job, say):
    def say_and_wait(share):
        say(share)
        threading.Event().wait()

    worker.work(job, say_and_wait)

sys.exit(serve(work))
"""
"""The city's worker, which says when it is on its way, and waits then."""


def digest(folder: Path) -> dict[str, str]:
    files = (file for file in sorted(folder.rglob("*")) if file.is_file())
    return {str(f.relative_to(folder)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("city") / "set"
    generate(out, SMALL, workers=1)
    return out


def test_every_drive_has_its_traverses_with_one_truth(made: Path) -> None:
    for drive in ("day-1", "night-1"):
        colour = Traverse.load(made / drive / "colour")
        poses = np.load(made / drive / "poses.npy")
        assert colour.images.shape == (len(poses), 90, 160, 3)
        np.testing.assert_allclose(np.diff(colour.t_us), 100_000)
        np.testing.assert_allclose(colour.xy, poses[:, :2])
        for sensor in SMALL.sensors:
            events = Traverse.load(made / drive / sensor)
            assert events.images.shape == (len(poses), 90, 160)
            np.testing.assert_array_equal(events.t_us, colour.t_us)
            np.testing.assert_array_equal(events.xy, colour.xy)
            assert events.counts[5:].min() > 0
            assert events.info["condition"] == drive.split("-")[0]
    assert not list(made.rglob(".*"))


def test_the_track_is_where_the_car_is(made: Path) -> None:
    track = Traverse.load(made / "day-1" / "colour").track
    assert track is not None
    moved = np.hypot(np.diff(track.easting), np.diff(track.northing))
    assert moved.sum() == pytest.approx(60, abs=4)
    east, north = np.diff(track.easting)[10], np.diff(track.northing)[10]
    assert np.degrees(np.arctan2(east, north)) % 360 == pytest.approx(track.heading_deg[10], abs=4)
    assert track.latitude[0] == pytest.approx(37.35, abs=0.02)


def test_processes_make_the_same_bytes_and_a_second_call_makes_nothing(made: Path, tmp_path: Path) -> None:
    seen: list[Progress] = []
    folders = generate(tmp_path / "set", SMALL, workers=2, progress=seen.append)
    assert [folder.name for folder in folders] == ["day-1", "night-1"]
    assert digest(tmp_path / "set") == digest(made)
    assert seen[-1].share == pytest.approx(1.0)
    assert all(a.share <= b.share for a, b in itertools.pairwise(seen))
    before = (folders[0] / "poses.npy").stat().st_mtime_ns
    generate(tmp_path / "set", SMALL, workers=2)
    assert (folders[0] / "poses.npy").stat().st_mtime_ns == before


def test_a_killed_drive_is_made_again_and_ends_the_same(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "set"
    generate(out, SMALL, workers=1, drives=[("day", 1)])
    job = {"out": str(out), "settings": to_dict(SMALL), "condition": "night", "path": 1}
    (tmp_path / "half_a_drive.py").write_text(HALF_A_DRIVE)
    monkeypatch.syspath_prepend(tmp_path)
    with start("half_a_drive", job) as process:
        assert process.stdout is not None
        assert 0 < float(process.stdout.readline()) < 1
        process.kill()
    assert not (out / "night-1").exists()
    assert list(out.glob(".night-1.*"))
    generate(out, SMALL, workers=1)
    wanted = digest(made)
    assert {name: digest(out).get(name) for name in wanted} == wanted
    assert not list(out.glob(".night-1.*partial*"))


def test_a_folder_of_other_settings_is_refused(made: Path, tmp_path: Path) -> None:
    other = dataclasses.replace(SMALL, fps=60, seed=4)
    with pytest.raises(OutputError, match=r"other settings: fps 30 \(now 60\), seed 0 \(now 4\)"):
        generate(made, other)
    (tmp_path / "letter.txt").write_text("mine")
    with pytest.raises(OutputError, match="not empty and holds no drives"):
        generate(tmp_path, SMALL)
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError):
        generate(tmp_path / "file", SMALL)


def test_events_are_kept_on_request(tmp_path: Path) -> None:
    chosen = dataclasses.replace(SMALL, keep_events=True, conditions=("night",))
    (folder,) = generate(tmp_path / "set", chosen, workers=1)
    recording = open_recording(folder / "ideal.aedat4")
    events = Events.concatenate(list(recording.packets()))
    assert recording.size == (SMALL.width, SMALL.height)
    assert not any(recording.dropped.values())
    traverse = Traverse.load(folder / "ideal")
    for t_us, count in zip(traverse.t_us, traverse.counts, strict=True):
        inside = (events.t_us > t_us - SMALL.window_us) & (events.t_us <= t_us)
        assert inside.sum() == count
    assert sorted(path.name for path in folder.iterdir()) == [
        "colour", "from-8bit", "from-8bit.aedat4", "from-8bit.csv", "from-8bit.nmea", "ideal", "ideal.aedat4",
        "ideal.csv", "ideal.nmea", "poses.npy",
    ]  # fmt: skip
    wanted = traverse.track
    assert wanted is not None
    for log in ("ideal.nmea", "ideal.csv"):
        found = open_traverse(folder / "ideal.aedat4", track=folder / log).track
        assert found is not None
        assert (found.zone, found.northern) == (wanted.zone, wanted.northern)
        at = np.array([np.interp(found.t_us, wanted.t_us, column) for column in wanted.xy.T]).T
        away = np.hypot(*(found.xy - at).T)
        assert np.nanmax(away) < 0.1
    assert "ideal" in datasets.drives(folder)


CHECKS = {
    "day-1/ideal": ("b6fc6fd77413359f", 27.3023),
    "night-1/from-8bit": ("19f04d995409c2a3", 37.9221),
    "night-1/colour": ("bcfd88d325c4ece7", 89.9600),
}
"""city-v1: sha256 of ten images from the third second on, and their mean."""


@pytest.mark.parametrize("name", CHECKS)
def test_images_of_city_v1_are_frozen(made: Path, name: str) -> None:
    images = np.load(made / name / "images.npy")[30:40]
    digest_, mean = CHECKS[name]
    if platform.machine() == "x86_64":
        assert hashlib.sha256(images.tobytes()).hexdigest()[:16] == digest_
    assert images.mean() == pytest.approx(mean, rel=0.02)


def test_memory_does_not_grow_with_the_way(tmp_path: Path) -> None:
    town = build_town(0)
    peaks = []
    for length in (60.0, 60.0, 200.0):
        chosen = dataclasses.replace(
            SMALL, route_length_m=length, fps=10, width=16, height=12, sensors=("ideal",)
        )
        tracemalloc.start()
        record_drive(tmp_path / str(len(peaks)), town, chosen, "day", 1, lambda _: None)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[2] < 1.1 * peaks[1]


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"conditions": ("hail",)}, "unknown condition 'hail'"),
        ({"conditions": ()}, "at least one condition"),
        ({"paths": (0,)}, "numbered from 1"),
        ({"sensors": ("eye",)}, "unknown sensor 'eye': known are ideal, weak, from-8bit"),
        ({"fps": 25}, "'fps' 25 must be a multiple of 'image_hz' 10"),
        ({"dt": "1/5"}, "longer than the time between images"),
        ({"dt": "soon"}, "'dt' cannot be 'soon'"),
        ({"width": 0}, "'width' cannot be 0"),
        ({"route_length_m": 5.0}, "60 at least"),
    ],
)
def test_settings_without_sense_are_refused(values: dict[str, object], text: str) -> None:
    with pytest.raises(SettingsError, match=text):
        dataclasses.replace(SMALL, **values)  # type: ignore[arg-type]


def test_frames_come_with_poses_and_pictures() -> None:
    film = Film(build_town(0), 2, "dusk", (32, 24), 0, 60.0)
    frames = list(film.frames(10))
    assert len(frames) == film.drive.duration_us * 10 // 1_000_000 + 1
    assert frames[3].t_us == 300_000
    assert frames[3].colour.shape == frames[3].radiance.shape == (24, 32, 3)
    assert frames[3].pose.height == pytest.approx(frames[2].pose.height, abs=0.5)


def test_previews_can_be_looked_at(tmp_path: Path) -> None:
    preview(tmp_path / "sheet.png", conditions=("day",), size=(40, 30))
    sheet = np.asarray(Image.open(tmp_path / "sheet.png").convert("RGB"))
    assert sheet.shape == (64, 172, 3)
    assert sheet[:30].std() > 20
    assert sheet[34:].std() > 20
    moving_preview(tmp_path / "drive.webp", conditions=("day",), seconds=0.4, size=(40, 30))
    with Image.open(tmp_path / "drive.webp") as film:
        assert film.n_frames == 6  # type: ignore[attr-defined]


def test_a_preview_of_another_ending_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["city", "--preview", f"{tmp_path}/sheet.xyz"]) == 2
    assert "sheet.xyz is no name of a picture: let it end in .png" in capsys.readouterr().err
