"""Work in processes: lines come back, errors travel, a killed worker is told, none outlives its caller."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conftest import HANG_S
from evplace.core.errors import EvplaceError, MissingExtraError, OutputError, SettingsError, WorkerLostError
from evplace.core.workers import Here, packed, run_all, start, unpacked

HERE = Path()
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
        time.sleep(600)
        say("nobody ended it")
    if job["does"] == "break":
        sys.exit(3)
    if job["does"] == "die once" and not os.path.exists(job["mark"]):
        open(job["mark"], "w").close()
        say("on its way")
        os.kill(os.getpid(), 9)
    if job["does"] == "die":
        os.kill(os.getpid(), 9)
    for k in range(job["lines"]):
        say(f"{job['name']} {k}")

sys.exit(serve(work))
"""


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "made_worker.py").write_text(WORKER)
    monkeypatch.syspath_prepend(tmp_path)
    return "made_worker"


def test_every_line_is_told_with_the_job_that_said_it(module: str) -> None:
    lines: list[tuple[int, str]] = []
    jobs = [{"does": "say", "name": name, "lines": 3} for name in "ab"]
    run_all(module, jobs, Here(2), HERE, lambda index, line: lines.append((index, line)))
    assert sorted(lines) == [(n, f"{'ab'[n]} {k}") for n in (0, 1) for k in range(3)]
    run_all(module, [], Here(2), HERE, lambda index, line: lines.clear())
    assert lines


def test_errors_travel(module: str) -> None:
    with pytest.raises(SettingsError, match="a line of its own"):
        run_all(module, [{"does": "fail"}], Here(1), HERE, print)
    with pytest.raises(EvplaceError, match="train"):
        run_all(module, [{"does": "lack"}], Here(1), HERE, print)
    with pytest.raises(OutputError, match="exit code 3"):
        run_all(module, [{"does": "break"}], Here(1), HERE, print)


def test_the_job_of_a_killed_worker_is_done_again(module: str, tmp_path: Path) -> None:
    lines: list[str] = []
    job = {"does": "die once", "mark": str(tmp_path / "mark"), "name": "a", "lines": 2}
    with pytest.warns(UserWarning, match="signal 9: its job is done again"):
        run_all(module, [job], Here(1), HERE, lambda _, line: lines.append(line))
    assert lines == ["on its way", "a 0", "a 1"]


@pytest.mark.filterwarnings("ignore:a worker was stopped by signal 9")
def test_a_job_that_kills_its_workers_is_given_up(module: str) -> None:
    with pytest.raises(WorkerLostError, match="signal 9, and so were 2 before it at the same job"):
        run_all(module, [{"does": "die"}], Here(1), HERE, print)


def test_other_jobs_go_on_where_each_error_is_taken(module: str) -> None:
    errors: list[tuple[int, str]] = []
    lines: list[str] = []
    jobs = [{"does": "fail"}, {"does": "say", "name": "b", "lines": 1}, {"does": "break"}]
    run_all(
        module, jobs, Here(1), HERE, lambda _, line: lines.append(line),
        lambda index, error: errors.append((index, str(error)[:15])),
    )  # fmt: skip
    assert lines == ["b 0"]
    assert errors == [(0, "a line of its o"), (2, "a worker failed")]


def test_the_first_error_ends_all(module: str) -> None:
    lines: list[str] = []
    jobs = [{"does": "wait", "lines": 0}, {"does": "fail"}, {"does": "wait", "lines": 0}]
    with pytest.raises(SettingsError):
        run_all(module, jobs, Here(2), HERE, lambda _, line: lines.append(line))
    assert lines == []


def test_a_job_may_be_long(module: str) -> None:
    lines: list[str] = []
    run_all(
        module,
        [{"does": "say", "name": "n" * 300_000, "lines": 1}],
        Here(1),
        HERE,
        lambda _, line: lines.append(line),
    )
    assert len(lines[0]) == 300_002


def test_files_of_the_current_folder_are_not_taken_for_modules(
    module: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    for name in ("json", "random", "numpy"):
        (tmp_path / "here" / f"{name}.py").write_text("raise SystemExit('not this one')")
    monkeypatch.chdir(tmp_path / "here")
    lines: list[str] = []
    run_all(
        module, [{"does": "say", "name": "é", "lines": 1}], Here(1), HERE, lambda _, line: lines.append(line)
    )
    assert lines == ["é 0"]


def test_an_error_keeps_its_kind_and_its_words() -> None:
    for error in (MissingExtraError("torch", "train", "training"), OutputError("full"), EvplaceError("")):
        again = unpacked(json.loads(json.dumps(packed(error))))
        assert (type(again), str(again)) == (type(error), str(error))
    assert type(unpacked({"error": "OfLaterVersion", "text": "new"})) is EvplaceError


def test_one_that_dies_before_it_has_its_job_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "deaf_worker.py").write_text("import os; os.close(0); os._exit(4)")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(OutputError, match="exit code 4"):
        run_all("deaf_worker", [{"long": "n" * 1_000_000}], Here(1), HERE, print)


def test_a_worker_ends_with_its_caller(module: str) -> None:
    with start(module, {"does": "wait", "lines": 0}) as process:
        assert process.stdin is not None
        process.stdin.close()
        assert process.wait(timeout=HANG_S) == 1
