"""What several tests share: where the real recordings are, and small things made by code."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from evplace.cli import main
from evplace.core.events import Events
from evplace.imaging.recipe import Recipe
from evplace.imaging.stream import event_images
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap, train
from evplace.places import PlaceGrid
from evplace.sources.tracks import Track
from evplace.sources.writers import write_recording

# The first call of a numba loop compiles it, and nothing here may depend on how busy the machine is.
settings.register_profile("evplace", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("evplace")


HANG_S = 600
"""Seconds after which a process that a test waits for is taken to hang. No test waits for the clock: each
waits for what is to happen, however long a busy machine takes to do it."""


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real recordings; the test is skipped where there is none."""
    folder = Path(os.environ.get("EVPLACE_DATA", Path(__file__).parents[2] / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no real recordings at {folder}: set EVPLACE_DATA to a folder that has them")
    return folder


@pytest.fixture(scope="session")
def golden(data: Path) -> Path:
    """The folder of the original matchers' outputs; the test is skipped where there is none."""
    folder = data.parent / "golden"
    if not folder.is_dir():
        pytest.skip(f"no golden outputs at {folder}")
    return folder


@dataclass(frozen=True)
class Drive:
    """A made-up street that is driven along: what the events and the images of it are."""

    events: Events
    """Edges of a long picture that slides past the sensor, 8 pixels a window."""
    track: Track
    """A straight road, 2 m a window."""


def make_drive(seed: int = 0, windows: int = 60, noise: float = 0.002) -> Drive:
    """A drive of `windows` windows of 1/30 s past the same street; `seed` changes only its noise."""
    street = np.random.default_rng(99).random((60, 80 + 8 * windows)) < 0.12
    rng = np.random.default_rng(seed)
    parts = []
    for n in range(windows):
        seen = street[:, 8 * n : 8 * n + 80] ^ (rng.random((60, 80)) < noise)
        y, x = np.nonzero(seen)
        t_us = np.sort(rng.integers(n * 1_000_000 // 30 + 2, (n + 1) * 1_000_000 // 30, len(x)))
        parts.append(Events.of(t_us, x, y, rng.random(len(x)) < 0.5, (80, 60)))
    first = Events.of([0], [0], [0], [True], (80, 60))
    t_us = np.arange(windows + 2, dtype=np.int64) * 1_000_000 // 30
    road = np.stack([500_000 + 2.0 * np.arange(windows + 2), np.full(windows + 2, 4_000_000.0)], axis=1)
    return Drive(Events.concatenate([first, *parts]), Track.local(t_us, road))


def write_drive(folder: Path, name: str, drive: Drive) -> tuple[Path, Path]:
    """The recording, and its track as a csv log in the RobotCar layout."""
    recording, track = folder / f"{name}.aedat4", folder / f"{name}.csv"
    write_recording(recording, [drive.events], drive.events.size)
    rows = ["timestamp,latitude,longitude"]
    for t_us, easting in zip(drive.track.t_us, drive.track.easting, strict=True):
        rows.append(f"{t_us},48.0,{11 + (easting - 500_000) / 74_600}")
    track.write_text("\n".join(rows) + "\n")
    return recording, track


def make_traverse(drive: Drive) -> Traverse:
    """The event images of a drive, with positions."""
    found = list(event_images([drive.events], drive.events.size))
    images = np.stack([image for image, _ in found])
    t_us = np.array([window.t_us for _, window in found], np.int64)
    counts = np.array([window.events for _, window in found], np.int64)
    return Traverse(images, t_us, counts, drive.track.at(t_us), Recipe("events", drive.events.size))


@pytest.fixture(scope="session")
def day() -> Traverse:
    """The drive that maps are made from."""
    return make_traverse(make_drive())


@pytest.fixture(scope="session")
def night_drive() -> Drive:
    """The same street later."""
    return make_drive(seed=1, noise=0.02)


@pytest.fixture(scope="session")
def night(night_drive: Drive) -> Traverse:
    """Its event images."""
    return make_traverse(night_drive)


@pytest.fixture(scope="session")
def places(day: Traverse) -> PlaceGrid:
    """Cells of 20 m: ten images each."""
    assert day.track is not None
    return PlaceGrid.from_track(day.track)


@pytest.fixture(scope="session")
def image_map(day: Traverse, places: PlaceGrid) -> PlaceMap:
    """A map of the images themselves."""
    return train(day, places, scorer="ncc")


def sum_again(folder: Path) -> None:
    """Make the sums of a map anew, over all files that lie there."""
    files = sorted(file for file in folder.iterdir() if file.is_file() and file.name != "SHA256SUMS")
    files += sorted(folder.glob("drives/*/SHA256SUMS"))
    sums = {file.relative_to(folder): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}
    lines = [f"{checksum}  {file.as_posix()}\n" for file, checksum in sums.items()]
    (folder / "SHA256SUMS").write_text("".join(lines))


@pytest.fixture(scope="session")
def network_map(day: Traverse, places: PlaceGrid) -> PlaceMap:
    """A map with a network that was trained for a moment."""
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    return train(day, places, "network", steps=120, batch=16)


@pytest.fixture(scope="session")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """day.aedat4, night.aedat4 and their logs, day.csv and night.csv."""
    folder = tmp_path_factory.mktemp("files")
    write_drive(folder, "day", make_drive())
    write_drive(folder, "night", make_drive(seed=1, noise=0.02))
    return folder


@pytest.fixture(scope="session")
def street(files: Path) -> Path:
    """A map of the day's images."""
    arguments = ["train", f"{files}/day.aedat4", "--track", f"{files}/day.csv", "-o", f"{files}/street.evp"]
    assert main([*arguments, "--scorer", "ncc"]) == 0
    return files / "street.evp"
