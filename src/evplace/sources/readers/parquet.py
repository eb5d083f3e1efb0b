"""Parquet files with columns t, x, y and p, such as those of Brisbane-Event-VPR.

Read in a child process (see `_isolated`): damaged files can bring the Parquet library down.
"""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

from evplace.core.errors import MissingExtraError
from evplace.sources.readers._isolated import isolated
from evplace.sources.readers._source import Hints, Source

ABOUT = "Parquet file with columns t, x, y, p"
MAGIC = b"PAR1"
TABLE = True


def matches(path: Path, head: bytes) -> bool:
    """Whether the file starts as Parquet."""
    return head.startswith(MAGIC)


def read(path: Path, hints: Hints) -> Source:
    """The columns; RecordingError where some are missing, MissingExtraError without pyarrow."""
    if find_spec("pyarrow") is None:
        raise MissingExtraError("pyarrow", "parquet", f"reading {path}")
    return isolated("_parquet", path, hints)
