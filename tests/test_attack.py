"""The attack in short: a few cases of each kind. `scripts/attack` does many."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from cases import cases
from outputs import full_disks, hostile_files, kills, prepared
from run import Counts, Kept, counted, many

SEED = int(os.environ.get("EVPLACE_SEED", "0"))


def check(counts: Counts) -> None:
    assert counts.is_good, (str(counts), counts.found)


@pytest.mark.parametrize(
    ("kind", "name", "count"),
    [
        ("flip", "evt3", 60),  # all formats are in `test_all_formats`
        ("cut", "evt3", 60),
        ("log", "rmc", 60),
        ("log", "bag", 60),
        ("folder", "map-grid", 10),  # each way that these can be altered is in `test_altered_maps`
        ("folder", "result", 10),
        ("settings", "images", 20),
    ],
)
def test_damaged_inputs(tmp_path: Path, kind: str, name: str, count: int) -> None:
    case = cases(tmp_path, kind, name, SEED)
    for number in range(count):
        case(number)


def test_a_process_for_many_cases() -> None:
    check(many("flip", "hdf5", 60, SEED))


@pytest.mark.skipif(os.name == "nt", reason="Windows kills no process by a signal")
def test_outputs(tmp_path: Path) -> None:
    """A file that is written in a process of its own, and a folder."""
    folder, outputs = prepared(tmp_path), ["x.h5", "images"]
    check(counted(kills(folder, 2, SEED, outputs)))
    check(counted(full_disks(folder, [16], outputs)))


def test_files_that_are_given() -> None:
    check(counted(hostile_files(short=True)))


def test_a_run_that_was_stopped_goes_on(tmp_path: Path) -> None:
    file = tmp_path / "kept"
    Kept(file, 1, 0.5).keep("flips of es", Counts(3, foreign=1, found=["what"]))
    assert Kept(file, 1, 0.5).done == {"flips of es": Counts(3, foreign=1, found=["what"])}
    with pytest.raises(ValueError, match="begun as"):
        Kept(file, 2, 0.5)
