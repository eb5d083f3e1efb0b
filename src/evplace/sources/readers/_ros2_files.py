"""The files of a ROS 2 bag, each plain or packed as a whole with zstd (`.mcap.zstd`)."""

from __future__ import annotations

import os
import re
import tempfile
import weakref
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import zstandard

from evplace.sources.readers._unpack import LIMIT

ZSTD = b"\x28\xb5\x2f\xfd"
"""How data packed with zstd starts."""
WINDOW = 1 << 27
"""Bytes that unpacking looks back at most."""
RATIO = 1000
"""How many bytes one of a packed file may become: those of events become four or five."""
PART = 1 << 20
"""Bytes unpacked at a time."""


class BagFile:
    """A file of a bag, to be read as if it were not packed."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.packed = _head(path).startswith(ZSTD)
        self.most = path.stat().st_size * (RATIO if self.packed else 1) + (LIMIT if self.packed else 0)
        """Bytes that there may be at most."""
        self._unpacked: Path | None = None
        self._cut: Path | None = None

    def stream(self) -> BinaryIO:
        """From its start to its end, without a way back where it is packed."""
        file = self.path.open("rb")
        if not self.packed:
            return file
        unpacker = zstandard.ZstdDecompressor(max_window_size=WINDOW)
        return unpacker.stream_reader(file, read_across_frames=True, closefd=True)

    def place(self) -> Path:
        """Where it lies unpacked; a packed one is written to a temporary file that goes with this object."""
        if not self.packed:
            return self.path
        if self._unpacked is None:
            number, name = tempfile.mkstemp(prefix="evplace-", suffix=".db3")
            weakref.finalize(self, Path(name).unlink, missing_ok=True)
            with os.fdopen(number, "wb") as file:
                for part in self._parts():
                    file.write(part)
            self._unpacked = Path(name)
        return self._unpacked

    def upto(self, length: int) -> Path:
        """Where its first `length` bytes lie, in a temporary file that goes with this object."""
        if self._cut is None:
            number, name = tempfile.mkstemp(prefix="evplace-", suffix=".db3")
            weakref.finalize(self, Path(name).unlink, missing_ok=True)
            with os.fdopen(number, "wb") as file, self.place().open("rb") as whole:
                while length > 0 and (part := whole.read(min(PART, length))):
                    length -= len(part)
                    file.write(part)
            self._cut = Path(name)
        return self._cut

    def _parts(self) -> Iterator[bytes]:
        """Its content up to where it breaks off, which whoever reads it will find out."""
        left = self.most
        with self.stream() as packed:
            try:
                while left > 0 and (part := packed.read(PART)):
                    left -= len(part)
                    yield part
            except zstandard.ZstdError:
                return


def bag_files(path: Path, suffix: str) -> list[BagFile]:
    """The files of a bag's folder, or one file."""
    return [BagFile(file) for file in _paths(path, suffix)]


def is_bag(path: Path, head: bytes, suffix: str, magic: bytes) -> bool:
    """Whether a folder holds such files, or a file, perhaps packed, starts with `magic`."""
    if path.is_dir():
        return bool(_paths(path, suffix))
    if not head.startswith(ZSTD):
        return head.startswith(magic)
    try:
        with BagFile(path).stream() as unpacked:
            return unpacked.read(len(magic)) == magic
    except (zstandard.ZstdError, OSError):
        return False


def _paths(path: Path, suffix: str) -> list[Path]:
    """In the order of the numbers that end their names; a packed file only where it is not there plain."""
    if not path.is_dir():
        return [path]
    files = [*path.glob(f"*{suffix}.zstd"), *path.glob(f"*{suffix}")]
    found = {file.name.removesuffix(".zstd").removesuffix(suffix): file for file in files}
    return [found[name] for name in sorted(found, key=lambda name: (_number(name), name))]


def _number(name: str) -> int:
    return int((re.findall(r"(\d+)$", name) or ["0"])[0])


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(len(ZSTD))
