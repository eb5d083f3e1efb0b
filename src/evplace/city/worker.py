"""One drive in a process of its own: `python -m evplace.city.worker JOB`, see `generation`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from evplace.city.plan import CitySettings
from evplace.city.recording import record_drive
from evplace.city.town import build_town
from evplace.errors import EvplaceError
from evplace.settings import make


def run(job: str) -> int:
    """Make the drive that `job` (JSON) names; prints shares, or one line with the error."""
    told = json.loads(job)
    try:
        settings = make(CitySettings, {key: _fixed(value) for key, value in told["settings"].items()})
        town = build_town(settings.seed)
        record_drive(Path(told["out"]), town, settings, told["condition"], told["path"], _say)
        _say(1.0)
    except EvplaceError as error:
        print("error", json.dumps({"kind": type(error).__name__, "text": str(error)}), flush=True)
        return 2
    return 0


def _say(share: float) -> None:
    print(f"{share:.4f}", flush=True)


def _fixed(value: object) -> object:
    """JSON's lists as tuples."""
    return tuple(value) if isinstance(value, list) else value


if __name__ == "__main__":
    sys.exit(run(sys.argv[1]))
