"""One town in a process of its own, see `making` and `evplace.core.workers`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from evplace.core.settings import make
from evplace.core.workers import serve
from evplace_lab.descriptor.bursts import BurstSettings, make_bursts


def work(job: dict[str, Any], report: Callable[[str], None]) -> None:
    """Make the images of the seed that `job` names."""
    make_bursts(job["seed"], make(BurstSettings, job["bursts"])).save(Path(job["file"]))
    report(f"town {job['seed']}")


if __name__ == "__main__":
    sys.exit(serve(work))
