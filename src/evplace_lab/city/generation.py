"""All drives of a set, several at a time, resumable: a drive that is whole is not made again."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Lock
from typing import NamedTuple

from evplace.core import folders
from evplace.core.errors import OutputError
from evplace.core.settings import to_dict
from evplace.core.storage import new_file, read_json, write_json
from evplace.core.workers import Here, Workers, run_all, workers_of
from evplace_lab.city.plan import VERSION, CitySettings, drive_name
from evplace_lab.city.recording import record_drive
from evplace_lab.city.town import build_town
from evplace_lab.city.warming import warm

SETTINGS_FILE = folders.CITY


class Progress(NamedTuple):
    """How far a set of drives is."""

    drive: str
    """The drive that just moved on: day-1."""
    share: float
    """Of everything that is to be done now, 0 to 1."""
    left_s: float
    """Seconds until the end, guessed from the pace so far."""


Report = Callable[[Progress], None]


def generate(
    out: str | Path,
    settings: CitySettings | None = None,
    workers: int | Workers | None = None,
    progress: Report | None = None,
    drives: Sequence[tuple[str, int]] | None = None,
) -> list[Path]:
    """Make every drive of `settings` under `out`; returns their folders, `<condition>-<path>`.

    `drives` names (condition, path) pairs of their own, instead of every condition on every path.

    Each holds a traverse for each sensor, the traverse `colour` (same times, same truth), and poses.npy
    (n, 6): easting, northing, height in metres, yaw, pitch, roll in radians. `workers` is how many processes
    are used (None: one a core), or where; the result does not depend on them. A drive that is there already
    is kept, so that a killed call goes on where it was.

    Raises OutputError where `out` was made with other settings, is being written, or the disk is full.
    """
    folder, chosen = Path(out), settings or CitySettings()
    _claim(folder, chosen)
    pairs = chosen.drives() if drives is None else list(drives)
    names = [drive_name(name, path) for name, path in pairs]
    todo = [pair for pair, name in zip(pairs, names, strict=True) if not (folder / name).is_dir()]
    meter = _Meter([drive_name(*pair) for pair in todo], progress)
    used = workers_of(workers)
    if len(todo) > 1 and used != Here(1):
        _in_processes(folder, chosen, todo, used, meter)
    elif todo:
        town = build_town(chosen.seed)
        for name, path in todo:
            record_drive(folder, town, chosen, name, path, meter.of(drive_name(name, path)))
            meter.of(drive_name(name, path))(1.0)
    return [folder / name for name in names]


def _claim(folder: Path, settings: CitySettings) -> None:
    """Leave the settings in a new folder; refuse one that was made with others."""
    wanted = {"version": VERSION, **settings.of_drive()}
    file = folder / SETTINGS_FILE
    if folder.exists() and not folder.is_dir():
        raise OutputError(f"{folder} is a file: choose another name for the folder of drives")
    if file.exists():
        found = read_json(file, "the settings of a city")
        other = [key for key in sorted(wanted | found) if wanted.get(key) != found.get(key)]
        if other:
            differences = ", ".join(f"{key} {found.get(key)} (now {wanted.get(key)})" for key in other)
            raise OutputError(
                f"{folder} holds drives made with other settings: {differences}; choose another folder"
            )
        return
    if folder.exists() and any(folder.iterdir()):
        raise OutputError(f"{folder} is not empty and holds no drives: choose another folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with new_file(file) as partial:
            write_json(partial, wanted)
    except OSError as error:
        raise OutputError(f"cannot write {folder}: {error.strerror or error}") from error


class _Meter:
    """Puts the shares of all drives together."""

    def __init__(self, names: list[str], report: Report | None) -> None:
        self._shares = dict.fromkeys(names, 0.0)
        self._report, self._lock, self._began = report, Lock(), time.monotonic()

    def of(self, name: str) -> Callable[[float], None]:
        """What one drive reports its share to."""

        def update(share: float) -> None:
            with self._lock:
                self._shares[name] = share
                total = sum(self._shares.values()) / len(self._shares)
                elapsed = time.monotonic() - self._began
                if self._report is not None and total > 0:
                    self._report(Progress(name, total, elapsed * (1 - total) / total))

        return update


def _in_processes(
    folder: Path, settings: CitySettings, todo: list[tuple[str, int]], workers: Workers, meter: _Meter
) -> None:
    """Each drive in a process of its own; the loops are compiled here first, once and not by each."""
    warm(settings)
    plain = to_dict(settings)
    jobs = [{"out": str(folder), "settings": plain, "condition": name, "path": path} for name, path in todo]
    updates = [meter.of(drive_name(*pair)) for pair in todo]
    run_all("evplace_lab.city.worker", jobs, workers, folder, lambda index, line: updates[index](float(line)))
