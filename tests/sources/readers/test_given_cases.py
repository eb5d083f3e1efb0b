"""Small files as users have them, kept beside the real recordings: each holds the same 20,000 events."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.core.events import Events
from evplace.sources.readers import open_recording

EPOCH_US = 1_587_452_582_000_000
CASES = {
    "prophesee/evt21_legacy.raw": (320, 320),
    "prophesee/evt3_utf8_header.raw": (320, 320),
    "prophesee/evt3_vendor.raw": (320, 320),
    "prophesee/meta_geometry.csv": (320, 320),
    "text/bom_header.csv": (304, 240),
    "text/comment_utf8.txt": (304, 240),
    "text/faery_header.csv": (320, 240),
    "text/header_sec.csv": (304, 240),
    "text/matrix.npz": (304, 240),
    "text/pandas_index.csv": (304, 240),
    "text/polarity_bool.csv": (304, 240),
    "text/structured.npy": (304, 240),
    "hdf5/mvsec.hdf5": (304, 240),
    "hdf5/geometry_bytes.h5": (1280, 720),
    "ros/stereo.bag": (320, 240),
    "ros/mcap_msg_zstd": (320, 240),
    "ros/db3_file_zstd": (320, 240),
}
"""Name -> the sensor that it states, or that its events need."""


@pytest.mark.parametrize("name", CASES)
def test_all_events_of_a_case(name: str, data: Path) -> None:
    path = data / "cases" / name
    if not path.exists():
        pytest.skip(f"no {path}")
    recording = open_recording(path)
    back = Events.concatenate(list(recording.packets()))
    i = np.arange(20_000)
    assert (recording.size, sum(recording.dropped.values())) == (CASES[name], 0)
    assert np.array_equal(back.t_us - back.t_us[0], 37 * i)
    assert np.array_equal(back.p, i % 2 == 1)
    if name != "ros/stereo.bag":
        assert np.array_equal(back.x, i // 8 % 300)
        assert np.array_equal(back.y, 7 * i % (320 if name.startswith("prophesee") else 200))
    if name == "text/header_sec.csv":
        assert back.t_us[0] == EPOCH_US


def test_the_cameras_of_a_case(data: Path) -> None:
    path = data / "cases" / "ros" / "stereo.bag"
    if not path.exists():
        pytest.skip(f"no {path}")
    first, other = open_recording(path), open_recording(path, stream="left")
    assert sorted(first.streams) == sorted(other.streams) == ["/davis/left/events", "/davis/right/events"]
    assert other.notes[0].startswith("events are read from /davis/left/events; there are also /davis/right")
