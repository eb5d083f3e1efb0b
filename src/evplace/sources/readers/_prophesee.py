"""What Prophesee's files share: the text header, and words read in blocks."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike, NDArray

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Size
from evplace.sources.readers._source import printable

_LINE = re.compile(rb"%[^\n]*\n")
_PLAIN = re.compile(rb"%[^\x00-\x08\x0e-\x1f\x7f\n]*\n")
"""A line that may be text of any encoding: data that starts like a header seldom goes on like one."""
_END = re.compile(rb"%[ \t]*end[ \t]*\r?\n")

_DIGITS = 9
"""Digits that are read of a number which may have any number of them."""


class Header(NamedTuple):
    """The text lines that start a file."""

    fields: dict[str, str]
    """First word of each line, in small letters -> the rest of the line."""
    length: int
    """Bytes to the first that is data."""


def header(head: bytes) -> Header:
    """The header in the first bytes of a file: lines that start with a percent sign, up to `% end`.

    They hold any bytes; where the end is not marked, it is the first line that cannot be text.
    """
    lines, position = _lines(head, _LINE)
    if not lines or _END.fullmatch(lines[-1]) is None:
        lines, position = _lines(head, _PLAIN)
    fields: dict[str, str] = {}
    for line in lines:
        words = line.decode("utf-8", "replace")[1:].split(maxsplit=1)
        if words:
            fields[words[0].lower()] = printable(words[1].strip(), len(head)) if len(words) > 1 else ""
    return Header(fields, position)


def _lines(head: bytes, kind: re.Pattern[bytes]) -> tuple[list[bytes], int]:
    """The lines of that kind up to `% end`, and the byte after them."""
    lines: list[bytes] = []
    position = 0
    while (line := kind.match(head, position)) is not None:
        position = line.end()
        lines.append(line.group())
        if _END.fullmatch(lines[-1]) is not None:
            break
    return lines, position


def evt_version(fields: dict[str, str]) -> str:
    """The encoding that a raw header states, such as "2.0" or "3"; empty where it states none."""
    if "evt" in fields:
        return fields["evt"]
    stated = re.match(r"EVT([\d.]+)", fields.get("format", ""))
    return stated.group(1) if stated else ""


def stated_size(fields: dict[str, str]) -> Size | None:
    """(width, height) from whichever of the usual lines there is."""
    pairs = (
        re.search(r"(?=.*\bwidth=(\d+)).*\bheight=(\d+)", fields.get("format", "")),
        re.search(r"(\d+)\s*x\s*(\d+)", fields.get("geometry", "")),
        re.search(r"^(\d+) (\d+)$", f"{fields.get('width', '')} {fields.get('height', '')}"),
    )
    found = next((pair for pair in pairs if pair), None)
    if found is None:
        return None
    width, height = (int(side[:_DIGITS]) for side in found.groups())
    if not (0 < width <= 1 << 16 and 0 < height <= 1 << 16):
        raise RecordingError(f"the header states a sensor of {width}x{height} pixels: give the `size`")
    return width, height


def start_us(fields: dict[str, str]) -> int:
    """The time in microseconds that all others count from, where the header states one (faery writes it)."""
    stated = fields.get("t0", "0")
    return int(stated) if re.fullmatch(r"\d{1,18}", stated) else 0


def words(path: Path, offset: int, kind: DTypeLike, count: int) -> Iterator[NDArray[Any]]:
    """The data from byte `offset` on as words of type `kind`, at most `count` at a time.

    Raises DamagedRecordingError, after the last whole word, where the file ends inside a word.
    """
    width = np.dtype(kind).itemsize
    with path.open("rb") as file:
        file.seek(offset)
        while data := file.read(count * width):
            whole = len(data) // width
            if whole:
                yield np.frombuffer(data, kind, whole)
            if len(data) % width:
                raise DamagedRecordingError(f"{path} is cut off inside a word, at byte {file.tell()}")


def head_of(path: Path, length: int = 1 << 16) -> bytes:
    """The first bytes of a file."""
    with path.open("rb") as file:
        return file.read(length)
