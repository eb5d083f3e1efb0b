"""NSAVP: drives of one route, both ways, in the afternoon, at sunset and at night, DVXplorer, with poses.

Citation: S. Carmichael et al., "Dataset and Benchmark: Novel Sensors for Autonomous Vehicle Perception",
The International Journal of Robotics Research 44(3), 2025. Licence: see the download page.
Address: https://umautobots.github.io/nsavp.

Layout, from the set's own documentation (github.com/umautobots/nsavp_tools, documentation/data_format.md):

    R0_FA0_dvxplorer_left.h5    events/{x_coordinates, y_coordinates, timestamps, polarities}, times in ns
                                (TAI); height and width are attributes of the group
    R0_FA0_applanix.h5          pose_base_link/{positions, quaternions, timestamps}, times in ns (TAI);
                                positions (n, 3) in metres from the centre of the Earth (ECEF)

The left camera is read; R0 is the route, F or R the direction, A, S or N the light, and a number.
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

NEEDS = "*_dvxplorer_left.h5 and *_applanix.h5 of each drive"
_EVENTS = "_dvxplorer_left.h5"
_RADIUS_M, _SQUARED_ECCENTRICITY = 6_378_137.0, 0.0066943799901413165
"""WGS 84."""

Floats = NDArray[np.float64]


def recognises(folder: Path) -> bool:
    """Whether there are recordings with the set's names."""
    return bool(drives(folder))


def drives(folder: Path) -> list[str]:
    """The sequences of which the left event camera's file is there."""
    return [file.name.removesuffix(_EVENTS) for file in below(folder, f"*{_EVENTS}")]


def open_drive(folder: Path, name: str) -> Drive:
    """Events and the vehicle's poses, which share one clock."""
    recording = open_recording(needed(folder, f"{name}{_EVENTS}", f"the recording of {name}"))
    return Drive(recording, _track(needed(folder, f"{name}_applanix.h5", f"the log of poses of {name}")))


def _track(file: Path) -> Track:
    import h5py

    try:
        with h5py.File(file, "r") as opened:
            poses = opened["pose_base_link"]
            positions, t_ns = np.asarray(poses["positions"], np.float64), np.asarray(poses["timestamps"])
    except (OSError, RuntimeError, ValueError, KeyError, TypeError) as error:
        raise TrackError(f"{file} holds no poses that can be read: {' '.join(str(error).split())}") from error
    if positions.shape != (len(t_ns), 3) or t_ns.dtype.kind not in "iu":
        raise TrackError(f"{file} holds {len(t_ns)} times for positions of shape {positions.shape}")
    latitude, longitude = geographic(positions)
    nowhere = np.full(len(t_ns), np.nan)
    try:
        return Track.of(Fixes((t_ns // 1000).astype(np.int64), latitude, longitude, nowhere))
    except TrackError as error:
        raise TrackError(f"{file}: {error}") from error


def geographic(positions: NDArray[Any]) -> tuple[Floats, Floats]:
    """Latitudes and longitudes in degrees of ECEF positions (n, 3) in metres.

    Fixed-point iteration on the latitude; near the ground, seven rounds are exact to a nanometre.
    """
    x, y, z = positions.astype(np.float64).T
    from_axis = np.hypot(x, y)
    latitude = np.arctan2(z, from_axis * (1 - _SQUARED_ECCENTRICITY))
    for _ in range(7):
        sine = np.sin(latitude)
        across = _RADIUS_M / np.sqrt(1 - _SQUARED_ECCENTRICITY * sine**2)
        latitude = np.arctan2(z + _SQUARED_ECCENTRICITY * across * sine, from_axis)
    return np.rad2deg(latitude), np.rad2deg(np.arctan2(y, x))
