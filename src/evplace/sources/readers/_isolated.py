"""Decoders that can crash or hang run in a process of their own, and hand their events over through a pipe.

HDF5 and Parquet are read by large C++ libraries that a damaged file can bring down or send round in
circles. Here the child may die: what it gave before is kept, and the recording is reported as damaged.
"""

from __future__ import annotations

import importlib
import json
import signal
import struct
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

from evplace.core import errors
from evplace.core.errors import DamagedRecordingError, EvplaceError
from evplace.core.events import Size
from evplace.sources.readers._source import Block, Hints, Source

WORK_S = 8.0
"""Seconds of its own work within which the child gives a block; beyond that it goes round in circles. They
are counted where the system can: a busy machine must not make a good recording look damaged."""
PATIENCE_S = 120.0
"""Seconds by the clock within which a block must come; beyond that the child waits for ever."""
MEMORY = 4 << 30
"""Bytes of address space that the child may take, where the system can limit it; a block needs far less."""
SLICE = 1 << 19
"""Events that a message carries at most."""
PIPE = 1 << 20
"""Bytes that the pipe holds, where the system lets it be set: the two processes then rarely wait."""
_FRAME = struct.Struct("<cqq")
"""Kind (H header, B block, E end), then two numbers: bytes and 0, or events and untimed events."""


def isolated(reader: str, path: Path, hints: Hints) -> Source:
    """What `evplace.sources.readers.<reader>.open_here(path, hints)` gives, decoded in a child process."""
    about = next(_Child(reader, path, hints, header_only=True).messages())
    assert isinstance(about, dict)
    return Source(
        _pair(about["size"]), partial(_blocks, reader, path, hints), about["notes"], streams=about["streams"]
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
        wanted = {"reader": reader, "path": str(path), "hints": asdict(hints)}
        code = f"import sys; sys.path[:] = {sys.path!r}; from {__name__} import serve; serve()"
        self._process = subprocess.Popen(
            [sys.executable, "-c", code, json.dumps(wanted | {"head": header_only})],
            stdout=subprocess.PIPE,
            stdin=subprocess.DEVNULL,
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
        watchdog = threading.Timer(seconds, self._process.kill)
        watchdog.start()
        try:
            assert self._process.stdout is not None
            return _message(self._process.stdout)
        except EOFError:
            late = watchdog.finished.is_set()
            self._process.kill()  # which does nothing to one that has ended: its code stays what it was
            endless = self._process.wait() == -getattr(signal, "SIGPROF", 0)
            waited = WORK_S if endless else seconds
            reason = f"it gave nothing for {waited:g} s" if late or endless else "it crashed"
            raise DamagedRecordingError(
                f"{self._path} is damaged: its decoder was stopped, as {reason}"
            ) from None
        finally:
            watchdog.cancel()


def _message(pipe: IO[bytes]) -> dict[str, Any] | Block | None:
    kind, first, second = _FRAME.unpack(_exactly(pipe, _FRAME.size))
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
        error = getattr(errors, about["error"])
        raise error.__new__(error, about["text"])  # past an __init__ that would build the text again
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


def serve() -> None:
    """The child: decode what the arguments name, and write messages to the standard output."""
    wanted = json.loads(sys.argv[1])
    _limit_memory()
    _limit_work()
    pipe = sys.stdout.buffer
    try:
        reader = importlib.import_module(f"evplace.sources.readers.{wanted['reader']}")
        hints = wanted["hints"]
        columns = None if hints["columns"] is None else tuple(hints["columns"])
        known = Hints(_pair(hints["size"]), hints["time_unit"], hints["stream"], columns)
        source: Source = reader.open_here(Path(wanted["path"]), known)
        _send(pipe, b"H", {"size": source.size, "notes": source.notes, "streams": list(source.streams)})
        if not wanted["head"]:
            for block in source.blocks():
                _send_block(pipe, block)
        _send(pipe, b"E", {})
    except EvplaceError as error:
        _send(pipe, b"E", {"error": type(error).__name__, "text": str(error)})


def _limit_memory() -> None:
    if sys.platform != "win32":
        import resource

        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        if sys.platform != "darwin":
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


def _limit_work() -> None:
    """Have the system end this process after WORK_S seconds of work from now on, even within C code."""
    if sys.platform != "win32":
        signal.setitimer(signal.ITIMER_PROF, WORK_S)


def _send(pipe: IO[bytes], kind: bytes, value: dict[str, Any]) -> None:
    data = json.dumps(value).encode()
    pipe.write(_FRAME.pack(kind, len(data), 0) + data)
    pipe.flush()


def _send_block(pipe: IO[bytes], block: Block) -> None:
    for start in range(0, len(block.t_us), SLICE):
        part = slice(start, start + SLICE)
        count = len(block.t_us[part])
        pipe.write(_FRAME.pack(b"B", count, block.untimed if start == 0 else 0))
        for field in block[:4]:
            pipe.write(np.ascontiguousarray(field[part]).data)
    pipe.flush()
    _limit_work()
