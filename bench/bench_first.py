"""From nothing to the first answer: the commands, and the CPU seconds that each takes.

    python bench/bench_first.py dist/evplace-0.1.0-py3-none-any.whl RECORDING [QUERY]

In an environment of its own, with nothing compiled before. RECORDING needs no log of positions: its places
are runs of ten images, and without a QUERY it is found again in itself. What pip loads from elsewhere takes
time, as the network is, but no CPU.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

from harness import cpu_seconds, processor


def cpu_of(folder: Path, command: list[str]) -> tuple[float, str]:
    """Seconds of all that a command starts, and what it printed; a recording whose end is damaged will do."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "compiled"), "XDG_CACHE_HOME": str(folder)}
    environment.pop("PYTHONPATH", None)
    before = cpu_seconds()
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 3):
        sys.exit(f"{shlex.join(command)} ended with {done.returncode}: {done.stderr}")
    return cpu_seconds() - before, done.stdout


def main() -> None:
    wheel, day, *rest = (str(Path(path).resolve()) for path in sys.argv[1:])
    query = rest[0] if rest else day
    lines = [
        ["pip", "install", "--quiet", "--disable-pip-version-check", wheel],
        ["evplace", "train", day, "--run-length", "10", "-o", "map.evp"],
        ["evplace", "localize", "map.evp", query],
    ]
    print(processor())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        venv.create(folder / "venv", with_pip=True)
        total, said = 0.0, ""
        for program, *words in lines:
            seconds, said = cpu_of(folder, [str(folder / "venv" / "bin" / program), *words])
            total += seconds
            print(f"{seconds:6.1f} s  {program} {words[0]}")
        print(f"{total:6.1f} s of CPU in {len(lines)} commands; the first answer:")
        print("\n".join(said.splitlines()[:2]))


if __name__ == "__main__":
    main()
