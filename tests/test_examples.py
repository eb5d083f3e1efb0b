"""The examples run as they stand."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from conftest import Drive, make_drive, write_drive
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap

EXAMPLES = Path(__file__).parents[1] / "examples"


def ran(name: str, *arguments: object) -> str:
    command = [sys.executable, str(EXAMPLES / name), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_find_a_drive(tmp_path: Path, night_drive: Drive) -> None:
    day, track = write_drive(tmp_path, "day", make_drive())
    night, _ = write_drive(tmp_path, "night", night_drive)
    lines = [line.split() for line in ran("find_a_drive.py", day, track, night).splitlines()]
    assert len(lines) == 59
    places = [int(line[1]) for line in lines]
    assert places[0] == 0
    assert np.diff(places).min() >= -1
    assert max(places) >= 5


def test_measure(tmp_path: Path, image_map: PlaceMap, night: Traverse) -> None:
    image_map.save(tmp_path / "street.evp")
    night.save(tmp_path / "night")
    output = ran("measure.py", tmp_path / "street.evp", tmp_path / "night")
    assert [line.split()[0] for line in output.splitlines()] == ["best", "hmm"]


def test_event_images(tmp_path: Path) -> None:
    recording, _ = write_drive(tmp_path, "day", make_drive(windows=5))
    ran("event_images.py", recording, tmp_path / "pictures")
    assert len(list((tmp_path / "pictures").iterdir())) == 5


@pytest.mark.parametrize("example", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_examples_are_short(example: Path) -> None:
    code = [line for line in example.read_text().splitlines() if line.strip()]
    assert len(code) <= 25
