"""`evplace doctor` as a person types it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conftest import make_drive, write_drive
from evplace.cli import main
from evplace.sources.writers import write_recording

Capture = pytest.CaptureFixture[str]


@pytest.fixture
def day(tmp_path: Path) -> Path:
    """day.aedat4 and day.csv."""
    write_drive(tmp_path, "day", make_drive(windows=60))
    return tmp_path


def test_the_summary_comes_first_and_then_the_worst(day: Path, capsys: Capture) -> None:
    assert main(["doctor", f"{day}/day.aedat4", "--dt", "1/30000"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{day}/day.aedat4: ")
    assert "80 x 60" in lines[1]
    assert lines[3].split()[:3] == ["bad", "empty", "windows"]
    assert "--every-events" in lines[4] + lines[5]
    assert max(map(len, lines[1:])) <= 110


def test_json(day: Path, capsys: Capture) -> None:
    assert main(["doctor", f"{day}/day.aedat4", "--track", f"{day}/day.csv", "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert set(output) == {"recording", "facts", "findings", "fault"}
    assert set(output["findings"][0]) == {"name", "state", "value", "unit", "sentence", "advice"}
    assert "GPS coverage" in {finding["name"] for finding in output["findings"]}


def test_a_drive_of_a_data_set_with_its_own_track(day: Path, capsys: Capture) -> None:
    write_drive(day, "night", make_drive(seed=1, windows=60))
    assert main(["doctor", str(day), "--drive", "night", "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert output["recording"] == f"{day}/night.aedat4"
    assert "GPS coverage" in {finding["name"] for finding in output["findings"]}
    assert main(["doctor", str(day)]) == 2
    assert "say which with --drive: day, night" in capsys.readouterr().err


def test_pictures_are_written_and_not_overwritten(day: Path, capsys: Capture) -> None:
    pytest.importorskip("matplotlib", reason="pictures need the extra 'report'")
    arguments = ["doctor", f"{day}/day.aedat4", "--report", f"{day}/day.doctor"]
    assert main(arguments) == 0
    assert (day / "day.doctor" / "rate.png").read_bytes().startswith(b"\x89PNG")
    assert main(arguments) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*arguments, "--overwrite"]) == 0


def test_a_damaged_recording_is_examined_and_ends_with_3(day: Path, capsys: Capture) -> None:
    events = make_drive(windows=60).events
    write_recording(
        day / "many.aedat4", [events[n : n + 500] for n in range(0, len(events), 500)], events.size
    )
    content = (day / "many.aedat4").read_bytes()
    (day / "cut.aedat4").write_bytes(content[: len(content) // 2])
    assert main(["doctor", f"{day}/cut.aedat4"]) == 3
    output = capsys.readouterr()
    assert output.out.splitlines()[3].split()[:2] == ["bad", "reading"]
    assert output.err.startswith("evplace: ")
    assert output.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["none.aedat4"], "none.aedat4"),
        (["notes.txt"], "known are"),
        (["day.aedat4", "--track", "none.nmea"], "none.nmea"),
        (["day.aedat4", "--dt", "0"], "'dt'"),
        (["day.aedat4", "--dt", "1/0"], "'dt'"),
        (["none.mp4"], "none.mp4"),
    ],
)
def test_what_cannot_be_read_ends_with_2(
    day: Path, capsys: Capture, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(day)
    (day / "notes.txt").write_text("dear diary")
    assert main(["doctor", *arguments]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert words in lines[0]


def test_strict_ends_with_2_where_something_is_bad(day: Path, capsys: Capture) -> None:
    recording = f"{day}/day.aedat4"
    assert main(["doctor", recording, "--dt", "1/30000"]) == 0
    assert main(["doctor", recording, "--dt", "1/30000", "--strict"]) == 2
    assert "bad" in capsys.readouterr().out


def test_a_log_is_examined_by_itself(day: Path, capsys: Capture) -> None:
    assert main(["doctor", f"{day}/day.csv", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["facts"]["kind"] == "fixes"
    names = {finding["name"] for finding in found["findings"]}
    assert {"GPS fixes", "GPS gaps", "GPS jumps"} <= names
    assert "GPS coverage" not in names
    assert main(["doctor", f"{day}/day.csv"]) == 0
    assert "fixes" in capsys.readouterr().out
