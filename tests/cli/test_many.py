"""Many drives with one command: each as if it were named alone; a stopped call goes on."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import pytest

from conftest import make_drive, write_drive
from evplace.cli import main
from evplace.cli._many import LIST, _drives, _named, are_many
from evplace.cli.images import Args
from evplace.core.errors import SettingsError
from made_sets import write_own

Capture = pytest.CaptureFixture[str]


def bytes_of(folder: Path) -> dict[str, str]:
    files = (file for file in sorted(folder.rglob("*")) if file.is_file())
    return {str(f.relative_to(folder)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recordings")
    for seed, name in enumerate(("day", "dusk", "night")):
        write_drive(folder, name, make_drive(seed=seed))
    (folder / "letter.aedat4").write_text("dear reader")
    return folder


def run(capsys: Capture, *arguments: object) -> tuple[int, Any, str]:
    capsys.readouterr()
    code = main([*map(str, arguments), "--json"])
    out, err = capsys.readouterr()
    return code, json.loads(out) if out else None, err


def test_each_is_made_as_if_named_alone_and_once(files: Path, tmp_path: Path, capsys: Capture) -> None:
    names = ("day", "dusk", "night")
    sources = [files / f"{name}.aedat4" for name in names]
    out = ("-o", tmp_path / "many", "--track", files / "{name}.csv", "--workers", 2, "--width", 40)
    code, found, _ = run(capsys, "images", *sources, *out, "--sheet", tmp_path / "{name}.png")
    assert (code, [Path(one["out"]).name for one in found]) == (0, list(names))
    assert [one["with_position"] for one in found] == [60, 60, 60]
    alone = ("--track", files / "dusk.csv", "--width", 40)
    one = run(capsys, "images", sources[1], "-o", tmp_path / "alone", *alone)[1]
    assert found[1] == one | {"out": str(tmp_path / "many" / "dusk")}
    assert bytes_of(tmp_path / "many" / "dusk") == bytes_of(tmp_path / "alone")
    assert (tmp_path / "night.png").exists()

    before = bytes_of(tmp_path / "many")
    (tmp_path / "many" / "dusk").rename(tmp_path / "elsewhere")
    code, found, _ = run(capsys, "images", *sources, *out)
    assert code == 0
    assert [one.get("kept", False) for one in found] == [True, False, True]
    assert bytes_of(tmp_path / "many") == before

    code, _, text = run(capsys, "images", *sources, *out, "--height", 30)
    assert code == 2
    assert "day exists, and was made otherwise or of another file" in text
    assert bytes_of(tmp_path / "many") == before


def test_what_fails_does_not_end_the_others(files: Path, tmp_path: Path, capsys: Capture) -> None:
    sources = (files / "letter.aedat4", files / "day.aedat4")
    code, found, text = run(capsys, "images", *sources, "-o", tmp_path / "out", "--workers", 1)
    assert code == 2
    assert "letter.aedat4" in found[0]["error"]
    assert found[1]["images"] == 60
    assert text.startswith("evplace: letter: ")
    assert text.count("\n") == 1
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["day", LIST]


def test_every_drive_of_a_data_set(tmp_path: Path, capsys: Capture) -> None:
    write_own(tmp_path / "set")
    code, _, text = run(capsys, "images", tmp_path / "set", "-o", tmp_path / "one")
    assert code == 2
    assert "say which with --drive" in text
    for named in ("all", "day, night"):
        args = Args((tmp_path / "set",), tmp_path / "out", named)
        assert are_many(args)
        assert _drives(args) == [(tmp_path / "set", "day"), (tmp_path / "set", "night")]


def test_names_that_are_alike_get_their_folders(tmp_path: Path) -> None:
    both = [(tmp_path / "a" / "events.raw", None), (tmp_path / "b" / "events.raw", None)]
    assert list(_named(both)) == ["a-events", "b-events"]
    assert list(_named([(tmp_path / "set", "1/left"), (tmp_path / "x.raw", None)])) == ["1-left", "x"]
    with pytest.raises(SettingsError, match="two drives would both be called 'a-events'"):
        _named([both[0], both[0]])


def test_what_makes_no_sense_for_many_is_refused(files: Path, tmp_path: Path, capsys: Capture) -> None:
    many = ("images", files / "day.aedat4", files / "dusk.aedat4", "-o", tmp_path / "out")
    assert "write {name} in --sheet" in run(capsys, *many, "--sheet", "x.png")[2]
    assert "nothing is named" in run(capsys, "images", "-o", tmp_path / "out")[2]
    assert "0 processes can do nothing" in run(capsys, *many, "--workers", 0)[2]
    assert "no Ray head answers at 127.0.0.1:1 " in run(capsys, *many, "--on", "127.0.0.1:1")[2]
    assert "two drives" in run(capsys, *many[:2], *many[1:])[2]
