"""Eight recordings on a Ray cluster of two nodes on this machine, against two processes of it.

    python bench/bench_cluster.py [--rounds 3] [--events 40000000]

`evplace images` on eight recordings of 1280x720 pixels, two at a time. Printed: what starting costs; CPU time
of all processes, Ray's own too, and wall time, in alternation once all is started; whether the bytes are as
those of the local run; and what comes of a worker that is killed. Needs the extra `scale`, and faery.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import io
import os
import shutil
import signal
import tempfile
import threading
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

from bench_readers import MAKERS, generated
from evplace.cli import main as evplace
from evplace.core.events import Events
from harness import Timing, processor, report

RECORDINGS = 8
TICK_S = 1 / os.sysconf("SC_CLK_TCK")


def family() -> dict[int, list[str]]:
    """What the system says of this process and all below it: process -> fields of its stat."""
    stats = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            stats[int(file.parent.name)] = file.read_text().rpartition(") ")[2].split()
    found, below = {}, [os.getpid()]
    while below:
        found |= {number: stats[number] for number in below if number in stats}
        below = [number for number, fields in stats.items() if int(fields[1]) in below]
    return found


def cpu_s() -> float:
    """CPU seconds of this process, all below it, and those of theirs that have ended."""
    return sum(int(ticks) for fields in family().values() for ticks in fields[11:15]) * TICK_S


def bytes_of(folder: Path) -> str:
    """A checksum of all traverses."""
    found = hashlib.sha256()
    for file in sorted(folder.rglob("*")):
        if file.is_file() and file.parent != folder:
            found.update(str(file.relative_to(folder)).encode() + file.read_bytes())
    return found.hexdigest()[:16]


def images(recordings: list[Path], out: Path, *more: str) -> str:
    """The command; what it remarks."""
    shutil.rmtree(out, ignore_errors=True)
    said = io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()):
        code = evplace(["images", *map(str, recordings), "-o", str(out), "--workers", "2", *more])
    assert code == 0, said.getvalue()
    return said.getvalue().strip()


@contextlib.contextmanager
def two_nodes() -> Iterator[str]:
    """A cluster of two nodes with a core each; its address."""
    from ray.cluster_utils import Cluster

    nodes = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    try:
        nodes.add_node(num_cpus=1)
        yield nodes.address
    finally:
        nodes.shutdown()


def kill_one() -> None:
    """Kill one worker as soon as there is one."""
    for _ in range(600):
        for number in family():
            with contextlib.suppress(OSError):
                if b"evplace.cli._worker" in Path(f"/proc/{number}/cmdline").read_bytes():
                    os.kill(number, signal.SIGKILL)
                    return
        time.sleep(0.1)


def bench(folder: Path, events: int, rounds: int) -> None:
    """All figures."""
    packets = Events.concatenate(list(generated(events, (1280, 720))))
    made = MAKERS["dat"](folder, packets)
    recordings = [made.with_name(f"drive{number}.dat") for number in range(RECORDINGS)]
    for path in recordings:
        os.link(made, path)
    began = time.monotonic()
    with two_nodes() as address:
        os.environ["RAY_ADDRESS"] = address
        print(f"the cluster was there after {time.monotonic() - began:.1f} s")
        ways = {"processes here": ("--on", "here"), "a cluster of two nodes": ("--on", "ray")}
        cpu: dict[str, list[float]] = {name: [] for name in ways}
        wall: dict[str, list[float]] = {name: [] for name in ways}
        import ray

        ray.init(address=address, log_to_driver=False, logging_level="ERROR")  # stays for all rounds
        for measured in [False] + [True] * rounds:
            for name, flags in ways.items():
                at, used = time.monotonic(), cpu_s()
                images(recordings, folder / name.split()[1], *flags)
                used, took = cpu_s() - used, time.monotonic() - at
                if measured:
                    cpu[name].append(used)
                    wall[name].append(took)
                else:
                    print(f"first round, {name}: {used:.1f} s of CPU, {took:.1f} s")
        for what, taken in (("CPU time, all processes", cpu), ("wall time", wall)):
            report(f"{what}, {RECORDINGS} recordings", {n: Timing(tuple(s)) for n, s in taken.items()})
        print("bytes:", *{bytes_of(folder / name.split()[1]) for name in ways})
        threading.Thread(target=kill_one, daemon=True).start()
        print("killed:", images(recordings, folder / "killed", "--on", "ray"))
        print("bytes:", bytes_of(folder / "killed"))
        ray.shutdown()


def main() -> None:
    flags = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    flags.add_argument("--rounds", type=int, default=3)
    flags.add_argument("--events", type=int, default=40_000_000)
    args = flags.parse_args()
    warnings.simplefilter("ignore")
    print(processor(), "load", os.getloadavg()[0])
    with tempfile.TemporaryDirectory() as folder:
        bench(Path(folder), args.events, args.rounds)


if __name__ == "__main__":
    main()
