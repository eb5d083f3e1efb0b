"""Work in processes of its own: `python -m MODULE`, which imports what its caller does.

Not multiprocessing: that would run the caller's own script again in each process. The job comes on standard
input, as a line of JSON; an error that evplace raises on purpose travels back as such; a process whose caller
has gone ends. `start` and `received` are the two ends of any such process. `run_all` and `serve` are those of
long work, several processes at a time, which prints lines that its caller gets at once. Where the processes
run is said by `Workers`: on this machine, or on a cluster (`evplace.core.cluster`).
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Lock, Thread
from typing import Any, Protocol

from evplace.core import errors
from evplace.core.errors import EvplaceError, SettingsError, WorkerFailedError, WorkerLostError

Job = Mapping[str, Any]
"""What a process is to do, as JSON has it."""

Failed = Callable[[int, EvplaceError], None]
"""Called with a job's index and what ended it."""
MOST_TRIES = 3
"""A job whose worker is killed is done again, so often in all."""

_ERROR = "error "


class Running(Protocol):
    """Workers at work."""

    def lines(self, module: str, job: Job) -> Iterator[str]:
        """Do one job; what it prints. Its own error, WorkerLostError where the worker was killed."""

    def end(self) -> None:
        """Stop all; nothing begins any more."""


class Workers(Protocol):
    """Where jobs are done."""

    @property
    def count(self) -> int:
        """How many are done at once."""

    def begin(self, folder: Path) -> Running:
        """Ready for jobs, which write into `folder`."""


@dataclass(frozen=True)
class Here:
    """Processes on this machine."""

    count: int

    def __post_init__(self) -> None:
        if self.count < 1:
            raise SettingsError(f"{self.count} processes can do nothing: take at least 1")

    def begin(self, folder: Path) -> Running:  # noqa: ARG002 - this machine sees its own folders
        """See Workers."""
        return _Processes()


def workers_of(given: int | Workers | None) -> Workers:
    """Workers as they are, so many processes here, or one a core for None; SettingsError for less than 1."""
    if given is None:
        return Here(os.cpu_count() or 1)
    return Here(given) if isinstance(given, int) else given


def start(
    module: str, job: Job, variables: Mapping[str, str | None] | None = None, **how: Any
) -> subprocess.Popen[bytes]:
    """A process that does `job`: `python -m module`, whose standard output is a pipe; `how` is for Popen.

    It has our variables, over which go `variables`, where None is for one that it shall not have.

    Its standard input stays open as long as the caller lives. It does not look for modules in the current
    folder, whose files may be called like any of them, unless the caller does.
    """
    command, pipe = [sys.executable, "-P", "-m", module], subprocess.PIPE
    known = _environment() | dict(variables or {})
    env = {name: value for name, value in known.items() if value is not None}
    process = subprocess.Popen(command, stdin=pipe, stdout=pipe, env=env, **how)
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


def run_all(
    module: str,
    jobs: Sequence[Job],
    workers: Workers,
    folder: Path,
    report: Callable[[int, str], None],
    failed: Failed | None = None,
) -> None:
    """Do all `jobs` in processes of `module`, which calls `serve`, in their order; they write into `folder`.

    `report` gets the job's index and each line that it prints, one call at a time. A job whose worker is
    killed is done again, up to MOST_TRIES times; what it had printed comes again, or was lost with it. The
    first error ends all, the worker's own or WorkerLostError; where `failed` is given, it gets each, and the
    other jobs go on.
    """
    running, ended, alone = workers.begin(folder), Event(), Lock()

    def work(index: int) -> None:
        try:
            for line in _tried(running, module, jobs[index], ended):
                with alone:
                    report(index, line)
        except EvplaceError as error:
            if failed is None or ended.is_set():
                raise
            with alone:
                failed(index, error)

    with ThreadPoolExecutor(max(1, workers.count)) as pool:
        parts = [pool.submit(work, index) for index in range(len(jobs))]
        try:
            done, _ = wait(parts, return_when=FIRST_EXCEPTION)
            for part in done:
                part.result()
        finally:
            ended.set()
            pool.shutdown(wait=False, cancel_futures=True)
            running.end()


def _tried(running: Running, module: str, job: Job, ended: Event) -> Iterator[str]:
    """The lines of a job, which is begun anew where its worker is killed."""
    for tries in range(1, MOST_TRIES + 1):
        try:
            yield from running.lines(module, job)
            return
        except WorkerLostError as error:
            if ended.is_set():
                raise
            if tries == MOST_TRIES:
                raise WorkerLostError(
                    f"{error}, and so were {tries - 1} before it at the same job (is memory short?): run "
                    "again to go on"
                ) from error
            warnings.warn(f"{error}: its job is done again", stacklevel=2)


def serve(work: Callable[[dict[str, Any], Callable[[str], None]], None]) -> int:
    """A worker's main: call `work` with the job and with what prints a line; returns the exit code."""
    job = received()
    try:
        work(job, lambda line: print(line, flush=True))
    except EvplaceError as error:
        print(_ERROR + json.dumps(packed(error)), flush=True)
        return 2
    return 0


def search_path() -> str:
    """The folders in which modules are looked for here, as PYTHONPATH has them."""
    return os.pathsep.join(folder or str(Path.cwd()) for folder in sys.path)


def _environment() -> dict[str, str | None]:
    """The variables of a process that finds every module where its caller finds it, and prints UTF-8."""
    return {**dict(os.environ), "PYTHONPATH": search_path(), "PYTHONIOENCODING": "utf-8"}


def _end_with_the_caller() -> None:
    """Standard input stays open as long as the caller lives; read as a file, whose lock nobody else needs."""
    while os.read(sys.stdin.fileno(), 1 << 10):
        pass
    os._exit(1)


class _Processes:
    """The processes of this machine that are at work."""

    def __init__(self) -> None:
        self._lock, self._ended = Lock(), False
        self._processes: set[subprocess.Popen[bytes]] = set()

    def lines(self, module: str, job: Job) -> Iterator[str]:
        """See Running."""
        with start(module, job) as process:
            self._add(process)
            try:
                yield from lines_of(process)
            finally:
                self._processes.discard(process)

    def _add(self, process: subprocess.Popen[bytes]) -> None:
        """Take one more; one that comes after the end is ended at once."""
        with self._lock:
            self._processes.add(process)
            if self._ended:
                process.kill()

    def end(self) -> None:
        """See Running."""
        with self._lock:
            self._ended = True
            for process in list(self._processes):
                process.kill()


def lines_of(process: subprocess.Popen[bytes]) -> Iterator[str]:
    """What a worker prints, until its end; its error, WorkerLostError where it was killed."""
    assert process.stdout is not None
    for data in process.stdout:
        line = data.decode()
        if line.startswith(_ERROR):
            raise unpacked(json.loads(line.removeprefix(_ERROR)))
        yield line.strip()
    code = process.wait()
    if code < 0:
        raise WorkerLostError(f"a worker was stopped by signal {-code}")
    if code > 0:
        raise WorkerFailedError(f"a worker failed with exit code {code}: what it printed above says why")
