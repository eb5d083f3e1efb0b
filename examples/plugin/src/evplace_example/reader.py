"""Diaries of events: `event diary 240x180`, then a line like `at 1250 us, 17 4 brighter` for each event."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.sources.readers import Block, Hints, Source

ABOUT = "Diaries of events: a line of text for each event (an example)."
MARK = b"event diary "
LINES = 1 << 15
"""Events in a block."""
_SIZE = re.compile(rb"event diary (\d{1,5})x(\d{1,5})\n")
_LINE = re.compile(rb"at (\d{1,15}) us, (\d{1,5}) (\d{1,5}) (brighter|darker)\n")


def matches(path: Path, head: bytes) -> bool:  # noqa: ARG001 - the content tells, not the name
    """See evplace.sources.readers."""
    return head.startswith(MARK)


def read(path: Path, hints: Hints) -> Source:  # noqa: ARG001 - a diary says all itself
    """See evplace.sources.readers."""
    with path.open("rb") as file:
        found = _SIZE.fullmatch(file.readline(80))
    if found is None:
        raise RecordingError(f"{path} is no event diary: its first line does not give the sensor's size")
    return Source((int(found[1]), int(found[2])), lambda: _blocks(path))


def _blocks(path: Path) -> Iterator[Block]:
    with path.open("rb") as file:
        file.readline(80)
        number = 1
        while lines := list(islice(iter(lambda: file.readline(80), b""), LINES)):
            found = [_LINE.fullmatch(line) for line in lines]
            good = found.index(None) if None in found else len(found)
            yield _block([line.groups() for line in found[:good] if line is not None])
            if good < len(lines):
                raise DamagedRecordingError(f"{path} is damaged or cut off at line {number + good + 1}")
            number += good


def _block(rows: list[tuple[bytes, ...]]) -> Block:
    times, columns, lines, signs = zip(*rows, strict=True) if rows else ((), (), (), ())
    x, y = np.array(columns, np.int64), np.array(lines, np.int64)
    return Block(
        np.array(times, np.int64),
        np.minimum(x, 65_535).astype(np.uint16),
        np.minimum(y, 65_535).astype(np.uint16),
        np.array([sign == b"brighter" for sign in signs], np.bool_),
    )
