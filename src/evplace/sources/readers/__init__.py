"""Event recordings -> packets of checked events. One file a format; its name is the format's name.

To add a format, add one file and its test. The file holds:

- `ABOUT`, one line of text that says what the format is;
- `matches(path, head) -> bool`: whether the file is of this format, told from its content. `head` is its
  first 64 KiB; it is empty where `path` is a folder;
- `read(path, hints) -> Source`: reads the header only. `Source` holds the size that the file states (or
  None), the guesses made (`notes`), and `blocks()`, which starts at the beginning and gives the decoded
  events in bounded memory. `read` raises RecordingError where the header cannot be used, `blocks()` raises
  DamagedRecordingError where the data breaks off, after every good block.

The reader only decodes. `Recording` checks coordinates and times, counts what it drops, infers a missing
size and cuts packets, for all formats alike (the rules stand in `_checks`).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from evplace.core import families
from evplace.core.errors import EvplaceError, RecordingError
from evplace.core.events import Size
from evplace.sources.readers._source import Block, Hints, Source, checked_source

if TYPE_CHECKING:
    from evplace.sources.readers._recording import Recording

__all__ = ["Block", "Hints", "Recording", "Source", "is_recording", "open_recording"]

HEAD = 1 << 16
"""Bytes from which the format is told."""
TIME_UNITS = ("s", "ms", "us", "ns")


def open_recording(
    path: str | Path, size: Size | None = None, format: str | None = None, time_unit: str | None = None
) -> Recording:
    """Open a recording; its format is found from its content unless `format` names a reader.

    `size` (width, height) in pixels overrides the header; `time_unit` ("s", "ms", "us", "ns") settles it
    for formats that do not say. Raises RecordingError where the file is missing, empty or of no known
    format, or its header cannot be used; SettingsError for a `format` that does not exist.
    """
    from evplace.sources.readers._recording import Recording

    file = Path(path)
    if size is not None and (min(size) < 1 or max(size) > 1 << 16):
        raise RecordingError(f"the size {size[0]}x{size[1]} is none a sensor can have: give width and height")
    if time_unit is not None and time_unit not in TIME_UNITS:
        raise RecordingError(f"unknown time unit '{time_unit}': known are {', '.join(TIME_UNITS)}")
    head = _head(file)
    name = _found(file, head) if format is None else format
    reader = families.load("readers", name)
    try:
        with families.blaming("readers", reader, OSError):
            source: Source = reader.read(file, Hints(size, time_unit))
    except OSError as error:
        raise RecordingError(f"cannot read {file} as {name}: {error.strerror or error}") from error
    return Recording(file, name, checked_source(source, "readers", reader), size)


def __getattr__(name: str) -> Any:
    """Recording, on first use: the child processes that only decode start in half the time without it."""
    if name != "Recording":
        raise AttributeError(f"module 'evplace.sources.readers' has no attribute '{name}'")
    from evplace.sources.readers._recording import Recording

    return Recording


def is_recording(path: Path) -> bool:
    """Whether the content of the file or folder `path` is of a known recording format."""
    try:
        _found(path, _head(path))
    except RecordingError:
        return False
    return True


def _head(path: Path) -> bytes:
    """The first bytes of a file; empty for a folder."""
    if path.is_dir():
        return b""
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from error
    if not head:
        raise RecordingError(f"{path} is empty: it holds no event")
    return head


def _found(path: Path, head: bytes) -> str:
    """The name of the first reader that knows the content."""
    faults: list[EvplaceError] = []
    for name in families.recognising("readers", lambda reader: reader.matches(path, head), faults):
        return name
    known, what = ", ".join(families.names("readers")), "the folder" if path.is_dir() else "the content"
    raise RecordingError(
        f"{path}: {what} is of no known recording format: known are {known}{families.besides(faults)}"
    )
