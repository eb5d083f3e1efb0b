"""The flags of commands whose work is shared out, here or on a cluster."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass

from evplace.cli._output import remarks
from evplace.core.cluster import workers_on
from evplace.core.workers import Workers


@dataclass(frozen=True, kw_only=True)
class WorkerFlags:
    """Where work is done, and how much at once; neither changes the result."""

    workers: int | None = None
    """Processes at once; one a core if not given. They do not change the result."""
    on: str | None = None
    """Where: here, ray (the cluster of RAY_ADDRESS, or this machine's own), or HOST:PORT of a Ray head. By
    default the cluster of RAY_ADDRESS where that is set, else here."""

    @contextlib.contextmanager
    def opened_workers(self) -> Iterator[Workers]:
        """The workers; what happens to them in the block is remarked."""
        with remarks(), workers_on(self.on, self.workers) as workers:
            yield workers
