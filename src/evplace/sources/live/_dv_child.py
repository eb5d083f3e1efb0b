"""The process in which dv-processing reads a network stream: see `dv`, which starts it."""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from evplace.core.workers import received
from evplace.sources.readers._decoder import limit_work, send, send_block
from evplace.sources.readers._source import Block

POLL_S = 0.002
"""Seconds between two looks at a stream that had nothing."""
BEAT_S = 0.5
"""Seconds after which a sign of life is given where nothing came."""


def main() -> None:
    """Read the stream that the job names until it ends."""
    import dv_processing

    job, pipe = received(), sys.stdout.buffer
    reader: Any = dv_processing.io.NetworkReader(job["host"], job["port"])
    send(pipe, b"H", {"size": list(reader.getEventResolution() or ()) or None})
    said_s = time.monotonic()
    while reader.isRunning():
        batch = reader.getNextEventBatch()
        if batch is not None and batch.size():
            send_block(pipe, _block(batch.numpy()))
        elif time.monotonic() < said_s + BEAT_S:
            time.sleep(POLL_S)
            continue
        else:
            send(pipe, b"H", {"size": None})
            limit_work()
        said_s = time.monotonic()


def _block(events: Any) -> Block:
    x, y = (np.ascontiguousarray(events[name]).astype(np.uint16) for name in ("x", "y"))
    t_us = np.ascontiguousarray(events["timestamp"], np.int64)
    return Block(t_us, x, y, np.ascontiguousarray(events["polarity"]) != 0)


if __name__ == "__main__":
    main()
