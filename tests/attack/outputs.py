"""Attacks on outputs: kills at random moments, full disks, and files made to hurt."""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from conftest import make_drive, write_drive
from evplace.evaluation import Result
from evplace.imaging.traverse import Traverse
from evplace.placemap import PlaceMap
from evplace.sources.readers import open_recording

Outcome = tuple[str, str, int]
"""What was done, what was found wrong (empty for nothing), and megabytes used."""
SIGNALS = ("SIGKILL", "SIGKILL", "SIGTERM", "SIGHUP", "SIGINT")


def _events(path: Path) -> object:
    return sum(map(len, open_recording(path).packets()))


def _findings(path: Path) -> object:
    return json.loads((path / "findings.json").read_text())


def _page(path: Path) -> object:
    assert path.read_text().rstrip().endswith("</html>")
    return None


COMMANDS: dict[str, tuple[list[str], Callable[[Path], object]]] = {
    "x.npz": (["convert", "day.aedat4", "x.npz"], _events),
    "x.h5": (["convert", "day.aedat4", "x.h5"], _events),
    "x.aedat4": (["convert", "day.aedat4", "x.aedat4"], _events),
    "x.raw": (["convert", "day.aedat4", "x.raw"], _events),
    "images": (["images", "day.aedat4", "-o", "images", "--track", "day.csv"], Traverse.load),
    "map": (["train", "day.aedat4", "--track", "day.csv", "-o", "map", "--scorer", "ncc"], PlaceMap.load),
    "net": (
        [
            "train", "day.aedat4", "--track", "day.csv", "-o", "net", "--scorer", "network", "--steps", "5",
            "--batch", "4",
        ],
        PlaceMap.load,
    ),
    "result": (["evaluate", "given.map", "day.aedat4", "--track", "day.csv", "-o", "result"], Result.load),
    "matches.csv": (["localize", "given.map", "day.aedat4", "-o", "matches.csv"], Path.read_bytes),
    "doctor": (["doctor", "day.aedat4", "--report", "doctor"], _findings),
    "report.html": (["report", "given.result", "-o", "report.html"], _page),
}  # fmt: skip
"""What a command writes -> its words, and what reads that back."""


def prepared(folder: Path) -> Path:
    """The same folder, with a drive, its log, a map and a result in it."""
    write_drive(folder, "day", make_drive(windows=60))
    for words in (
        ["train", "day.aedat4", "--track", "day.csv", "-o", "given.map", "--scorer", "ncc"],
        ["evaluate", "given.map", "day.aedat4", "--track", "day.csv", "-o", "given.result"],
    ):
        subprocess.run(_command(words), cwd=folder, check=True, capture_output=True)
    return folder


def _command(words: list[str]) -> list[str]:
    return [sys.executable, "-m", "evplace", *words]


def kills(folder: Path, count: int, seed: int, outputs: Sequence[str] = tuple(COMMANDS)) -> Iterator[Outcome]:
    """Each writing command, ended at a random moment: what it left is nothing or whole, and blocks nobody.

    `folder` is one that was `prepared`.
    """
    rng = random.Random(seed)
    before, usual_s = {path.name for path in folder.iterdir()}, _usual_s(folder, outputs[:count])
    for number in range(count):
        output = outputs[number % len(outputs)]
        how, after_s = rng.choice(SIGNALS), rng.random() * usual_s[output]
        overwrite = ["--overwrite"] * (folder / output).exists()
        words = [*COMMANDS[output][0], *overwrite]
        with subprocess.Popen(_command(words), cwd=folder, stdout=-1, stderr=-1) as process:
            time.sleep(after_s)
            process.send_signal(getattr(signal, how))
            _, told = process.communicate()
        wrong = _wrong(folder, output, bool(overwrite), told, before if how != "SIGKILL" else None)
        if not wrong and how == "SIGKILL":
            again = [*COMMANDS[output][0], *["--overwrite"] * (folder / output).exists()]
            done = subprocess.run(_command(again), cwd=folder, capture_output=True)
            wrong = _wrong(folder, output, True, done.stderr, before)
            wrong = wrong or (f"then {done.stderr.decode()[-300:]}" if done.returncode else "")
        yield f"{' '.join(words)} {how} after {after_s:.2f} s", wrong, 0
        if rng.random() < 0.5:
            _remove(folder / output)


def _usual_s(folder: Path, outputs: Sequence[str]) -> dict[str, float]:
    """How long each takes, which writes its output for the first time."""
    found = {}
    for output in outputs:
        began = time.monotonic()
        subprocess.run(_command(COMMANDS[output][0]), cwd=folder, check=True, capture_output=True)
        found[output] = time.monotonic() - began
    return found


def _wrong(folder: Path, output: str, had: bool, told: bytes, expected: set[str] | None) -> str:
    """What is wrong with what a command left: a traceback, an output that is not whole, or other files."""
    if b"Traceback" in told and b"KeyboardInterrupt" not in told:
        return told.decode()[-500:]
    path = folder / output
    if had and not path.exists():
        return "the old output is gone"
    try:
        if path.exists():
            COMMANDS[output][1](path)
    except Exception as error:
        return f"not whole: {error!r}"
    if expected is not None:
        left = {path.name for path in folder.iterdir()} - expected - set(COMMANDS)
        left = {name for name in left if not name.startswith("report-") and not name.endswith(".checkpoint")}
        if left:
            return f"left behind: {sorted(left)}"
    return ""


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def full_disks(
    folder: Path, sizes_kb: Sequence[int], outputs: Sequence[str] = tuple(COMMANDS)
) -> Iterator[Outcome]:
    """Each writing command on disks with too little room: one line, and nothing is left.

    `folder` is one that was `prepared`.
    """
    with tempfile.TemporaryDirectory() as place:
        for size_kb in sizes_kb:
            mount = ["mount", "-t", "tmpfs", "-o", f"size={size_kb}k", "tmpfs", place]
            if subprocess.run(mount, capture_output=True).returncode:
                print("     no disk can be mounted here: full disks are left out", flush=True)
                return
            try:
                for output in outputs:
                    words, wrong = _on_full_disk(folder, output, Path(place))
                    yield f"{words} with {size_kb} KB", wrong, 0
            finally:
                subprocess.run(["umount", place], check=True)


def _on_full_disk(folder: Path, output: str, disk: Path) -> tuple[str, str]:
    """The command that writes an output there, and what is wrong with what it did; then the disk is empty."""
    words = [str(disk / word) if word == output else word for word in COMMANDS[output][0]]
    done = subprocess.run(_command(words), cwd=folder, capture_output=True)
    lines = done.stderr.decode().strip().splitlines()
    left = [path.name for path in disk.iterdir()]
    only_plots = output == "report.html" and all(name.endswith(".png") for name in left)
    refused = done.returncode == 2 and len(lines) == 1 and (not left or only_plots)
    for path in disk.iterdir():
        _remove(path)
    return " ".join(
        words
    ), "" if done.returncode == 0 or refused else f"{done.returncode} {lines[-3:]} {left}"


def hostile_files(short: bool = False) -> Iterator[Outcome]:
    """Files made to hurt, where they are given: one line, in 10 s of work and 512 MB."""
    beside = Path(__file__).parents[3] / "shared" / "data"
    given = Path(os.environ.get("EVPLACE_DATA", beside)) / "cases" / "hostile"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_drive(folder, "day", make_drive(windows=20))
        for path in sorted(given.iterdir()) if given.is_dir() else []:
            for words in _uses(path)[: 1 if short else None]:
                yield _used(folder, words)


def _uses(path: Path) -> list[list[str]]:
    """The commands that read a file, the one that goes furthest first."""
    if path.suffix in (".csv", ".gpx", ".nmea"):
        day = ["day.aedat4", "--track", str(path)]
        return [["images", *day, "-o", "x"], ["doctor", *day]]
    return [["convert", str(path), "x.npz", "--overwrite"], ["doctor", str(path)], ["info", str(path)]]


def _used(folder: Path, words: list[str]) -> Outcome:
    with subprocess.Popen(_command(words), cwd=folder, stdout=subprocess.DEVNULL, stderr=-1) as process:
        assert process.stderr is not None
        told = process.stderr.read()
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = code = os.waitstatus_to_exitcode(status)
    work_s = used.ru_utime + used.ru_stime
    good = code in (0, 2, 3) and work_s < 10 and b"Traceback" not in told and b"\x1b" not in told
    wrong = "" if good else f"{code} after {work_s:.0f} s: {told.decode(errors='replace')[-300:]}"
    return " ".join(words), wrong, _own(used.ru_maxrss)


def _own(most_kb: int) -> int:
    """Megabytes that a child has held; 0 where that is less than what this process held when it started it.

    The system counts that of the parent, too.
    """
    ours = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most_kb >> 10 if most_kb > ours else 0
