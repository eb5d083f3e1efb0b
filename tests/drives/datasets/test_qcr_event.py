from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.drives.datasets import drives, open_drive
from evplace.drives.datasets.qcr_event import MARKS_S, STAMPS
from evplace.drives.to_traverse import open_traverse
from made_sets import write_qcr_event


def test_the_way_between_the_marks(tmp_path: Path) -> None:
    events = write_qcr_event(tmp_path)
    write_qcr_event(tmp_path, STAMPS["fast1"])
    assert drives(tmp_path) == ["normal1", "fast1"]
    begins = {}
    for name, start_s in (("normal1", 2.0), ("fast1", 7.7)):
        track = open_drive(tmp_path, name).track
        assert track is not None
        begins[name] = track.t_us[0] - events.t_us[0]
        assert begins[name] == start_s * 1e6
        # The third mark is at one place, whenever a drive comes by.
        at = track.at([events.t_us[0] + round((start_s + MARKS_S[name][2]) * 1e6)])
        assert at.easting[0] == pytest.approx(13 / 163 * 100, abs=0.1)


def test_images_before_the_start_have_no_position(tmp_path: Path) -> None:
    write_qcr_event(tmp_path)
    found = open_traverse(tmp_path, drive="normal1", dataset="qcr_event")
    assert found.track is not None
    assert not found.track.known[: 2 * 30 - 2].any()
    assert found.track.known[2 * 30 + 2 :].all()
    assert (np.diff(found.xy[2 * 30 + 2 :, 0]) > 0).all()
