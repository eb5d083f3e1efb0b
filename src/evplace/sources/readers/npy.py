"""One numpy array (.npy): a table of events, whose fields have names or are told by their values."""

from __future__ import annotations

from pathlib import Path
from typing import IO

from evplace.core.errors import RecordingError
from evplace.sources.readers import _npy
from evplace.sources.readers._source import Hints, Source

ABOUT = "numpy array (.npy) with columns t, x, y, p"
MAGIC = b"\x93NUMPY"
TABLE = True


def matches(path: Path, head: bytes) -> bool:
    """Whether the file starts as an array."""
    return head.startswith(MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The columns and the unit of time; RecordingError where they are missing or not clear."""

    def opened(_: str) -> IO[bytes]:
        return path.open("rb")

    try:
        return _npy.source(path, ("",), opened, None, hints)
    except _npy.FAULTS as error:
        raise RecordingError(f"{path} is a damaged numpy array: {error}") from error
