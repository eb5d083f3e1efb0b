"""Brisbane-Event-VPR: six drives of 8 km through Brisbane at different times of the day, DAVIS346, with GPS.

Citation: T. Fischer and M. Milford, "Event-Based Visual Place Recognition With Ensembles of Temporal
Windows", IEEE Robotics and Automation Letters 5(4), 2020. Licence: CC BY-NC-SA 4.0.
Address: https://zenodo.org/records/4302805 (bags, NMEA),
https://huggingface.co/datasets/TobiasRobotics/brisbane-event-vpr (HDF5, Parquet, hot pixels).

Layout, in one folder or a folder a drive; the names stand in the authors' and others' public code:

    dvs_vpr_2020-04-21-17-03-03.hdf5 (times in ns), .parquet (t, x, y, p; times in us), .bag or .zip (text)
    dvs_vpr_2020-04-21-17-03-03_hot_pixels.txt      lines of x,y
    20200421_170039-sunset1_concat.nmea             of a dash camera that ran beside the event camera

Events count time since 1970. The log is put on their clock as the authors do: its first sentence is the start
of the dash camera's film, and START says when that was on the event camera's clock. Later code of the authors
has starts that are up to 11 s later (github.com/Tobias-Fischer/sparse-event-vpr); neither was checked against
the files. That the HDF5 files hold t, x, y and p, at the root or in a group, is what others' readers expect.
"""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import numpy as np

from evplace.core.errors import TrackError
from evplace.drives.datasets import Drive
from evplace.drives.datasets._files import below, needed
from evplace.sources.readers import open_recording
from evplace.sources.tracks import Track, open_track

NEEDS = "dvs_vpr_*.hdf5, .parquet, .bag or .zip, the drive's *.nmea, and *_hot_pixels.txt where there is one"
SIZE = (346, 260)
STEMS = {
    "sunset1": "dvs_vpr_2020-04-21-17-03-03",
    "sunset2": "dvs_vpr_2020-04-22-17-24-21",
    "daytime": "dvs_vpr_2020-04-24-15-12-03",
    "night": "dvs_vpr_2020-04-27-18-13-29",
    "morning": "dvs_vpr_2020-04-28-09-14-11",
    "sunrise": "dvs_vpr_2020-04-29-06-20-23",
}
START = {
    "sunset1": 1587452582.35,
    "sunset2": 1587540271.65,
    "daytime": 1587705130.80,
    "night": 1587975221.10,
    "morning": 1588029265.73,
    "sunrise": 1588105232.91,
}
"""Seconds since 1970 at which the film of the dash camera, and the log, begin."""
UNITS = {".hdf5": "ns", ".h5": "ns", ".parquet": "us", ".bag": None, ".zip": None}
"""Suffix -> unit of the times where the file does not say; the first that is there is read."""

_DAY_US = 86_400_000_000
_CLOCK = re.compile(rb"\$[A-Z]{2}(?:RMC|GGA),(\d{2})(\d{2})(\d{2}(?:\.\d+)?)", re.MULTILINE)


def recognises(folder: Path) -> bool:
    """Whether recordings with the set's names are there."""
    return bool(drives(folder))


def drives(folder: Path) -> list[str]:
    """The drives whose recording is there."""
    return [name for name in STEMS if _recordings(folder, name)]


def open_drive(folder: Path, name: str) -> Drive:
    """Events, the log on their clock, and the list of hot pixels."""
    file = _recordings(folder, name)[0]
    log = needed(folder, f"*-{name}*.nmea", f"the GPS log of {name}")
    hot = below(folder, f"{STEMS[name]}*hot_pixels.txt")
    recording = open_recording(file, SIZE, time_unit=UNITS[file.suffix])
    return Drive(recording, _on_the_events_clock(log, START[name]), hot[0] if hot else None)


def _recordings(folder: Path, name: str) -> list[Path]:
    return [file for suffix in UNITS for file in below(folder, f"{STEMS[name]}*{suffix}")]


def _on_the_events_clock(log: Path, start_s: float) -> Track:
    """The log, its first sentence at `start_s`; only times of day are used, as its date may be wrong."""
    track = open_track(log)
    found = _CLOCK.search(log.read_bytes())
    if found is None:
        raise TrackError(f"{log}: no RMC or GGA sentence has a time")
    first_us = round(((int(found[1]) * 60 + int(found[2])) * 60 + float(found[3])) * 1e6)
    before_fix_us = (int(track.t_us[0]) - first_us) % _DAY_US
    shift_us = round(start_s * 1e6) + before_fix_us - int(track.t_us[0])
    return dataclasses.replace(track, t_us=track.t_us + np.int64(shift_us))
