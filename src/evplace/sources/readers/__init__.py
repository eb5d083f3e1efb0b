"""Event recordings -> packets of checked events. One file a format; its name is the format's name.

To add a format, add one file and its test. The file holds:

- `ABOUT`, one line of text that says what the format is;
- `matches(path, head) -> bool`: whether the file is of this format, told from its content. `head` is its
  first 64 KiB; it is empty where `path` is a folder;
- `read(path, hints) -> Source`: reads the header only. `Source` holds the size that the file states (or
  None), the guesses made (`notes`), the names of the streams of events in it (the one that is read first; see
  `ordered`), and `blocks()`, which starts at the beginning and gives the decoded events in bounded memory.
  `read` raises RecordingError where the header cannot be used, UnsupportedError where it names what is not
  read, `blocks()` raises DamagedRecordingError where the data breaks off, after every good block; of a large
  file it is called, and its blocks are made, in a thread of their own;
- `TABLE = True` where events stand in columns, so that `hints.columns` has a meaning.

The reader only decodes. `Recording` checks coordinates and times, counts what it drops, infers a missing
size and cuts packets, for all formats alike (the rules stand in `_checks`). A reader whose loop hands each
event to `put` of `_canvas` also gives `Source.onto`: plainly good events are then marked on a canvas as they
are decoded, and the first that is not, with all after it, comes in a block as ever.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evplace.core import families
from evplace.core.errors import EvplaceError, RecordingError, UnsupportedError
from evplace.core.events import Size
from evplace.core.folders import instead
from evplace.core.storage import is_stream
from evplace.sources.readers._foreign import foreign
from evplace.sources.readers._source import Block, Hints, Source, checked_source

if TYPE_CHECKING:
    from evplace.sources.readers._canvas import Canvas
    from evplace.sources.readers._recording import Recording

__all__ = ["Block", "Canvas", "Hints", "Recording", "Source", "is_recording", "open_recording"]

HEAD = 1 << 16
"""Bytes from which the format is told."""
TIME_UNITS = ("s", "ms", "us", "ns")


def open_recording(
    path: str | Path,
    size: Size | None = None,
    format: str | None = None,
    time_unit: str | None = None,
    stream: str | None = None,
    columns: str | None = None,
) -> Recording:
    """Open a recording; its format is found from its content unless `format` names a reader.

    `size` (width, height) in pixels overrides the header; `time_unit` ("s", "ms", "us", "ns") settles it
    for formats that do not say. `stream` names the stream of events to read where there are several
    (`Recording.streams`), `columns` says what the columns of a table are, for example "y,x,p,t": t, x, y and
    p (sec and nsec for a time in two parts), any other word for a column to pass over.

    Raises RecordingError where the file is missing, empty or of no known format, its header cannot be used or
    an argument has no meaning for it; UnsupportedError where it is known but not read; SettingsError for a
    `format` that does not exist.
    """
    from evplace.sources.readers._recording import Recording

    file = Path(path)
    if size is not None and (min(size) < 1 or max(size) > 1 << 16):
        raise RecordingError(f"the size {size[0]}x{size[1]} is none a sensor can have: give width and height")
    if time_unit is not None and time_unit not in TIME_UNITS:
        raise RecordingError(f"unknown time unit '{time_unit}': known are {', '.join(TIME_UNITS)}")
    hints = Hints(size, time_unit, stream, None if columns is None else _fields(columns))
    head = _head(file)
    name = _found(file, head, columns is not None) if format is None else format
    reader = families.load("readers", name)
    if columns is not None and not getattr(reader, "TABLE", False):
        raise RecordingError(f"{file} ({reader.ABOUT}) has no columns to tell apart: leave out `columns`")
    try:
        with families.blaming("readers", reader, OSError):
            source: Source = reader.read(file, hints)
    except UnsupportedError as error:
        where = "" if str(file) in str(error) else f"{file}: "
        raise UnsupportedError(f"{where}{error}") from error
    except OSError as error:
        raise RecordingError(f"cannot read {file} as {name}: {error.strerror or error}") from error
    source = checked_source(source, "readers", reader)
    if stream is not None and not source.streams:
        raise RecordingError(f"{file} ({reader.ABOUT}) has one stream, without a name: leave out `stream`")
    return Recording(file, name, source, size)


def _fields(columns: str) -> tuple[str, ...]:
    """The words of "t,x,y,p"; RecordingError where one of the four is missing or is there twice."""
    fields = tuple(word.strip().lower() for word in columns.split(","))
    times = [["t"], ["sec", "nsec"]]
    if any(fields.count(name) != 1 for name in "xyp") or sorted(
        name for name in fields if name in ("t", "sec", "nsec")
    ) not in map(sorted, times):
        raise RecordingError(
            f"columns '{columns}' must name t, x, y and p once each, or sec and nsec for t: as in t,x,y,p"
        )
    return fields


def __getattr__(name: str) -> Any:
    """Recording and Canvas, on first use: child processes that only decode start in half the time without."""
    if name not in ("Canvas", "Recording"):
        raise AttributeError(f"module 'evplace.sources.readers' has no attribute '{name}'")
    return getattr(importlib.import_module(f"{__name__}._{name.lower()}"), name)


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
    if is_stream(path):
        raise RecordingError(
            f"{path} is a pipe or a device: recordings are read from files, so save it first"
        )
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise RecordingError(f"cannot read {path}: {error.strerror}") from error
    if not head:
        raise RecordingError(f"{path} is empty: it holds no event")
    return head


def _found(path: Path, head: bytes, table: bool = False) -> str:
    """The name of the first reader that knows the content; text where only its columns had to be said."""
    faults: list[EvplaceError] = []
    for name in families.recognising("readers", lambda reader: reader.matches(path, head), faults):
        return name
    if table and not path.is_dir():
        return "text"
    if (what := foreign(path, head)) is not None:
        raise UnsupportedError(f"{path} is {what}")
    if (told := instead(path)) is not None:
        raise RecordingError(told)
    lines = b"\n" in head.strip()
    logs = families.recognising("tracks", lambda part: lines and part.recognises(head), [])
    for log in (name for name in logs if name != "csv"):  # which any text with a comma may be
        raise RecordingError(
            f"{path} is a log of positions ({log}), not a recording: give it as the `track` of one; evplace "
            "doctor examines it alone"
        )
    known, what = ", ".join(families.names("readers")), "the folder" if path.is_dir() else "the content"
    raise RecordingError(
        f"{path}: {what} is of no known recording format: known are {known}{families.besides(faults)}"
    )
