"""Long work in processes of its own, several at a time: `python -m MODULE`, one process a job.

Not multiprocessing: that would run the caller's own script again in each process. The job comes on standard
input, as JSON. A worker prints lines, each told to the caller at once; an error that evplace raises on
purpose travels back as such; a worker whose caller has gone ends.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from pathlib import Path
from threading import Lock, Thread
from typing import Any

import evplace
from evplace.core import errors
from evplace.core.errors import EvplaceError, OutputError

Job = Mapping[str, Any]
"""What a worker is to do, as JSON has it."""

_ERROR = "error "


def run_all(module: str, jobs: Sequence[Job], count: int, tell: Callable[[int, str], None]) -> None:
    """Run `python -m module` for each of `jobs`, `count` at a time, in their order.

    `tell` gets the job's index and each line that it prints, one call at a time. The first error ends all:
    the worker's own, or OutputError for one that was stopped.
    """
    running, alone = _Running(), Lock()

    def work(index: int) -> None:
        def said(line: str) -> None:
            with alone:
                tell(index, line)

        _run(module, jobs[index], running, said)

    with ThreadPoolExecutor(max(1, count)) as pool:
        parts = [pool.submit(work, index) for index in range(len(jobs))]
        try:
            done, _ = wait(parts, return_when=FIRST_EXCEPTION)
            for part in done:
                part.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)
            running.end()


def serve(work: Callable[[dict[str, Any], Callable[[str], None]], None]) -> int:
    """A worker's main: call `work` with the job and with what prints a line; returns the exit code."""
    job = json.loads(sys.stdin.readline())
    Thread(target=_end_with_the_caller, daemon=True).start()
    try:
        work(job, lambda line: print(line, flush=True))
    except EvplaceError as error:
        print(_ERROR + json.dumps({"kind": type(error).__name__, "text": str(error)}), flush=True)
        return 2
    return 0


def environment() -> dict[str, str]:
    """A worker imports the same evplace as its caller."""
    source = str(Path(evplace.__file__).parents[1])
    before = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": source + (os.pathsep + before if before else "")}


def _end_with_the_caller() -> None:
    """Standard input stays open as long as the caller lives."""
    sys.stdin.read()
    os._exit(1)


class _Running:
    """The processes that are at work."""

    def __init__(self) -> None:
        self._lock, self._ended = Lock(), False
        self._processes: list[subprocess.Popen[str]] = []

    def add(self, process: subprocess.Popen[str]) -> None:
        """Take one more; one that comes after the end is ended at once."""
        with self._lock:
            self._processes.append(process)
            if self._ended:
                process.kill()

    def end(self) -> None:
        """Kill all."""
        with self._lock:
            self._ended = True
            for process in self._processes:
                process.kill()


def _run(module: str, job: Job, running: _Running, tell: Callable[[str], None]) -> None:
    command = [sys.executable, "-m", module]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, env=environment()) as process:
        running.add(process)
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps(job) + "\n")
        process.stdin.flush()
        for line in process.stdout:
            if line.startswith(_ERROR):
                raise _error(line.removeprefix(_ERROR))
            tell(line.strip())
        code = process.wait()
    if code < 0:
        raise OutputError(f"a worker was stopped by signal {-code}: run again to go on")
    if code > 0:
        raise OutputError(f"a worker failed with exit code {code}: what it printed above says why")


def _error(line: str) -> EvplaceError:
    """The error that a worker met, of its own kind where this can be made from its text."""
    told = json.loads(line)
    kind = getattr(errors, told["kind"], EvplaceError)
    try:
        error: EvplaceError = kind(told["text"])
    except TypeError:  # one that is made from other things than its text
        return EvplaceError(told["text"])
    return error
