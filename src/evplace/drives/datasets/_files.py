"""Where the files of a data set lie: in its folder, or in a folder of their own below it."""

from __future__ import annotations

from pathlib import Path

from evplace.core.errors import DatasetError


def below(folder: Path, pattern: str) -> list[Path]:
    """What matches `pattern` in the folder and in the folders one level below it, sorted by name."""
    return sorted([*folder.glob(pattern), *folder.glob(f"*/{pattern}")], key=lambda path: path.name)


def needed(folder: Path, pattern: str, what: str) -> Path:
    """The first that matches; DatasetError, saying `what` is missing, where none does."""
    found = below(folder, pattern)
    if not found:
        raise DatasetError(f"{what} is missing: {folder} holds no {pattern}")
    return found[0]
