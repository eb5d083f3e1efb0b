"""How fast a recording is examined, and in how much memory: a generated DAT file of a 1280x720 sensor.

python bench/bench_doctor.py [MILLION_EVENTS]      40 if not given; 8 bytes of disk an event
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from evplace.doctor import examine
from evplace.sources.readers import open_recording

HEADER = b"% Data file containing CD events.\n% Version 2\n% Width 1280\n% Height 720\n\x0c\x08"
MILLION = 1_000_000


def generate(path: Path, millions: int) -> None:
    """A million events at random pixels in each second."""
    rng = np.random.default_rng(0)
    with path.open("wb") as file:
        file.write(HEADER)
        for second in range(millions):
            t_us = np.sort(rng.integers(0, MILLION, MILLION)) + second * MILLION
            x, y, p = (rng.integers(0, bound, MILLION) for bound in (1280, 720, 2))
            file.write(np.column_stack([t_us, x | y << 14 | p << 28]).astype("<u4").tobytes())


def decode(path: Path) -> None:
    for _ in open_recording(path).packets():
        pass


def main() -> None:
    millions = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    with tempfile.TemporaryDirectory() as folder:
        generate(Path(folder) / "small.dat", 1)
        for function in (decode, examine):  # compiles
            function(Path(folder) / "small.dat")
        generate(Path(folder) / "large.dat", millions)
        for name, function in (("decoding alone", decode), ("examining", examine)):
            start_s, start_cpu_s = time.perf_counter(), time.process_time()
            function(Path(folder) / "large.dat")
            cpu_s, wall_s = time.process_time() - start_cpu_s, time.perf_counter() - start_s
            peak_mb = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
            print(
                f"{name:<14} {millions / cpu_s:6.1f} Mev/s of CPU time, {millions / wall_s:6.1f} of wall; "
                f"peak memory {peak_mb:.0f} MB"
            )


if __name__ == "__main__":
    main()
