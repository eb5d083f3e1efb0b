"""What a reader file gives and gets: see the docstring of this package."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, ParamSpec

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import PartError, RecordingError
from evplace.core.events import Size

if TYPE_CHECKING:
    from evplace.sources.readers._canvas import Canvas

P = ParamSpec("P")


@dataclass(frozen=True, slots=True)
class Hints:
    """What the caller knows better than the file."""

    size: Size | None = None
    """(width, height) of the sensor; None: from the header, else from the data."""
    time_unit: str | None = None
    """"s", "ms", "us" or "ns"; None: from the file. Only formats without a unit of their own ask for it."""
    stream: str | None = None
    """Which of several streams of events is read; None: the first."""
    columns: tuple[str, ...] | None = None
    """What each column of a table is: t, x, y and p (for t also sec and nsec), other words for what is passed
    over; None: from its names and values. Only formats of columns ask for it."""


class Block(NamedTuple):
    """Events as decoded, not yet checked; the arrays are new, so that callers may keep them."""

    t_us: NDArray[np.int64]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    p: NDArray[np.bool_]
    untimed: int = 0
    """Events left out because no time had been given yet when they came."""
    back_us: int = 0
    """How far the furthest of the events that the checks left out as backwards lay back."""
    marked: int = 0
    """Events before these that were marked on a canvas in place of being stored."""


@dataclass(frozen=True, slots=True)
class Source:
    """An opened recording of one format."""

    size: Size | None
    """(width, height) that the file states, None where it states none."""
    blocks: Callable[[], Iterator[Block]]
    """Starts reading anew; raises DamagedRecordingError at a fault, after every good block."""
    notes: list[str] = field(default_factory=list)
    """Guesses that were made, one plain sentence each."""
    turn_us: int = 0
    """Microseconds after which the file's clock starts anew, which `blocks` makes good; 0: it never does."""
    zero_us: int = 0
    """The time at which a clock that turns read 0."""
    streams: Sequence[str] = ()
    """The names of all streams of events in the file, the one that is read first; empty where a format has
    but one, without a name."""
    onto: Callable[[Canvas], Iterator[Block]] | None = None
    """As `blocks`, for a reader that can mark events on a canvas in place of storing them."""
    apart: bool = False
    """Whether another process decodes; else blocks of a large file are decoded in a thread of their own."""


def ordered(path: Path, streams: Sequence[str], wanted: str | None) -> list[str]:
    """The names of the streams in a file, the wanted one first.

    `wanted` is a name, or a part of one name only ("left"). RecordingError where there is no such one.
    """
    if wanted is None:
        return list(streams)
    found = [name for name in streams if name == wanted] or [name for name in streams if wanted in name]
    if len(found) != 1 or not wanted:
        raise RecordingError(f"{path} has no stream '{wanted}': it has {', '.join(streams)}")
    return sorted(streams, key=lambda name: name != found[0])


def numbered(path: Path, cameras: Mapping[int, str], wanted: str | None) -> tuple[int, list[str]]:
    """The number of the stream to read, and the names of all, its own first.

    `cameras` is number -> name of the camera. A stream goes by its camera, where that has no other, else by
    its number; `wanted` may be either. RecordingError where there is no such one.
    """
    once = list(cameras.values())
    names = {n: name if name and once.count(name) == 1 else str(n) for n, name in cameras.items()}
    asked = next((name for n, name in names.items() if str(n) == wanted), wanted)
    streams = ordered(path, list(names.values()), asked)
    return next(n for n, name in names.items() if name == streams[0]), streams


SHOWN = 400
"""Characters of a name, or of a list of them, that are shown."""


def printable(name: str, most: int = SHOWN) -> str:
    """A name out of a file on one short line, without the codes that move a terminal's cursor."""
    shown = "".join(sign if sign.isprintable() else ascii(sign)[1:-1] for sign in name[: most + 1])
    return shown if len(shown) <= most else f"{shown[:most]}..."


GATHERED = 1 << 15
"""Events up to which small blocks are joined: larger ones would not stay in the processor's cache until they
are checked."""


def gathered(blocks: Iterator[Block]) -> Iterator[Block]:
    """Small blocks joined into blocks of at least GATHERED events; what is held comes out before a fault."""
    held: list[Block] = []
    count = 0
    try:
        for block in blocks:
            held.append(block)
            count += len(block.t_us) + block.marked
            if count >= GATHERED:
                yield joined(held)
                held, count = [], 0
    except Exception:
        if held:
            yield joined(held)
        raise
    if held:
        yield joined(held)


def joined(blocks: list[Block]) -> Block:
    """The blocks as one, in the order given."""
    if len(blocks) == 1:
        return blocks[0]
    return Block(
        np.concatenate([block.t_us for block in blocks]),
        np.concatenate([block.x for block in blocks]),
        np.concatenate([block.y for block in blocks]),
        np.concatenate([block.p for block in blocks]),
        sum(block.untimed for block in blocks),
        max(block.back_us for block in blocks),
        sum(block.marked for block in blocks),
    )


def checked_source(source: Source, family: str, part: object) -> Source:
    """The same, whose blocks raise PartError where `part`, which made it, breaks what it promises."""
    if not isinstance(source, Source):
        raise PartError(
            f"{families.described(family, part)} must open a Source, it gave {type(source).__name__}"
        )

    def checked(blocks: Callable[P, Iterator[Block]]) -> Callable[P, Iterator[Block]]:
        def checked_blocks(*arguments: P.args, **named: P.kwargs) -> Iterator[Block]:
            with families.blaming(family, part, OSError):
                for block in blocks(*arguments, **named):
                    _check_block(block, family, part)
                    yield block

        return checked_blocks

    onto = None if source.onto is None else checked(source.onto)
    return replace(source, blocks=checked(source.blocks), onto=onto)


def _check_block(block: object, family: str, part: object) -> None:
    """PartError where a block is not four arrays of one length and of the types that they must have."""
    if isinstance(block, Block) and _is_block(block):
        return
    found = type(block).__name__
    if isinstance(block, Block):
        found = ", ".join(f"{np.asarray(column).dtype} {np.shape(column)}" for column in block[:4])
    raise PartError(
        f"{families.described(family, part)} must give blocks of t_us int64, x uint16, y uint16 and p bool "
        f"of one length, it gave {found}"
    )


def _is_block(block: Block) -> bool:
    columns = [column for column in block[:4] if isinstance(column, np.ndarray)]
    types, shapes = [column.dtype for column in columns], {column.shape for column in columns}
    return types == [np.int64, np.uint16, np.uint16, np.bool_] and shapes == {(len(block.t_us),)}
