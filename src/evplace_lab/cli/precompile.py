"""Compiles ahead of time what the first commands of a user need, as bitcode that comes with the package.

    python -m evplace_lab.cli.precompile

A small made drive goes through the commands, and nothing through each loop that decodes; what numba made of
all those loops is then put beside the package's code, in place of what lay there. It is used by no other
source than that of which it was made. It takes half a minute.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.cli import main as command_line
from evplace.core import families
from evplace.core._arguments import is_known_here
from evplace.core._code_files import SHIPPED, ship
from evplace.core._machine_code import made
from evplace.core.events import Events, Size
from evplace.sources.readers import _ros_encodings
from evplace.sources.readers._canvas import Canvas, Sink, sink_of
from evplace.sources.writers import write_recording

SIZE: Size = (64, 48)
RATE = 60_000
"""Events a second."""
LENGTH_S = 4
COMMANDS = (
    "info day.raw",
    "info day.aedat4",
    "info day.h5",
    "info day.npz",
    "info day.txt --size 64 48",
    "doctor day.raw --track day.csv",
    "images day.raw -o images",
    "images day.h5 -o traverse",
    "train day.raw --track day.csv -o map",
    "localize map day.raw",
    "evaluate map day.raw --track day.csv -o result",
)
"""What somebody may try first."""


def main() -> None:
    """Fill the package's folder, where that is of use."""
    shutil.rmtree(SHIPPED, ignore_errors=True)
    if not is_known_here():
        return
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        os.environ["NUMBA_CACHE_DIR"] = folder
        for loop in decoding_loops():
            decode_nothing(loop)
        make_drives()
        for line in COMMANDS:
            run(line)
    for name, code in made.items():
        ship(name, code)


def run(line: str) -> None:
    """One command; what it says is shown where it fails."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = command_line(line.split())
    if status:
        sys.exit(f"evplace {line}\n{said.getvalue()}")


def decoding_loops() -> Iterator[Any]:
    """Of all formats."""
    for module in [*(module for _, module in families.loadable("readers")), _ros_encodings]:
        for name, value in vars(module).items():
            if name.startswith("_decode") and hasattr(value, "dispatcher"):
                yield value


def decode_nothing(loop: Any) -> None:
    """Call a loop with no bytes, as it is called where events are stored, and where they are marked."""
    canvas = Canvas(np.zeros(SIZE[::-1], np.int8))
    for sink in (sink_of(None, 0), canvas.sink(0)):
        taken = inspect.signature(loop, eval_str=True).parameters.values()
        loop(*(sink if each.annotation is Sink else _nothing(each.annotation) for each in taken))


def _nothing(kind: Any) -> Any:
    """The first array is what is decoded; a decoder's state is an array of int64."""
    if kind in (int, bool):
        return kind(0)
    dtype = kind.__args__[1].__args__[0]
    return np.zeros(8 if dtype is np.int64 else 0, dtype)


def make_drives() -> None:
    """One drive in the formats that are written, and as text: edges that sweep over the sensor."""
    events = _events()
    for name in ("day.raw", "day.aedat4", "day.h5", "day.npz"):
        write_recording(name, [events], SIZE)
    rows = zip(events.t_us[:2000], events.x, events.y, events.p, strict=False)
    Path("day.txt").write_text("".join(f"{t / 1e6:.6f} {x} {y} {p:d}\n" for t, x, y, p in rows))
    fixes = (f"{t * 1e6:.0f},{37.35 + 1e-4 * t},-122.03" for t in np.arange(-1, LENGTH_S + 1, 0.25))
    Path("day.csv").write_text("\n".join(["t_us,latitude,longitude", *fixes]))


def _events() -> Events:
    rng = np.random.default_rng(0)
    t_us: NDArray[np.int64] = np.arange(RATE * LENGTH_S) * 1_000_000 // RATE
    edge = rng.integers(0, 6, len(t_us))
    x = (edge * 11 + t_us // 40_000 + rng.integers(0, 3, len(t_us))) % SIZE[0]
    return Events.of(t_us, x, rng.integers(0, SIZE[1], len(t_us)), edge % 2 == 0, SIZE)


if __name__ == "__main__":
    main()
