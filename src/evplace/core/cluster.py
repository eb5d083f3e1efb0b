"""Workers on a Ray cluster: the same processes, jobs and lines as on this machine.

Ray finds a free core, and starts there what `workers` starts here; so outputs are the same, byte by byte. All
nodes have evplace in one version, and see one folder for what is read and written: where a node lacks either,
its first job says so. The machine that asks is a node itself, since Ray takes jobs from nodes alone.
"""

from __future__ import annotations

import contextlib
import json
import os
import secrets
import socket
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import IO, Any

from evplace import __version__
from evplace.core.errors import (
    EvplaceError,
    MissingExtraError,
    OutputError,
    SettingsError,
    WorkerFailedError,
    WorkerLostError,
)
from evplace.core.workers import (
    Job,
    Running,
    Workers,
    lines_of,
    packed,
    search_path,
    start,
    unpacked,
    workers_of,
)

ADDRESS = "RAY_ADDRESS"
"""The variable by which Ray itself is told where its head is."""
FOUND_S = 5.0
"""So many seconds a head may take to answer."""
KNOWN = Path(os.environ.get("RAY_TMPDIR", "/tmp"), "ray", "ray_current_cluster")
"""Where Ray notes the address of this machine's own cluster."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
"""Variables that count threads, which may change the last bits: as the caller has them, not as Ray has."""
HOW = "`ray start` begins one here, or has this machine join one"


@contextlib.contextmanager
def workers_on(on: str | None = None, count: int | None = None) -> Iterator[Workers]:
    """Where jobs are to be done: "here", "ray" (by RAY_ADDRESS, else the cluster of this machine), HOST:PORT.

    None: by RAY_ADDRESS where that is set, else here. `count` jobs are done at once; None: one a core. Raises
    OutputError where no cluster answers, MissingExtraError without Ray, SettingsError for a count below 1.
    """
    address = os.environ.get(ADDRESS) if on in (None, "ray") else on
    if on == "ray" and not address:
        address = "auto"
    if not address or address in ("here", "local"):
        yield workers_of(count)
        return
    with _connected(address) as ray:
        yield Cluster(ray, count or max(1, int(ray.cluster_resources().get("CPU", 1))))


@dataclass(frozen=True)
class Cluster:
    """The processes of a cluster that Ray is connected to."""

    ray: Any
    count: int

    def begin(self, folder: Path) -> Running:
        """See Workers."""
        return _Tasks(self.ray, folder)


class _Tasks:
    """Tasks of Ray, each of which is one process on some node."""

    def __init__(self, ray: Any, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._ray, self._lock, self._ended = ray, Lock(), False
        self._seen = folder.resolve() / f".{secrets.token_hex(8)}.seen"
        self._seen.touch()
        self._task = ray.remote(num_cpus=1, max_retries=0, num_returns="streaming")(_task())
        self._running: list[Any] = []

    def lines(self, module: str, job: Job) -> Iterator[str]:
        """See Running."""
        with self._lock:
            if self._ended:
                raise WorkerLostError("the jobs were ended")
            task = self._task.remote(module, job, self._here())
            self._running.append(task)
        try:
            for line in task:
                kind, text = self._ray.get(line)
                if kind == "error":
                    raise unpacked(json.loads(text))
                yield text
        except self._ray.exceptions.RayTaskError as error:
            raise WorkerFailedError(f"a worker failed: {str(error).strip().splitlines()[-1]}") from error
        except self._ray.exceptions.RayError as error:
            raise WorkerLostError(f"a worker of the cluster was lost ({type(error).__name__})") from error

    def _here(self) -> dict[str, Any]:
        """What a node must have, and how it does its jobs."""
        return {
            "version": __version__, "cwd": str(Path.cwd()),
            "folder": str(self._seen.parent), "seen": self._seen.name,
            "path": search_path(), "threads": {name: os.environ.get(name) for name in THREADS},
        }  # fmt: skip

    def end(self) -> None:
        """See Running."""
        with self._lock:
            self._ended = True
            for task in self._running:
                self._ray.cancel(task, force=True)
        self._seen.unlink(missing_ok=True)


def _task() -> Any:
    """What a node does. It travels as it is, since the node may have no evplace to take it from."""

    def task(module: str, job: Any, caller: Any) -> Any:
        import json

        try:
            from evplace.core.cluster import done_here
        except ImportError as error:
            import ray

            node = ray.util.get_node_ip_address()
            text = (
                f"the node {node} has no evplace that works ({error}): install it for the Python of its Ray"
            )
            yield "error", json.dumps({"error": "OutputError", "text": text})
            return
        yield from done_here(module, job, caller)

    return task


def done_here(module: str, job: Job, caller: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """On a node: do a job in a process of its own; ("line", what it prints), or ("error", as JSON)."""
    import ray

    node = ray.util.get_node_ip_address()
    # What is found here comes first: the caller's folders may be of another machine.
    variables = caller["threads"] | {"PYTHONPATH": f"{search_path()}{os.pathsep}{caller['path']}"}
    try:
        _check_node(caller)
        with (
            tempfile.TemporaryFile() as said,
            start(module, job, variables, cwd=caller["cwd"], stderr=said) as process,
        ):
            try:
                yield from (("line", line) for line in lines_of(process))
            except WorkerFailedError as error:
                raise WorkerFailedError(f"a worker failed: {_last_line(said)}") from error
            finally:
                process.kill()
    except EvplaceError as error:
        found = packed(error)
        yield "error", json.dumps(found | {"text": f"{found['text']} (on the node {node})"})


def _check_node(caller: Mapping[str, Any]) -> None:
    """OutputError where this node has another evplace, or does not see the caller's folders."""
    if caller["version"] != __version__:
        raise OutputError(
            f"evplace {__version__} is installed there, and {caller['version']} here: install the same"
        )
    for folder, inside in ((caller["cwd"], "."), (caller["folder"], caller["seen"])):
        if not Path(folder, inside).exists():
            raise OutputError(
                f"{folder} is not seen there: all nodes need one folder for what is read and written"
            )


def _last_line(said: IO[bytes]) -> str:
    """What a process said last."""
    said.seek(0)
    lines = said.read().decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "nothing said")


@contextlib.contextmanager
def _connected(address: str) -> Iterator[Any]:
    """Ray, connected to a cluster, for as long as the block takes; a connection that there is stays."""
    _check_head(address)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import ray
    except ModuleNotFoundError as error:
        raise MissingExtraError("ray", "scale", "work on a cluster") from error
    if ray.is_initialized():
        yield ray
        return
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about its own defaults to come
            ray.init(address=address, log_to_driver=False, logging_level="ERROR")
    except Exception as error:  # of many kinds, by what is wrong
        raise OutputError(f"no Ray cluster at {address} ({str(error).splitlines()[0]}): {HOW}") from error
    try:
        yield ray
    finally:
        ray.shutdown()


def _check_head(address: str) -> None:
    """OutputError where nobody answers at HOST:PORT; Ray itself tries for minutes."""
    if address == "auto":
        if not KNOWN.is_file():
            return
        address = KNOWN.read_text().strip()  # a head that was killed leaves it
    host, _, port = address.rpartition(":")
    if not (host and port.isdecimal()) or "/" in host:
        raise SettingsError(
            f"'{address}' is no address of a Ray head: give HOST:PORT, or ray for {ADDRESS}, else "
            "this machine's own cluster, or here for processes of this machine"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), FOUND_S).close()
    except (OSError, OverflowError) as error:
        raise OutputError(f"no Ray head answers at {address} ({error}): {HOW}") from error
