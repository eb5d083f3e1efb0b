"""Jobs on a real cluster of two nodes on this machine: scripts/cluster installs Ray and runs these."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path

import pytest

from evplace.core.cluster import workers_on
from evplace.core.errors import OutputError, SettingsError
from evplace.core.workers import Workers, run_all

pytest.importorskip("ray", reason="a cluster needs the extra 'scale': scripts/cluster runs these tests")
pytestmark = pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::FutureWarning")

WORKER = """
import os, sys, time
from evplace.core.errors import OutputError, SettingsError
from evplace.core.storage import new_file
from evplace.core.workers import serve

def work(job, say):
    if job["does"] == "fail":
        raise SettingsError("a line of its own")
    if job["does"] == "fill":
        with new_file(job["out"]) as partial:
            partial.write_text("half")
            raise OSError(28, "No space left on device", str(partial))
    if job["does"] == "lose" and not os.path.exists(job["mark"]):
        open(job["mark"], "w").close()
        say("on its way")
        os.kill(os.getpid() if job["whom"] == "worker" else os.getppid(), 9)
        time.sleep(60)
    if job["does"] == "wait":
        say("waiting")
        time.sleep(600)
    say(f"done {job['number']}")

if __name__ == "__main__":
    sys.exit(serve(work))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("nodes")
    (folder / "far_worker.py").write_text(WORKER)
    return folder


@pytest.fixture(scope="module")
def workers(folder: Path) -> Iterator[Workers]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from ray.cluster_utils import Cluster

        patch = pytest.MonkeyPatch()
        patch.syspath_prepend(folder)
        node = {"num_cpus": 1, "object_store_memory": 80_000_000}
        nodes = Cluster(initialize_head=True, head_node_args=node | {"include_dashboard": False})
        try:
            nodes.add_node(**node)
            with workers_on(nodes.address) as found:
                yield found
        finally:
            nodes.shutdown()
            patch.undo()


def test_every_job_is_done_once_on_two_nodes(workers: Workers, folder: Path) -> None:
    assert workers.count == 2
    lines: list[tuple[int, str]] = []
    jobs = [{"does": "say", "number": number} for number in range(5)]
    run_all("far_worker", jobs, workers, folder, lambda index, line: lines.append((index, line)))
    assert sorted(lines) == [(number, f"done {number}") for number in range(5)]
    assert not list(folder.glob(".*.seen"))


@pytest.mark.parametrize("whom", ["worker", "node's"])
def test_the_job_of_a_killed_worker_is_done_again(
    workers: Workers, folder: Path, tmp_path: Path, whom: str
) -> None:
    lines: list[str] = []
    job = {"does": "lose", "whom": whom, "mark": str(tmp_path / "mark"), "number": 1}
    with pytest.warns(UserWarning, match="its job is done again"):
        run_all("far_worker", [job], workers, folder, lambda _, line: lines.append(line))
    assert lines in (["on its way", "done 1"], ["done 1"])  # what was on its way may be lost with the worker


def test_a_full_disk_is_one_line_and_leaves_nothing(workers: Workers, folder: Path, tmp_path: Path) -> None:
    job = {"does": "fill", "out": str(tmp_path / "out.txt")}
    with pytest.raises(OutputError, match=r"the disk is full: .*out.txt was not written \(on the node"):
        run_all("far_worker", [job], workers, folder, print)
    assert not list(tmp_path.iterdir())


def test_the_first_error_ends_all(workers: Workers, folder: Path) -> None:
    lines: list[str] = []
    jobs = [{"does": "fail"}, {"does": "wait"}, {"does": "wait"}]
    with pytest.raises(SettingsError, match="a line of its own"):
        run_all("far_worker", jobs, workers, folder, lambda _, line: lines.append(line))
    assert "done" not in "".join(lines)


def test_a_worker_that_is_nowhere_is_told(workers: Workers, folder: Path) -> None:
    with pytest.raises(OutputError, match="No module named no_worker"):
        run_all("no_worker", [{}], workers, folder, print)
