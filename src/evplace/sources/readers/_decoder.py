"""The process in which a decoder that can crash or hang runs: see `_isolated`, which starts it.

It writes messages to its standard output: a frame with the kind (H header, B block, E end) and two numbers,
then so many bytes. A header or an end is JSON, with 0 as the second number; an end with something in it is an
error. A block is the columns t_us, x, y and p of that many events, with how many were untimed.
"""

from __future__ import annotations

import importlib
import json
import signal
import struct
import sys
from pathlib import Path
from typing import IO, Any

import numpy as np

from evplace.core.errors import EvplaceError
from evplace.core.workers import packed, received
from evplace.sources.readers._source import Block, Hints, Source

WORK_S = 8.0
"""Seconds of its own work within which this process gives a block; beyond that it goes round in circles. They
are counted where the system can: a busy machine must not make a good recording look damaged."""
MEMORY = 1 << 29
"""Bytes that it may take for what it reads, where the system can limit it; a block needs far less."""
SLICE = 1 << 19
"""Events that a message carries at most."""
FRAME = struct.Struct("<cqq")


def main() -> None:
    """Decode what the job names."""
    job, pipe = received(), sys.stdout.buffer
    limit_work()
    try:
        reader = importlib.import_module(f"evplace.sources.readers.{job['reader']}")
        limit_memory()
        hints = job["hints"]
        size, columns = (None if hints[name] is None else tuple(hints[name]) for name in ("size", "columns"))
        known = Hints(size, hints["time_unit"], hints["stream"], columns)
        source: Source = reader.open_here(Path(job["path"]), known)
        send(pipe, b"H", {"size": source.size, "notes": source.notes, "streams": list(source.streams)})
        if not job["head"]:
            for block in source.blocks():
                send_block(pipe, block)
        send(pipe, b"E", {})
    except EvplaceError as error:
        send(pipe, b"E", packed(error))


def limit_memory() -> None:
    """Have the system refuse this process more than MEMORY from now on, and keep no image of its crash."""
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if sys.platform == "linux":
            pages = int(Path("/proc/self/statm").read_text().split()[5])
            most = pages * resource.getpagesize() + MEMORY
            resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def limit_work() -> None:
    """Have the system end this process after WORK_S seconds of work from now on, even within C code."""
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_PROF, WORK_S)


def send(pipe: IO[bytes], kind: bytes, value: dict[str, Any]) -> None:
    data = json.dumps(value).encode()
    pipe.write(FRAME.pack(kind, len(data), 0) + data)
    pipe.flush()


def send_block(pipe: IO[bytes], block: Block) -> None:
    for start in range(0, len(block.t_us), SLICE):
        part = slice(start, start + SLICE)
        count = len(block.t_us[part])
        pipe.write(FRAME.pack(b"B", count, block.untimed if start == 0 else 0))
        for field in block[:4]:
            pipe.write(np.ascontiguousarray(field[part]).data)
    pipe.flush()
    limit_work()


if __name__ == "__main__":
    main()
