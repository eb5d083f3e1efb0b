from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from evplace.core.errors import DamagedRecordingError, TrackError
from evplace.core.events import Events
from evplace.drives.datasets import drives, open_drive
from evplace.sources.readers import Recording, open_recording
from made_sets import write_ddd20


def test_events_on_the_computers_clock(tmp_path: Path) -> None:
    events = write_ddd20(tmp_path / "jul02")
    assert drives(tmp_path) == ["rec1499023756"]
    drive = open_drive(tmp_path)
    assert isinstance(drive.source, Recording)
    assert drive.source.size == (346, 260)
    back = Events.concatenate(list(drive.source.packets()))
    valid = np.ones(len(events), np.bool_)
    valid[[0, len(events) // 2]] = False  # the first of each packet is marked as not valid
    for field in ("t_us", "x", "y", "p"):
        assert np.array_equal(getattr(back, field), getattr(events, field)[valid]), field
    assert drive.track is not None
    assert (drive.track.zone, len(drive.track)) == (13, 8)
    np.testing.assert_allclose(drive.track.longitude, -105 + np.arange(8) * 5e-5)


def test_a_file_without_positions(tmp_path: Path) -> None:
    write_ddd20(tmp_path)
    file = tmp_path / "rec1499023756.hdf5"
    with h5py.File(file, "a") as opened:
        opened["latitude/timestamp"][:] = 0
    with pytest.raises(TrackError, match="no positions of the car"):
        open_drive(tmp_path)
    with h5py.File(file, "a") as opened:
        del opened["latitude"]
    with pytest.raises(TrackError, match="no positions of the car"):
        open_drive(tmp_path)


def test_a_damaged_packet_ends_the_recording(tmp_path: Path) -> None:
    write_ddd20(tmp_path)
    file = tmp_path / "rec1499023756.hdf5"
    with h5py.File(file, "a") as opened:
        opened["dvs/data"][2, 2] = np.zeros(13, np.uint8)
    recording, good = open_recording(file), []
    with pytest.raises(DamagedRecordingError, match="breaks off"):
        good.extend(recording.packets())
    assert sum(map(len, good)) == 1499
