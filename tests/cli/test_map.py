"""Maps of several drives as a person makes them: train, add, split, merge, info, and what goes wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from conftest import make_drive, make_traverse, write_drive
from evplace.cli import main

Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope="module")
def drives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Traverse folders day, dusk and night, and night as a recording with its log."""
    folder = tmp_path_factory.mktemp("drives")
    for seed, name in enumerate(("day", "dusk", "night")):
        drive = make_drive(seed, noise=0.002 + 0.01 * seed)
        make_traverse(drive).save(folder / name)
    write_drive(folder, "late", make_drive(3, noise=0.02))
    return folder


def said(capsys: Capture, *arguments: object) -> dict[str, Any]:
    """What a command prints with --json."""
    capsys.readouterr()
    assert main([*map(str, arguments), "--json"]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def fault(capsys: Capture, *arguments: object) -> str:
    """The one line of a command that cannot be carried out."""
    capsys.readouterr()
    assert main([*map(str, arguments)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_maps_of_several_drives(drives: Path, tmp_path: Path, capsys: Capture) -> None:
    city = tmp_path / "city.evp"
    facts = said(capsys, "train", drives / "day", drives / "dusk", "-o", city, "--scorer", "ncc")
    assert (facts["images"], facts["items"]) == (120, 60)
    facts = said(capsys, "map", "add", city, drives / "night")
    assert [drive["name"] for drive in facts["drives"]] == ["day", "dusk", "night"]
    assert [version["change"] for version in facts["versions"]] == ["trained", "added dusk", "added night"]
    assert said(capsys, "map", "info", city) == facts
    main(["map", "info", str(city)])
    assert "version 3" in capsys.readouterr().out
    bright, dark = tmp_path / "bright.evp", tmp_path / "dark.evp"
    said(capsys, "map", "split", city, "--drives", "day", "dusk", "-o", bright)
    said(capsys, "map", "split", city, "--drives", "night", "-o", dark)
    facts = said(capsys, "map", "merge", bright, dark, "-o", tmp_path / "again.evp")
    assert facts["items"] == 60
    assert len(facts["drives"]) == 3
    matches = said(capsys, "evaluate", city, drives / "night", "-o", tmp_path / "result")
    assert matches["recall@1"] > 0.9


def test_a_recording_is_added_as_the_map_was_made(drives: Path, tmp_path: Path, capsys: Capture) -> None:
    flags = ("--run-length", 0, "--scorer", "ncc")
    log = drives / "late.csv"
    said(capsys, "train", drives / "late.aedat4", "--track", log, "-o", tmp_path / "map", *flags)
    assert "already, as 'late'" in fault(
        capsys, "map", "add", tmp_path / "map", drives / "late.aedat4", "--track", log
    )
    assert "local plane" in fault(capsys, "map", "add", tmp_path / "map", drives / "day")


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("add", "{map}"), "needs a drive"),
        (("merge", "{map}", "-o", "{new}"), "needs a second map"),
        (("merge", "{map}", "{map}"), "say where with --out"),
        (("merge", "{map}", "{map}", "-o", "{new}"), "already, as 'first'"),
        (("split", "{map}", "--drives", "moon", "-o", "{new}"), "no drive 'moon': it has first"),
        (("split", "{map}", "{map}", "-o", "{new}"), "takes one map"),
        (("info", "{map}", "--name", "x"), "--name means nothing for evplace map info"),
        (("add", "{map}", "{dusk}", "--drives", "x"), "--drives means nothing"),
        (("add", "{map}", "{dusk}", "{dusk}", "--name", "x"), "--name is of one drive, and 2 are given"),
        (("add", "{map}", "{dusk}", "-o", "{map}"), "exists"),
        (("add", "{dusk}", "{dusk}"), "is a traverse, not a map"),
        (("add", "{map}", "{day}"), "already, as 'first'"),
    ],
)
def test_faults(drives: Path, tmp_path: Path, capsys: Capture, words: tuple[str, ...], told: str) -> None:
    said(capsys, "train", drives / "day", "-o", tmp_path / "map", "--scorer", "ncc")
    before = sorted(tmp_path.rglob("*"))
    names = {"map": tmp_path / "map", "new": tmp_path / "new", "day": drives / "day", "dusk": drives / "dusk"}
    assert told in fault(capsys, "map", *(word.format(**names) for word in words))
    assert sorted(tmp_path.rglob("*")) == before


def test_flags_of_one_drive_are_refused_for_several(drives: Path, tmp_path: Path, capsys: Capture) -> None:
    days = (drives / "day", drives / "dusk")
    told = fault(capsys, "train", *days, "--track", drives / "late.csv", "-o", tmp_path / "map")
    assert "--track is of one drive, and 2 are given" in told
    assert "learns places" in fault(capsys, "train", *days, "--preset", "paper", "-o", tmp_path / "map")
    assert not (tmp_path / "map").exists()
