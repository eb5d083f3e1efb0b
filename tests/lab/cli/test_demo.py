"""The demo, on made drives in place of the city's and with a moment's training."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import pytest

from evplace.cli import main
from evplace.imaging.traverse import Traverse
from evplace_lab.cli import demo

pytest.importorskip("torch", reason="the network needs the extra 'train'")
pytest.importorskip("matplotlib", reason="the chart needs the extra 'report'")


@pytest.fixture
def drives(tmp_path: Path, day: Traverse, night: Traverse, monkeypatch: pytest.MonkeyPatch) -> Path:
    """day-1 and every query, each with events and with colour."""
    made = {"day-1": day, **dict.fromkeys(demo.QUERIES, night)}
    for name, traverse in made.items():
        for part in demo.INPUTS.values():
            (tmp_path / "city" / name).mkdir(parents=True, exist_ok=True)
            traverse.save(tmp_path / "city" / name / part)
    folders = {name: tmp_path / "city" / name for name in made}
    monkeypatch.setattr(demo, "built_in_drives", lambda folder, drive_m: folders)
    monkeypatch.setattr(demo, "TRAINING", dataclasses.replace(demo.TRAINING, steps=5, batch=8))
    return tmp_path


def test_the_demo_keeps_what_it_prints(drives: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["demo", "--out", f"{drives}/demo"]) == 0
    output = capsys.readouterr().out
    assert "import evplace as ev" in output
    rows = json.loads((drives / "demo" / "result.json").read_text())["rows"]
    assert len(rows) == len(demo.QUERIES) * len(demo.MATCHERS) * len(demo.INPUTS)
    assert set(rows[0]) >= {"query", "input", "matcher", "accuracy", "accuracy_seen", "rejected", "n"}
    assert (drives / "demo" / "report.png").read_bytes().startswith(b"\x89PNG")
    assert (drives / "demo" / "events.evp" / "network.onnx").exists()
    assert len(list((drives / "demo" / "results").iterdir())) == len(rows)
    assert main(["demo", "--out", f"{drives}/demo", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] == rows
    assert main(["demo", "--out", f"{drives}/demo", "--seed", "1"]) == 2
    assert "another seed" in capsys.readouterr().err
