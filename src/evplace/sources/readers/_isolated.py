"""Decoders that can crash or hang run in a process of their own, and hand their events over through a pipe.

HDF5 and Parquet are read by large C++ libraries that a damaged file can bring down or send round in
circles. Here the child may die: what it gave before is kept, and the recording is reported as damaged.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import DamagedRecordingError
from evplace.core.events import Size
from evplace.core.workers import start, unpacked
from evplace.sources.readers import _decoder
from evplace.sources.readers._source import Block, Hints, Source

PATIENCE_S = 120.0
"""Seconds by the clock within which a block must come; beyond that the child waits for ever."""
PIPE = 1 << 20
"""Bytes that the pipe holds, where the system lets it be set: the two processes then rarely wait."""


def isolated(reader: str, path: Path, hints: Hints) -> Source:
    """What `evplace.sources.readers.<reader>.open_here(path, hints)` gives, decoded in a child process."""
    about = next(_Child(reader, path, hints, header_only=True).messages())
    assert isinstance(about, dict)
    return Source(
        _pair(about["size"]),
        partial(_blocks, reader, path, hints),
        about["notes"],
        streams=about["streams"],
        apart=True,
    )


def _pair(size: list[int] | None) -> Size | None:
    """A size as JSON holds it."""
    return None if size is None else (size[0], size[1])


def _blocks(reader: str, path: Path, hints: Hints) -> Iterator[Block]:
    for message in _Child(reader, path, hints, header_only=False).messages():
        if isinstance(message, Block):
            yield message


class _Child:
    """One decoding process, from its start to its end."""

    def __init__(self, reader: str, path: Path, hints: Hints, header_only: bool) -> None:
        self._path = path
        job = {"reader": reader, "path": str(path), "hints": asdict(hints), "head": header_only}
        self._process = start(
            _decoder.__name__,
            job,
            stderr=subprocess.DEVNULL,
            pipesize=PIPE if sys.platform == "linux" else -1,
        )

    def messages(self) -> Iterator[dict[str, Any] | Block]:
        """The header as a mapping, then blocks; raises the error that ended the child's work."""
        try:
            while (message := self._within(PATIENCE_S)) is not None:
                yield message
        finally:
            self._process.kill()
            self._process.communicate()

    def _within(self, seconds: float) -> dict[str, Any] | Block | None:
        """The next message; DamagedRecordingError where none comes in time or the child died."""
        late = threading.Event()

        def stop() -> None:
            late.set()  # before the end of the pipe is seen, which says only that the child is gone
            self._process.kill()

        watchdog = threading.Timer(seconds, stop)
        watchdog.start()
        try:
            assert self._process.stdout is not None
            return message(self._process.stdout)
        except EOFError:
            self._process.kill()  # which does nothing to one that has ended: its code stays what it was
            endless = self._process.wait() == -getattr(signal, "SIGPROF", 0)
            waited = _decoder.WORK_S if endless else seconds
            reason = f"it gave nothing for {waited:g} s" if late.is_set() or endless else "it crashed"
            raise DamagedRecordingError(
                f"{self._path} is damaged: its decoder was stopped, as {reason}"
            ) from None
        finally:
            watchdog.cancel()


def message(pipe: IO[bytes]) -> dict[str, Any] | Block | None:
    kind, first, second = _decoder.FRAME.unpack(_exactly(pipe, _decoder.FRAME.size))
    if kind == b"B":
        fields: list[NDArray[Any]] = [
            np.frombuffer(_exactly(pipe, first * np.dtype(kind).itemsize), kind)
            for kind in (np.int64, np.uint16, np.uint16, np.bool_)
        ]
        return Block(fields[0], fields[1], fields[2], fields[3], second)
    about: dict[str, Any] = json.loads(_exactly(pipe, first))
    if kind == b"H":
        return about
    if about:
        raise unpacked(about)
    return None


def _exactly(pipe: IO[bytes], length: int) -> bytearray:
    """`length` bytes as a buffer that arrays may write to; EOFError where fewer come."""
    data = bytearray(length)
    view, got = memoryview(data), 0
    while got < length:
        part = pipe.readinto(view[got:])  # type: ignore[attr-defined]  # IO[bytes] of typeshed lacks it
        if not part:
            raise EOFError
        got += part
    return data
