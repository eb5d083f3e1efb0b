"""A command on one drive, in a process of its own: see `_many` and `evplace.core.workers`."""

from __future__ import annotations

import importlib
import json
import sys
from collections.abc import Callable
from typing import Any

from evplace.core.settings import make
from evplace.core.workers import serve


def work(job: dict[str, Any], say: Callable[[str], None]) -> None:
    """Run the command that `job` names; says what it made, once that is there."""
    command = importlib.import_module(f"evplace.cli.{job['command']}")
    say(json.dumps(command.made(make(command.Args, job["args"]))))


if __name__ == "__main__":
    sys.exit(serve(work))
