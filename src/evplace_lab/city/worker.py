"""One drive in a process of its own, see `generation` and `evplace.core.workers`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from evplace.core.settings import make
from evplace.core.workers import serve
from evplace_lab.city.plan import CitySettings
from evplace_lab.city.recording import record_drive
from evplace_lab.city.town import build_town


def work(job: dict[str, Any], report: Callable[[str], None]) -> None:
    """Make the drive that `job` names; reports the share that is done."""
    settings = make(CitySettings, job["settings"])
    town = build_town(settings.seed)
    record_drive(
        Path(job["out"]), town, settings, job["condition"], job["path"], lambda share: report(f"{share:.4f}")
    )
    report("1.0")


if __name__ == "__main__":
    sys.exit(serve(work))
