"""Images every so many metres or events: against a plain twin, in the stream, whatever the packets."""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from conftest import Drive, make_drive, write_drive
from evplace.cli import main
from evplace.core.errors import SettingsError, TrackError, TraverseError
from evplace.core.events import Events
from evplace.drives.datasets import Drive as Found
from evplace.drives.to_traverse import open_traverse, record
from evplace.imaging.spacing import Spacer, SpacingSettings
from evplace.imaging.traverse import Traverse, new_traverse
from evplace.placemap import PlaceMap
from evplace.sources.readers._recording import Recording
from evplace.sources.readers._source import Block, Source
from evplace.sources.tracks import Track

DRIVE = make_drive()


def in_packets(events: Events, edges: list[int]) -> Recording:
    """A recording whose blocks end at `edges`."""
    cuts = [0, *sorted(min(edge, len(events)) for edge in edges), len(events)]
    blocks = [Block(*fields_of(events[a:b])) for a, b in itertools.pairwise(cuts) if b > a]
    return Recording(Path("made"), "made", Source(events.size, lambda: iter(blocks)), None)


def fields_of(events: Events) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    return events.t_us, events.x, events.y, events.p


def captured(folder: Path, edges: list[int], spacing: SpacingSettings, drive: Drive = DRIVE) -> Traverse:
    with new_traverse(folder, {}, overwrite=True) as writer:
        record(Found(in_packets(drive.events, edges)), writer, track=drive.track, spacing=spacing)
    return Traverse.load(folder)


def test_by_distance_against_a_plain_twin(tmp_path: Path) -> None:
    every = captured(tmp_path / "all", [], SpacingSettings())
    spaced = captured(tmp_path / "some", [], SpacingSettings(every_m=7))
    kept: list[int] = []
    for number, position in enumerate(every.xy):
        if not kept or np.hypot(*(position - every.xy[kept[-1]])) >= 7:
            kept.append(number)
    np.testing.assert_array_equal(spaced.images, every.images[kept])
    np.testing.assert_array_equal(spaced.t_us, every.t_us[kept])
    np.testing.assert_allclose(spaced.xy, every.xy[kept])
    assert len(spaced) == 15
    assert spaced.info["left_out"] == {"near": 45, "no_position": 0, "few_events": 0, "empty": 0}
    assert spaced.info["spacing"] == {"every_m": 7.0, "every_events": 0}


def test_by_events_against_a_plain_twin(tmp_path: Path) -> None:
    every = captured(tmp_path / "all", [], SpacingSettings())
    spaced = captured(tmp_path / "some", [], SpacingSettings(every_events=2000))
    kept, so_far = [], 0
    for number, count in enumerate(every.counts):
        so_far += int(count)
        if so_far >= 2000:
            kept.append(number)
            so_far = 0
    np.testing.assert_array_equal(spaced.t_us, every.t_us[kept])
    assert 0 < len(spaced) < len(every)
    assert spaced.info["left_out"]["few_events"] == len(every) - len(spaced)


@settings(max_examples=10)
@given(
    edges=st.lists(st.integers(0, 40_000), max_size=12),
    spacing=st.sampled_from([SpacingSettings(every_m=5), SpacingSettings(every_events=1500)]),
)
def test_the_size_of_packets_changes_nothing(
    tmp_path_factory: pytest.TempPathFactory, edges: list[int], spacing: SpacingSettings
) -> None:
    folder = tmp_path_factory.mktemp("packets")
    one, many = (captured(folder / name, cuts, spacing) for name, cuts in (("one", []), ("many", edges)))
    np.testing.assert_array_equal(one.images, many.images)
    np.testing.assert_array_equal(one.t_us, many.t_us)
    assert one.info == many.info


def test_a_car_that_stands_still_makes_no_more_images(tmp_path: Path) -> None:
    """For a second the camera sees hardly anything, and the receiver's noise walks about."""
    events, rng = DRIVE.events, np.random.default_rng(0)
    still = (events.t_us > 800_000) & (events.t_us < 1_800_000)
    keep = ~still | (rng.random(len(events)) < 0.01)
    quiet = Events(events.t_us[keep], events.x[keep], events.y[keep], events.p[keep], events.size)
    xy = DRIVE.track.xy.copy()
    waits = (DRIVE.track.t_us > 800_000) & (DRIVE.track.t_us < 1_800_000)
    xy[waits] = xy[np.argmax(waits)] + rng.normal(0, 0.4, (int(waits.sum()), 2))
    drive = Drive(quiet, Track.local(DRIVE.track.t_us, xy))
    for spacing in (SpacingSettings(every_m=4), SpacingSettings(every_events=1000)):
        times = captured(tmp_path / "still", [], spacing, drive).t_us
        assert ((times > 850_000) & (times < 1_800_000)).sum() <= 1
        assert len(times) > 10


def test_images_without_position_or_events_are_left_out_where_there_is_a_choice() -> None:
    track = Track.local([0, 500_000, 5_000_000, 5_500_000], [[0, 0], [5, 0], [5, 0], [10, 0]])
    spacer = Spacer(SpacingSettings(every_m=2), track)
    assert [spacer.keeps(t_us, 5) for t_us in (0, 100_000, 500_000, 3_000_000, 5_400_000)] == [
        True, False, True, False, True,
    ]  # fmt: skip
    assert not spacer.keeps(5_500_000, 0)
    assert spacer.left_out == {"near": 1, "no_position": 1, "few_events": 0, "empty": 1}
    everything = Spacer()
    assert all(everything.keeps(t_us, 0) for t_us in range(5))
    assert not any(everything.left_out.values())


def test_what_cannot_be_spaced_is_said(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="give its `track`"):
        Spacer(SpacingSettings(every_m=2))
    with pytest.raises(SettingsError, match="give one"):
        SpacingSettings(every_m=2, every_events=5)
    with pytest.raises(SettingsError, match="0 or more"):
        SpacingSettings(every_m=float("nan"))
    Image.fromarray(np.zeros((20, 30), np.uint8)).save(tmp_path / "0.png")
    with pytest.raises(SettingsError, match="camera images have no events"):
        open_traverse(tmp_path, spacing=SpacingSettings(every_events=5))
    recording, _ = write_drive(tmp_path, "drive", DRIVE)
    far = Track.local([0, 10_000_000], [[0, 0], [1, 1]])
    with pytest.raises(TraverseError, match="no image"):
        open_traverse(recording, track=far, spacing=SpacingSettings(every_m=5))


def test_camera_images_by_distance(tmp_path: Path) -> None:
    for number in range(10):
        Image.fromarray(np.full((20, 30), number, np.uint8)).save(tmp_path / f"{number}.png")
    track = Track.local(np.arange(11) * 33_334, np.stack([np.arange(11.0), np.zeros(11)], 1))
    found = open_traverse(tmp_path, track=track, spacing=SpacingSettings(every_m=2.9))
    assert found.images[:, 0, 0].tolist() == [0, 3, 6, 9]
    np.testing.assert_allclose(found.xy[:, 0], [0, 3, 6, 9], atol=0.01)
    assert found.info["left_out"]["near"] == 6


def test_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording, track = write_drive(tmp_path, "day", DRIVE)
    out = ["images", str(recording), "-o", f"{tmp_path}/d", "--track", str(track), "--every-m", "5"]
    assert main([*out, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["images"] == 20
    assert facts["left_out"]["near"] == 40
    assert main([*out, "--overwrite"]) == 0
    assert "40 near" in capsys.readouterr().out
    toml = tmp_path / "s.toml"
    toml.write_text("[spacing]\nevery_m = 5\n")
    learn = ["train", str(recording), "--track", str(track), "--scorer", "ncc", "--settings", str(toml)]
    assert main([*learn, "-o", f"{tmp_path}/m"]) == 0
    assert PlaceMap.load(tmp_path / "m").info["spacing"]["every_m"] == 5
    assert len(np.load(tmp_path / "m" / "references.npy")) == 20


@pytest.mark.parametrize("spacing", [SpacingSettings(), SpacingSettings(every_m=2)])
@pytest.mark.parametrize("shift_us", [-3_600_000_000, 3_600_000_000])
def test_a_track_of_another_time_is_told(tmp_path: Path, spacing: SpacingSettings, shift_us: int) -> None:
    """Before the recording is read, where the track ends before it begins."""
    track = Track.local(DRIVE.track.t_us + shift_us, DRIVE.track.xy)
    read: list[int] = []

    def blocks() -> Iterator[Block]:
        for start in range(0, len(DRIVE.events), 1000):
            read.append(start)
            yield Block(*fields_of(DRIVE.events[start : start + 1000]))

    recording = Recording(Path("made"), "made", Source(DRIVE.events.size, blocks), None)
    with (
        pytest.raises(TrackError, match="do not overlap"),
        new_traverse(tmp_path / "x", {}) as writer,
    ):
        record(Found(recording), writer, track=track, spacing=spacing)
    assert (len(read) < len(DRIVE.events) / 2000) == (shift_us < 0)


def test_a_film_and_a_track_of_another_time(tmp_path: Path) -> None:
    for number in range(3):
        Image.fromarray(np.zeros((12, 16), np.uint8)).save(tmp_path / f"{number}.png")
    for shift_us in (-3_600_000_000, 3_600_000_000):
        track = Track.local(DRIVE.track.t_us + shift_us, DRIVE.track.xy)
        with pytest.raises(TrackError, match="do not overlap"):
            open_traverse(tmp_path, track=track, spacing=SpacingSettings(every_m=2))
