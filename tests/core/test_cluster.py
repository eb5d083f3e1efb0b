"""The cluster's side of the seam, with a Ray that does its tasks here; test_ray.py has the real one."""

from __future__ import annotations

import socket
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from evplace.core import cluster
from evplace.core.cluster import Cluster, workers_on
from evplace.core.errors import MissingExtraError, OutputError, SettingsError, WorkerFailedError
from evplace.core.workers import Here, run_all

WORKER = """
import os, sys
from evplace.core.errors import OutputError
from evplace.core.workers import serve

def work(job, say):
    if job["does"] == "fill":
        raise OutputError("the disk is full: out was not written")
    if job["does"] == "break":
        raise ZeroDivisionError("nobody's purpose")
    say(f"{job['does']} {os.environ.get('OMP_NUM_THREADS')} {os.getcwd()}")

if __name__ == "__main__":
    sys.exit(serve(work))
"""


class RayError(Exception):
    pass


class RayTaskError(RayError):
    pass


class HereRay(SimpleNamespace):
    """So much of Ray as is used, which does its tasks in this process."""

    util = SimpleNamespace(get_node_ip_address=lambda: "10.0.0.7")
    exceptions = SimpleNamespace(RayError=RayError, RayTaskError=RayTaskError)

    def __init__(self) -> None:
        super().__init__(cancelled=0)

    def remote(self, **_: object) -> Callable[[Any], Any]:
        return lambda task: SimpleNamespace(remote=task)

    def get(self, line: object) -> object:
        return line

    def cancel(self, task: Iterator[object], force: bool) -> None:
        self.cancelled += 1


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> HereRay:
    found = HereRay()
    monkeypatch.setitem(sys.modules, "ray", found)  # type: ignore[arg-type]
    return found


@pytest.fixture
def module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "node_worker.py").write_text(WORKER)
    monkeypatch.syspath_prepend(tmp_path)
    return "node_worker"


def lines_of(module: str, does: str, ray: HereRay, folder: Path) -> list[str]:
    lines: list[str] = []
    run_all(module, [{"does": does}], Cluster(ray, 2), folder, lambda _, line: lines.append(line))
    return lines


def test_a_node_does_a_job_as_its_caller_would(
    module: str, ray: HereRay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert lines_of(module, "say", ray, tmp_path / "out") == [f"say 3 {Path.cwd()}"]
    monkeypatch.delenv("OMP_NUM_THREADS")
    assert lines_of(module, "say", ray, tmp_path / "out") == [f"say None {Path.cwd()}"]
    assert not list((tmp_path / "out").iterdir())


def test_what_goes_wrong_on_a_node_is_one_line_with_its_name(
    module: str, ray: HereRay, tmp_path: Path
) -> None:
    with pytest.raises(OutputError, match=r"disk is full: out was not written \(on the node 10\.0\.0\.7\)"):
        lines_of(module, "fill", ray, tmp_path)
    with pytest.raises(WorkerFailedError, match=r"failed: ZeroDivisionError: nobody's purpose \(on the node"):
        lines_of(module, "break", ray, tmp_path)
    with pytest.raises(WorkerFailedError, match="No module named no_such_worker"):
        lines_of("no_such_worker", "say", ray, tmp_path)


def test_a_node_without_the_package_says_so(
    module: str, ray: HereRay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "evplace.core.cluster", None)
    with pytest.raises(OutputError, match=r"the node 10\.0\.0\.7 has no evplace that works"):
        lines_of(module, "say", ray, tmp_path)


def test_a_node_of_another_version_or_disk_says_so(
    module: str, ray: HereRay, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = cluster._Tasks._here
    monkeypatch.setattr(cluster._Tasks, "_here", lambda self: here(self) | {"version": "0.0.9"})
    with pytest.raises(OutputError, match=r"is installed there, and 0\.0\.9 here: install the same"):
        lines_of(module, "say", ray, tmp_path)
    for name in ("cwd", "folder"):
        monkeypatch.setattr(cluster._Tasks, "_here", lambda self, name=name: here(self) | {name: "/none"})
        with pytest.raises(OutputError, match="/none is not seen there: all nodes need one folder"):
            lines_of(module, "say", ray, tmp_path)


def test_without_an_address_jobs_are_done_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    with workers_on(None, 3) as workers:
        assert workers == Here(3)
    monkeypatch.setenv("RAY_ADDRESS", "127.0.0.1:1")
    with workers_on("here", 2) as workers:
        assert workers == Here(2)
    with pytest.raises(SettingsError, match="0 processes can do nothing"), workers_on("here", 0):
        pass


@pytest.mark.parametrize("address", ["head", "ray://head:10001", "head:port", "127.0.0.1:"])
def test_an_address_that_is_none_is_refused(address: str) -> None:
    with (
        pytest.raises(SettingsError, match="is no address of a Ray head: give HOST:PORT"),
        workers_on(address),
    ):
        pass


def test_a_head_that_is_not_there_is_told_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.socket() as nobody:  # bound, but not listening
        nobody.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{nobody.getsockname()[1]}"
        monkeypatch.setenv("RAY_ADDRESS", address)
        for on in (None, "ray", address):
            with pytest.raises(OutputError, match=f"no Ray head answers at {address}"), workers_on(on):
                pass


def test_a_head_that_was_killed_is_told_at_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr(cluster, "KNOWN", tmp_path / "current")
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{nobody.getsockname()[1]}"
        (tmp_path / "current").write_text(address)
        with pytest.raises(OutputError, match=f"no Ray head answers at {address}"), workers_on("ray"):
            pass


def test_without_ray_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RAY_ADDRESS", raising=False)
    monkeypatch.setattr(cluster, "KNOWN", Path("no such file"))
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingExtraError, match="scale"), workers_on("ray"):
        pass
