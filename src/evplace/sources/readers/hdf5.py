"""HDF5 files of event data sets: the layout is known by its keys, wherever in the file it stands.

Read in a child process (see `_isolated`): damaged files can bring the HDF5 library down.
"""

from __future__ import annotations

from pathlib import Path

from evplace.sources.readers._isolated import isolated
from evplace.sources.readers._source import Hints, Source

ABOUT = "HDF5 file (DSEC, M3ED, NSAVP, Prophesee, MVSEC, v2e and like layouts)"
MAGIC = b"\x89HDF\r\n\x1a\n"
TABLE = True


def matches(path: Path, head: bytes) -> bool:
    """Whether the file has the signature of HDF5, at its start or behind a user's block."""
    return any(head[at : at + 8] == MAGIC for at in (0, 512, 1024, 2048, 4096, 8192, 16384, 32768))


def read(path: Path, hints: Hints) -> Source:
    """The layout; RecordingError where no known one is found, MissingExtraError where a filter is missing."""
    return isolated("_hdf5", path, hints)
