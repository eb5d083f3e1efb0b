"""What commands take that have little to do: CPU seconds of a process of its own, from its start to its end.

    python bench/bench_start.py RECORDING [MAP QUERY]

`evplace info RECORDING` (small), `evplace images RECORDING`, `evplace localize MAP QUERY` (of two seconds),
and all with an empty cache of compiled loops, as for the first time after an installation: what was compiled
ahead by `python -m evplace_lab.cli.precompile` is used where it lies in the package. Python's own start and
imports are to compare.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from evplace.core._code_files import SHIPPED
from harness import alternate, processor, report


def run(*arguments: str, cache: str) -> None:
    """One process; damage at a recording's end, which exits with 3, is no matter here."""
    subprocess.run(
        [sys.executable, *arguments],
        env=os.environ
        | {"NUMBA_CACHE_DIR": cache, "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": ""},
        capture_output=True,
        check=False,
    )


def first_time(*arguments: str) -> None:
    with tempfile.TemporaryDirectory() as empty:
        run(*arguments, cache=empty)


def main() -> None:
    recording, *rest = sys.argv[1:]
    made = Path(tempfile.mkdtemp(), "images")
    images = ("images", recording, "-o", str(made), "--overwrite")
    commands = {"info": ("-m", "evplace", "info", recording), "images": ("-m", "evplace", *images)}
    if rest:
        commands["localize"] = ("-m", "evplace", "localize", *rest)
    print(processor(), "with what was compiled ahead" if SHIPPED.exists() else "with nothing compiled ahead")
    with tempfile.TemporaryDirectory() as cache:
        jobs: dict[str, Callable[[], None]] = {
            "python": lambda: run("-c", "pass", cache=cache),
            "import numpy": lambda: run("-c", "import numpy", cache=cache),
            "import numba": lambda: run("-c", "import numba", cache=cache),
        }
        for name, command in commands.items():
            jobs[f"evplace {name}"] = lambda c=command: run(*c, cache=cache)
        report("CPU seconds, and their ratio to Python's own start", alternate(jobs, 9))
        anew = {f"evplace {name}": lambda c=command: first_time(*c) for name, command in commands.items()}
        report("The first time, with an empty cache", alternate(anew, 2))
    shutil.rmtree(made.parent)


if __name__ == "__main__":
    main()
