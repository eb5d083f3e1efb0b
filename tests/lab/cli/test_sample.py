"""The sample pair: what its printed lines do."""

from __future__ import annotations

import dataclasses
import json
import shlex
from pathlib import Path

import pytest

from evplace.cli import main
from evplace_lab.cli import sample


def test_the_printed_lines_run_on_what_was_made(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sample, "SETTINGS", dataclasses.replace(sample.SETTINGS, route_length_m=60.0, fps=30))
    assert main(["sample", "-o", str(tmp_path / "street")]) == 0
    lines = [line.strip() for line in capsys.readouterr().out.splitlines() if line.startswith("  evplace")]
    names = sorted(path.name for path in (tmp_path / "street").iterdir())
    assert names == ["day.csv", "day.h5", "day.nmea", "night.csv", "night.h5", "night.nmea"]
    assert len(lines) == 6
    for line in lines:
        assert main(shlex.split(line)[1:]) == 0, line
    assert (tmp_path / "street.result" / "report.html").exists()
    assert (tmp_path / "street.result" / "play.webp").exists()
    assert main(["sample", "-o", str(tmp_path / "street")]) == 2
    monkeypatch.setattr(sample, "_make", lambda folder: None)
    assert main(["sample", "-o", str(tmp_path / "street"), "--overwrite", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out.splitlines()[-1])["recordings"]) == 2
