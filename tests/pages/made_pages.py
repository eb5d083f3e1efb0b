"""What the pages say to type, and small made drives by day and by night to type it at."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from conftest import make_drive
from evplace.core.events import Events
from evplace.sources.writers import write_recording
from made_logs import DEGREES, LATITUDE, START_S, Log, rmc_log
from made_sets import write_brisbane

ROOT = Path(__file__).parents[2]
MPS = 60.0
"""Of the made drives: 2 m a window."""
HZ, FIXES = 5, 16
"""Fixes a second, and in all."""
FENCE = re.compile(r"^```(\w+)(?: title=\"([^\"]*)\")?\n(.*?)^```$", re.MULTILINE | re.DOTALL)

INCLUDED = re.compile(r"^--8<-- \"(.*)\"$", re.MULTILINE)
"""Where a page shows a file of the repository."""


@dataclass(frozen=True)
class Block:
    """A fenced block of a page."""

    language: str
    title: str
    text: str

    def lines(self) -> Iterator[list[str]]:
        """The words of each command; what stands behind a # is no word."""
        for line in self.text.replace("\\\n", " ").splitlines():
            if words := shlex.split(line, comments=True):
                yield words


def blocks(page: Path) -> list[Block]:
    """All blocks of a page, in its order."""
    text = INCLUDED.sub(lambda found: (ROOT / found[1]).read_text("utf-8").strip(), page.read_text("utf-8"))
    return [Block(*found.groups(default="")) for found in FENCE.finditer(text)]


def pages() -> list[Path]:
    """README and all pages of the site."""
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def write_drives(folder: Path) -> None:
    """The files that the pages name: drives and their logs, a drive of a data set, and files with faults."""
    write_pair(folder, ".aedat4")
    (folder / "two_hours_off.nmea").write_text(rmc_log(log_of(START_S + 7200)))
    (folder / "cut.aedat4").write_bytes((folder / "day.aedat4").read_bytes()[:300_000])
    (folder / "table.txt").write_text("1 2 3 1\n5 4 4 0\n")
    (folder / "letter.txt").write_text("Dear reader,\n")
    write_brisbane(folder / "brisbane")


def write_city(folder: Path, day: Path, night: Path) -> None:
    """What `evplace city` leaves, of two traverses, and beside it scores that are all alike."""
    for drive, traverse in (("day-1", day), ("night-1", night)):
        shutil.copytree(traverse, folder / drive / "ideal")
    (folder / "city.json").write_text("{}")
    (folder.parent / "mine").mkdir()
    shape = tuple(len(np.load(traverse / "t_us.npy")) for traverse in (night, day))
    np.save(folder.parent / "mine" / "night-1.npy", np.zeros(shape))


def write_sample(folder: Path) -> None:
    """The files of `evplace sample`, of a made street."""
    folder.mkdir()
    write_pair(folder, ".h5")


def write_pair(folder: Path, suffix: str) -> None:
    """A street by day and by night, and the logs."""
    for name, seed, noise in (("day", 0, 0.002), ("night", 1, 0.02)):
        made = make_drive(seed, windows=80, noise=noise).events
        events = Events.of(made.t_us + START_S * 1_000_000, made.x, made.y, made.p, made.size)
        write_recording(folder / f"{name}{suffix}", [events], events.size)
        (folder / f"{name}.nmea").write_text(rmc_log(log_of(START_S)))


def log_of(start_s: int) -> Log:
    """Where the camera was."""
    log = Log(seconds=FIXES)
    log.t_s = start_s + np.arange(FIXES) / HZ
    log.mps[:] = MPS
    log.latitude = LATITUDE + MPS / HZ * np.arange(FIXES) * DEGREES
    return log
