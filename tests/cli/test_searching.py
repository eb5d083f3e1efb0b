"""Maps with an index, and drives that are compared with what is near, from the command line."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest

from conftest import make_drive, write_drive
from evplace.cli import main


def test_a_map_with_an_index_is_localised_near_a_track(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    day, track = write_drive(tmp_path, "day", make_drive())
    street = f"{tmp_path}/street.evp"
    learn = ["train", str(day), "--track", str(track), "-o", street]
    assert main([*learn, "--scorer", "ncc", "--index", "bits"]) == 2
    assert (
        "--index means nothing for the scorer 'ncc': leave it out, or take fused" in capsys.readouterr().err
    )
    assert main([*learn, "--index", "bits"]) == 0
    assert json.loads(Path(street, "index.json").read_text())["searcher"] == "bits"
    found = f"{tmp_path}/found.csv"
    assert main(["localize", street, str(day), "--track", str(track)]) == 2
    assert "--track says where to compare, and --near-m how far around: give both" in capsys.readouterr().err
    asked = ["localize", street, str(day), "--unchecked", "-o", found, "--near-m", "15"]
    assert main([*asked, "--track", str(track)]) == 0
    with Path(found).open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 60
    assert {row["compared"] for row in rows} == {"position"}
    eastings = [float(row["easting"]) for row in rows]
    assert max(abs(easting - eastings[0] - 2 * at) for at, easting in enumerate(eastings)) < 25
    assert main([*asked, "--overwrite"]) == 0
    with Path(found).open() as file:
        assert {row["compared"] for row in csv.DictReader(file)} == {"all", "match"}
