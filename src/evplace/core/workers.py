"""Work in processes of its own: `python -m MODULE`, which imports what its caller does.

Not multiprocessing: that would run the caller's own script again in each process. The job comes on standard
input, as a line of JSON; an error that evplace raises on purpose travels back as such; a process whose caller
has gone ends. `start` and `received` are the two ends of any such process. `run_all` and `serve` are those of
long work, several processes at a time, which prints lines that its caller gets at once.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from pathlib import Path
from threading import Lock, Thread
from typing import Any

from evplace.core import errors
from evplace.core.errors import EvplaceError, OutputError

Job = Mapping[str, Any]
"""What a process is to do, as JSON has it."""

_ERROR = "error "


def start(module: str, job: Job, **how: Any) -> subprocess.Popen[bytes]:
    """A process that does `job`: `python -m module`, whose standard output is a pipe; `how` is for Popen.

    Its standard input stays open as long as the caller lives. It does not look for modules in the current
    folder, whose files may be called like any of them, unless the caller does.
    """
    command, pipe = [sys.executable, "-P", "-m", module], subprocess.PIPE
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, env=_environment(), **how)
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError):  # it has ended already: its exit code says so
        process.stdin.write(json.dumps(job).encode() + b"\n")
        process.stdin.flush()
    return process


def received() -> dict[str, Any]:
    """The job, in the process that does it; from now on this ends with its caller."""
    job: dict[str, Any] = json.loads(sys.stdin.buffer.readline())
    Thread(target=_end_with_the_caller, daemon=True).start()
    return job


def packed(error: EvplaceError) -> dict[str, str]:
    """An error as JSON has it."""
    return {"error": type(error).__name__, "text": str(error)}


def unpacked(values: Mapping[str, str]) -> EvplaceError:
    """The error that was packed, of its own kind."""
    kind: type[EvplaceError] = getattr(errors, values["error"], EvplaceError)
    return kind.__new__(kind, values["text"])  # past an __init__ that would build the text again


def run_all(module: str, jobs: Sequence[Job], count: int, report: Callable[[int, str], None]) -> None:
    """Do all `jobs` in processes of `module`, which calls `serve`, `count` at a time, in their order.

    `report` gets the job's index and each line that it prints, one call at a time. The first error ends all:
    the worker's own, or OutputError for one that was stopped.
    """
    running, alone = _Running(), Lock()

    def work(index: int) -> None:
        def report_alone(line: str) -> None:
            with alone:
                report(index, line)

        _run(module, jobs[index], running, report_alone)

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
    job = received()
    try:
        work(job, lambda line: print(line, flush=True))
    except EvplaceError as error:
        print(_ERROR + json.dumps(packed(error)), flush=True)
        return 2
    return 0


def _environment() -> dict[str, str]:
    """The variables of a process that finds every module where its caller finds it, and prints UTF-8."""
    folders = os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path)
    return {**os.environ, "PYTHONPATH": folders, "PYTHONIOENCODING": "utf-8"}


def _end_with_the_caller() -> None:
    """Standard input stays open as long as the caller lives; read as a file, whose lock nobody else needs."""
    while os.read(sys.stdin.fileno(), 1 << 10):
        pass
    os._exit(1)


class _Running:
    """The processes that are at work."""

    def __init__(self) -> None:
        self._lock, self._ended = Lock(), False
        self._processes: list[subprocess.Popen[bytes]] = []

    def add(self, process: subprocess.Popen[bytes]) -> None:
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


def _run(module: str, job: Job, running: _Running, report: Callable[[str], None]) -> None:
    with start(module, job) as process:
        running.add(process)
        assert process.stdout is not None
        for data in process.stdout:
            line = data.decode()
            if line.startswith(_ERROR):
                raise unpacked(json.loads(line.removeprefix(_ERROR)))
            report(line.strip())
        code = process.wait()
    if code < 0:
        raise OutputError(f"a worker was stopped by signal {-code}: run again to go on")
    if code > 0:
        raise OutputError(f"a worker failed with exit code {code}: what it printed above says why")
