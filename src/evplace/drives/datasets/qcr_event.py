"""QCR-Event-VPR: seven indoor drives of a robot at three speeds, DAVIS346; no GPS, but marks along the way.

Citation: T. Fischer and M. Milford, "How Many Events Do You Need? Event-Based Visual Place Recognition Using
Sparse But Varying Pixels", IEEE Robotics and Automation Letters 7(4), 2022. Licence: see the download page.
Address: https://zenodo.org/records/10494919 (Parquet), https://huggingface.co/datasets/AdamHines/QCR-Event-VPR
(HDF5).

Layout; names, times of the marks and units stand in public code (github.com/Tobias-Fischer/sparse-event-vpr,
github.com/EventLAB-Team/Event-LAB), the files themselves were not looked at:

    bags_2021-08-19-08-25-42_denoised.parquet     t, x, y, p; times in us
    2021-08-19-08-25-42.hdf5                      times in ns

The authors noted when the robot passed each of eleven marks. The track is made of them: its one coordinate
is the way in per cent of the drive normal1, so a "metre" of it is one per cent of the way (the authors'
tolerance is 2). Between two marks the robot is taken to be steady; before the first and after the last
nothing is known.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from evplace.drives.datasets import Drive
from evplace.drives.datasets._files import below
from evplace.sources.readers import Recording, open_recording
from evplace.sources.tracks import Track

NEEDS = "bags_2021-08-19-08-25-42_denoised.parquet and its like, or 2021-08-19-08-25-42.hdf5 and its like"
SIZE = (346, 260)
STAMPS = {
    "normal1": "2021-08-19-08-25-42",
    "normal2": "2021-08-19-08-28-43",
    "normal3": "2021-08-19-09-45-28",
    "normal4": "2022-03-28-11-51-26",
    "fast1": "2022-03-28-12-01-42",
    "fast2": "2021-08-20-10-19-45",
    "slow1": "2022-03-28-12-03-44",
}
MARKS_S = {
    "normal1": (0, 6, 13, 31, 58, 77, 101.5, 124, 148, 157.7, 163.0),
    "normal2": (0, 6, 13, 31.5, 58, 76, 100.5, 123, 148.5, 156.5, 162.0),
    "normal3": (0, 6.5, 13.5, 31.5, 58.5, 77.5, 102.5, 126, 150, 158.5, 165.0),
    "normal4": (0, 6.7, 13.2, 31, 57, 74, 97, 119, 141, 148, 154),
    "fast1": (0, 2.9, 5.8, 12.9, 23.5, 32, 41.5, 50, 59.3, 62, 64.5),
    "fast2": (0, 2.5, 5.0, 12.7, 23.7, 33.6, 43.0, 52.4, 62.3, 65.4, 68),
    "slow1": (0, 15.5, 30.0, 63.5, 110.0, 141.0, 185.0, 217.0, 246.5, 256.0, 263.0),
}
"""Seconds from the start of a drive to each mark."""
START_S = {"normal1": 2.0, "normal3": 2.0, "normal4": 8.0, "fast1": 7.7, "slow1": 12.0}
"""Seconds from the first event to the start of a drive, 0 for the others."""
UNITS = {".parquet": "us", ".hdf5": "ns", ".bag": None}
_STEP_US = 100_000


def recognises(folder: Path) -> bool:
    """Whether recordings with the set's names are there."""
    return bool(drives(folder))


def drives(folder: Path) -> list[str]:
    """The drives whose recording is there."""
    return [name for name in STAMPS if _recordings(folder, name)]


def open_drive(folder: Path, name: str) -> Drive:
    """Events, and the way between the marks."""
    file = _recordings(folder, name)[0]
    recording = open_recording(file, SIZE, time_unit=UNITS[file.suffix])
    return Drive(recording, _track(name, _first_us(recording)))


def _recordings(folder: Path, name: str) -> list[Path]:
    return [file for suffix in UNITS for file in below(folder, f"*{STAMPS[name]}*{suffix}")]


def _first_us(recording: Recording) -> int:
    return next((int(events.t_us[0]) for events in recording.packets()), 0)


def _track(name: str, first_us: int) -> Track:
    """The way in per cent, every tenth of a second."""
    marks_us = np.array(MARKS_S[name]) * 1e6
    way = np.array(MARKS_S["normal1"]) / MARKS_S["normal1"][-1] * 100
    t_us = np.arange(0, int(marks_us[-1]) + 1, _STEP_US, dtype=np.int64)
    percent = np.interp(t_us, marks_us, way)
    start_us = first_us + round(START_S.get(name, 0.0) * 1e6)
    return Track.local(t_us + start_us, np.column_stack([percent, np.zeros(len(t_us))]))
