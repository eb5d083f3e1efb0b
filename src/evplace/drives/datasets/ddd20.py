"""DDD20: 51 hours of driving through the United States by day and night, DAVIS346, with the car's own data.

Citation: Y. Hu, J. Binas, D. Neil, S.-C. Liu and T. Delbruck, "DDD20 End-to-End Event Camera Driving
Dataset", IEEE ITSC 2020. Licence: see the download page.
Address: https://sites.google.com/view/davis-driving-dataset-2020/home.

Layout, from the code that recorded it (github.com/SensorsINI/ddd20-utils: record.py, interfaces/caer.py,
interfaces/oxc.py); the files themselves were not looked at:

    jul02/rec1499023756.hdf5
        dvs/data                    (n, 3) strings of bytes: time, header of a cAER packet, its events
        dvs/timestamp               (n,) us since 1970
        latitude/data, longitude/data               (n, 2) time and degrees
        latitude/timestamp, longitude/timestamp     (n,) us since 1970, zero where nothing was written

Events are read with the clock of the computer (see `evplace.sources.readers._hdf5_packets`), as the car's
positions are. Where the camera was mounted upside down, images are upside down too.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import TrackError
from evplace.drives.datasets import Drive
from evplace.drives.datasets._files import below, needed
from evplace.sources.readers import open_recording
from evplace.sources.tracks import Fixes, Track

NEEDS = "rec*.hdf5 as they were downloaded, not exported"


def recognises(folder: Path) -> bool:
    """Whether there are recordings with the set's names."""
    return bool(drives(folder))


def drives(folder: Path) -> list[str]:
    """The recordings: rec and a time."""
    return [file.stem for file in below(folder, "rec*.hdf5") if file.stem[3:].isdecimal()]


def open_drive(folder: Path, name: str) -> Drive:
    """Events and the car's positions, from one file."""
    file = needed(folder, f"{name}.hdf5", f"the recording {name}")
    return Drive(open_recording(file), _track(file))


def _track(file: Path) -> Track:
    import h5py

    try:
        with h5py.File(file, "r") as opened:
            latitude, longitude = (_series(opened[name]) for name in ("latitude", "longitude"))
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise TrackError(f"{file} holds no positions of the car: {' '.join(str(error).split())}") from error
    if not (len(latitude[0]) and len(longitude[0])):
        raise TrackError(f"{file} holds no positions of the car")
    # The car sends the two one after the other: each latitude goes with the last longitude before it.
    last = np.clip(np.searchsorted(longitude[0], latitude[0], side="right") - 1, 0, None)
    nowhere = np.full(len(latitude[0]), np.nan)
    try:
        return Track.of(Fixes(latitude[0], latitude[1], longitude[1][last], nowhere))
    except TrackError as error:
        raise TrackError(f"{file}: {error}") from error


def _series(group: Any) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Times in microseconds and values, without the zeros behind the last."""
    t_us, rows = np.asarray(group["timestamp"], np.int64), np.asarray(group["data"], np.float64)
    if rows.shape != (len(t_us), 2):
        raise ValueError(f"{group.name}: {len(t_us)} times for data of shape {rows.shape}")
    return t_us[t_us > 0], rows[t_us > 0, 1]
