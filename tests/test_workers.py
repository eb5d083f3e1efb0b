"""Work in processes: lines come back, ours errors travel, a killed worker is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from evplace.errors import OutputError, SettingsError
from evplace.workers import run_all

WORKER = """
import os, sys
from evplace.errors import SettingsError
from evplace.workers import serve

def work(job, say):
    if job["does"] == "fail":
        raise SettingsError("a line of its own")
    if job["does"] == "die":
        os.kill(os.getpid(), 9)
    for k in range(job["lines"]):
        say(f"{job['name']} {k}")

sys.exit(serve(work))
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "made_worker.py").write_text(WORKER)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return "made_worker"


def test_every_line_is_told_with_the_job_that_said_it(module: str) -> None:
    said: list[tuple[int, str]] = []
    jobs = [{"does": "say", "name": name, "lines": 3} for name in "ab"]
    run_all(module, jobs, 2, lambda index, line: said.append((index, line)))
    assert sorted(said) == [(n, f"{'ab'[n]} {k}") for n in (0, 1) for k in range(3)]
    run_all(module, [], 2, lambda index, line: said.clear())
    assert said


def test_errors_travel_and_a_killed_worker_is_told(module: str) -> None:
    with pytest.raises(SettingsError, match="a line of its own"):
        run_all(module, [{"does": "fail"}], 1, print)
    with pytest.raises(OutputError, match="run again to go on"):
        run_all(module, [{"does": "die"}], 1, print)
