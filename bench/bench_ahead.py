"""What decoding in a thread of its own saves, by the clock: python bench/bench_ahead.py RECORDING...

Each recording is examined and converted (to AEDAT 4) with and without that thread, in alternation. Wall time
says what the second core gives; it needs a machine that has nothing else to do.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from evplace.doctor import examine
from evplace.sources.readers import _recording, open_recording
from evplace.sources.writers import write_recording
from harness import processor

ROUNDS = 5


def convert(path: Path) -> None:
    with tempfile.TemporaryDirectory() as folder:
        recording = open_recording(path)
        write_recording(Path(folder) / "out.aedat4", recording.packets(), recording.size)


def timed(job: Callable[[Path], object], path: Path, large: int) -> tuple[float, float]:
    """Seconds by the clock, and of CPU time, where files of `large` bytes have a thread."""
    _recording.LARGE = large
    began, cpu_began = time.perf_counter(), time.process_time()
    job(path)
    return time.perf_counter() - began, time.process_time() - cpu_began


def main() -> None:
    print(processor())
    for path in map(Path, sys.argv[1:]):
        for job in (examine, convert):
            rounds = [(timed(job, path, 0), timed(job, path, 1 << 62)) for _ in range(ROUNDS + 1)][1:]
            (ahead_s, ahead_cpu), (usual_s, usual_cpu) = np.array(rounds).transpose(1, 2, 0)
            gain = usual_s / ahead_s
            print(
                f"{path.name}, {job.__name__}: ahead {np.median(ahead_s):.2f} s, "
                f"else {np.median(usual_s):.2f} s: "
                f"x{np.median(gain):.2f} ({gain.min():.2f} to {gain.max():.2f}); "
                f"CPU time x{np.median(usual_cpu / ahead_cpu):.2f}"
            )


if __name__ == "__main__":
    main()
