"""Zip archives, as text and numpy arrays come in."""

from __future__ import annotations

import zipfile
from pathlib import Path

from evplace.core.errors import UnsupportedError

METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA)
LOCKED = 1
"""The flag of a member that takes a password."""


def members(path: Path, *suffixes: str) -> list[str]:
    """The names in an archive that end so; UnsupportedError where one of these cannot be unpacked here."""
    with zipfile.ZipFile(path) as archive:
        found = [info for info in archive.infolist() if info.filename.lower().endswith(suffixes)]
    for info in found:
        if info.flag_bits & LOCKED:
            raise UnsupportedError(f"{path} is an archive with a password: unpack it first")
        if info.compress_type not in METHODS:
            raise UnsupportedError(
                f"{path} is an archive packed by method {info.compress_type} of zip: unpack it first"
            )
    return [info.filename for info in found]
