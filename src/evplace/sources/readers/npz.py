"""numpy archives (.npz): t, x, y and p as four arrays under usual names, or as one table.

Optional arrays `width` and `height` state the sensor. Pickled arrays are refused.
"""

from __future__ import annotations

import zipfile
from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import IO

from evplace.core.errors import RecordingError
from evplace.core.events import Size
from evplace.sources.readers import _npy
from evplace.sources.readers._source import Hints, Source, printable
from evplace.sources.readers._zip import members

ABOUT = "numpy archive (.npz) with arrays t, x, y, p"
TABLE = True


def matches(path: Path, head: bytes) -> bool:
    """Whether it is a zip archive that starts with an array."""
    return head.startswith(b"PK\x03\x04") and head[30 : 30 + int.from_bytes(head[26:28], "little")].endswith(
        b".npy"
    )


def read(path: Path, hints: Hints) -> Source:
    """The arrays, sensor and unit of time; RecordingError where they are missing or do not fit."""
    try:
        names = tuple(name.removesuffix(".npy") for name in members(path, ".npy"))
        return _npy.source(path, names, partial(_opened, path), _size(path, names), hints)
    except _npy.FAULTS as error:
        raise RecordingError(f"{path} is a damaged numpy archive: {printable(str(error))}") from error


@contextmanager
def _opened(path: Path, name: str) -> Generator[IO[bytes], None, None]:
    with zipfile.ZipFile(path) as archive, archive.open(f"{name}.npy") as file:
        yield file


def _size(path: Path, names: tuple[str, ...]) -> Size | None:
    if not {"width", "height"} <= set(names):
        return None
    width, height = (_npy.number(partial(_opened, path), name) for name in ("width", "height"))
    fits = width is not None and height is not None and 0 < width <= 1 << 16 and 0 < height <= 1 << 16
    return (width, height) if fits and width is not None and height is not None else None
