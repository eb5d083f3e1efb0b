from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evplace.core.errors import DatasetError, TrackError
from evplace.drives.datasets import drives, open_drive
from evplace.drives.datasets.nsavp import geographic
from evplace.sources.readers import Recording
from made_sets import ecef, write_nsavp


@given(st.floats(-80, 84), st.floats(-179.9, 179.9), st.floats(-100, 5000))
def test_positions_from_the_centre_of_the_earth(latitude: float, longitude: float, height: float) -> None:
    found = geographic(ecef(np.array([latitude]), np.array([longitude]), height))
    np.testing.assert_allclose(np.ravel(found), [latitude, longitude], atol=1e-9)


def test_a_sequence(tmp_path: Path) -> None:
    events = write_nsavp(tmp_path)
    write_nsavp(tmp_path, "R0_RN0")
    assert drives(tmp_path) == ["R0_FA0", "R0_RN0"]
    drive = open_drive(tmp_path, "R0_FA0")
    assert isinstance(drive.source, Recording)
    assert drive.source.size == (640, 480)
    assert next(iter(drive.source.packets())).t_us[0] == events.t_us[0]
    assert drive.track is not None
    assert drive.track.t_us[0] == events.t_us[0]
    np.testing.assert_allclose(drive.track.latitude, 42.3, atol=1e-9)
    assert drive.track.zone == 17


def test_poses_that_are_missing_or_do_not_fit(tmp_path: Path) -> None:
    write_nsavp(tmp_path)
    poses = tmp_path / "R0_FA0_applanix.h5"
    with h5py.File(poses, "a") as file:
        del file["pose_base_link/timestamps"]
        file["pose_base_link/timestamps"] = np.arange(3)
    with pytest.raises(TrackError, match="3 times for positions"):
        open_drive(tmp_path)
    with h5py.File(poses, "w") as file:
        file["other"] = 1
    with pytest.raises(TrackError, match="no poses that can be read"):
        open_drive(tmp_path)
    poses.unlink()
    with pytest.raises(DatasetError, match="log of poses of R0_FA0 is missing"):
        open_drive(tmp_path)


def test_poses_that_are_not_numbers_are_left_out(tmp_path: Path) -> None:
    write_nsavp(tmp_path)
    with h5py.File(tmp_path / "R0_FA0_applanix.h5", "a") as file:
        file["pose_base_link/positions"][:10] = np.nan
    track = open_drive(tmp_path).track
    assert track is not None
    assert track.dropped == {"no fix": 10}
    with h5py.File(tmp_path / "R0_FA0_applanix.h5", "a") as file:
        file["pose_base_link/positions"][:] = np.nan
    with pytest.raises(TrackError, match="no usable fix"):
        open_drive(tmp_path)
