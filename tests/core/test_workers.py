"""Work in processes: lines come back, errors travel, a killed worker is told, none outlives its caller."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from evplace.core.errors import EvplaceError, OutputError, SettingsError
from evplace.core.workers import environment, run_all

WORKER = """
import os, sys, time
from evplace.core.errors import MissingExtraError, SettingsError
from evplace.core.workers import serve

def work(job, say):
    if job["does"] == "fail":
        raise SettingsError("a line of its own")
    if job["does"] == "lack":
        raise MissingExtraError("torch", "train", "training")
    if job["does"] == "wait":
        time.sleep(60)
    if job["does"] == "break":
        sys.exit(3)
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
    with pytest.raises(EvplaceError, match="train"):
        run_all(module, [{"does": "lack"}], 1, print)
    with pytest.raises(OutputError, match="signal 9: run again to go on"):
        run_all(module, [{"does": "die"}], 1, print)
    with pytest.raises(OutputError, match="exit code 3"):
        run_all(module, [{"does": "break"}], 1, print)


def test_the_first_error_ends_all(module: str) -> None:
    began = time.monotonic()
    with pytest.raises(SettingsError):
        run_all(module, [{"does": "wait"}, {"does": "fail"}, {"does": "wait"}], 2, print)
    assert time.monotonic() - began < 50  # not the minute that the others wait


def test_a_job_may_be_long(module: str) -> None:
    said: list[str] = []
    run_all(
        module, [{"does": "say", "name": "n" * 300_000, "lines": 1}], 1, lambda _, line: said.append(line)
    )
    assert len(said[0]) == 300_002


def test_a_worker_ends_with_its_caller(module: str) -> None:
    command = [sys.executable, "-m", module]
    with subprocess.Popen(command, stdin=subprocess.PIPE, text=True, env=environment()) as process:
        assert process.stdin is not None
        process.stdin.write(json.dumps({"does": "wait"}) + "\n")
        process.stdin.close()
        assert process.wait(timeout=50) == 1
