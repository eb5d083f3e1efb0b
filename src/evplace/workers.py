"""Long work in processes of its own, several at a time: `python -m MODULE JOB`, one process a job.

Not multiprocessing: that would run the caller's own script again in each process. A worker prints lines, each
told to the caller at once; an error that evplace raises on purpose travels back as such.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import evplace
from evplace import errors
from evplace.errors import EvplaceError, OutputError

Job = Mapping[str, Any]
"""What a worker is to do, as JSON has it."""

_ERROR = "error "


def run_all(module: str, jobs: Sequence[Job], count: int, tell: Callable[[int, str], None]) -> None:
    """Run `python -m module JOB` for each of `jobs`, `count` at a time, in their order.

    `tell` gets the job's index and each line that it prints, from several threads. The first error ends all:
    the worker's own, or OutputError for one that was stopped.
    """
    running: list[subprocess.Popen[str]] = []

    def work(index: int) -> None:
        _run(module, jobs[index], running, lambda line: tell(index, line))

    try:
        with ThreadPoolExecutor(max(1, count)) as pool:
            for _ in pool.map(work, range(len(jobs))):
                pass
    finally:
        for process in running:
            process.kill()


def serve(work: Callable[[dict[str, Any], Callable[[str], None]], None]) -> int:
    """A worker's main: call `work` with the job and with what prints a line; returns the exit code."""
    try:
        work(json.loads(sys.argv[1]), lambda line: print(line, flush=True))
    except EvplaceError as error:
        print(_ERROR + json.dumps({"kind": type(error).__name__, "text": str(error)}), flush=True)
        return 2
    return 0


def environment() -> dict[str, str]:
    """A worker imports the same evplace as its caller."""
    source = str(Path(evplace.__file__).parents[1])
    before = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": source + (os.pathsep + before if before else "")}


def _run(module: str, job: Job, running: list[subprocess.Popen[str]], tell: Callable[[str], None]) -> None:
    command = [sys.executable, "-m", module, json.dumps(job)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment()) as process:
        running.append(process)
        assert process.stdout is not None
        for line in process.stdout:
            if line.startswith(_ERROR):
                raise _error(line.removeprefix(_ERROR))
            tell(line.strip())
    if process.returncode != 0:
        raise OutputError(f"a worker was stopped (exit {process.returncode}): run again to go on")


def _error(line: str) -> EvplaceError:
    told = json.loads(line)
    kind = getattr(errors, told["kind"], OutputError)
    return kind(told["text"]) if issubclass(kind, EvplaceError) else OutputError(told["text"])
