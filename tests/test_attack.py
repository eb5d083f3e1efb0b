"""The attack in short: a few cases of each kind. `scripts/attack` does many."""

from __future__ import annotations

import os

import pytest
from outputs import full_disks, hostile_files, kills
from run import Counts, _counted, many

SEED = int(os.environ.get("EVPLACE_SEED", "0"))


def check(counts: Counts) -> None:
    assert counts.is_good, (str(counts), counts.found)


@pytest.mark.parametrize("kind", ["flip", "cut"])
@pytest.mark.parametrize("form", ["evt3", "hdf5"])
def test_recordings(form: str, kind: str) -> None:
    """All formats are in `test_all_formats`."""
    check(many(kind, form, 60, SEED))


@pytest.mark.parametrize("name", ["rmc", "bag"])
def test_logs(name: str) -> None:
    check(many("log", name, 60, SEED))


@pytest.mark.parametrize("name", ["map-grid", "result"])
def test_folders(name: str) -> None:
    """Each way that these can be altered is in `test_altered_maps`."""
    check(many("folder", name, 10, SEED))


def test_settings() -> None:
    check(many("settings", "images", 20, SEED))


@pytest.mark.skipif(os.name == "nt", reason="Windows kills no process by a signal")
def test_outputs() -> None:
    pytest.importorskip("torch", reason="the network needs the extra 'train'")
    check(_counted(kills(2, SEED)))
    check(_counted(full_disks(short=True)))


def test_files_that_are_given() -> None:
    check(_counted(hostile_files()))
