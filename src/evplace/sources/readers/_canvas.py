"""Where decoded events go: into arrays, or, as long as all is plainly good, straight onto a canvas.

A reader only decodes: it hands every event to `put`, whatever becomes of it. `put` asks what `_checks` asks
of an event that is plainly good. The first that is not, or lies after the open window, closes the canvas:
it and all that follow are stored, for `Recording` to check as ever, which opens the canvas again.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.sources.readers._checks import inside, timely
from evplace.sources.readers._source import Block

Loop = TypeVar("Loop", bound=Callable[..., Any])

STORED, MARKED, MASKED, LAST, UNTIL, MARKED_US = range(6)
"""The places of a tally: events stored and marked since the last block, masked ones since they were asked
for; in microseconds the last event's time, that up to which the canvas is open, and that of the last marked
event when it was closed."""
CLOSED = np.iinfo(np.int64).min
"""The first two of these times where a canvas is closed: no event has it."""
GRID = 5
"""The place of the grid in a sink."""
UNCOUNTED: dict[str, Any] = {"_nrt": False}
"""Loops that decode make no arrays, so that numba need not count references to those in a sink, event by
event, which would take three quarters of the time."""


class Sink(NamedTuple):
    """What a decoding loop needs: the arrays of a block, which are new, and of a canvas, if there is one."""

    t_us: NDArray[np.int64]
    x: NDArray[np.uint16]
    y: NDArray[np.uint16]
    p: NDArray[np.bool_]
    tally: NDArray[np.int64]
    grid: NDArray[Any] | None = None
    mask: NDArray[np.bool_] | None = None

    def block(self, untimed: int = 0) -> Block:
        """What was stored, and how many events were marked before that."""
        stored, marked = self.tally[: MARKED + 1].tolist()
        return Block(
            self.t_us[:stored], self.x[:stored], self.y[:stored], self.p[:stored], untimed, marked=marked
        )


class Canvas:
    """A grid on which readers mark events of the window that is open."""

    def __init__(self, grid: NDArray[Any], mask: NDArray[np.bool_] | None = None) -> None:
        """`grid` (H, W) is int8, where -1 is set, or int32, where events are counted.

        Events at the pixels where `mask` (H, W) is True are not marked.
        """
        self.end_us: int | None = None
        """The last microsecond of the window that is open; None before the first."""
        self._grid, self._mask = grid, mask
        self._tally = np.zeros(MARKED_US + 1, np.int64)
        self._marked = 0
        self.close()

    def sink(self, most: int) -> Sink:
        """Room for the next events, at most so many."""
        self._marked += int(self._tally[MARKED])
        self._tally[[STORED, MARKED]] = 0
        return Sink(*_columns(most), self._tally, self._grid, self._mask)

    def open(self, last_us: int) -> None:
        """Have the next events marked; `last_us` is the time of the last that was kept."""
        if self.end_us is not None and last_us <= self.end_us:
            self._tally[LAST], self._tally[UNTIL] = last_us, self.end_us

    def close(self) -> None:
        """Have all events stored."""
        _close(self._tally)

    @property
    def last_us(self) -> int:
        """The time of the last event that was marked."""
        return int(self._tally[MARKED_US if self._tally[UNTIL] == CLOSED else LAST])

    def taken(self) -> tuple[int, int]:
        """How many events were marked since this was last asked, and how many were masked."""
        masked, unasked = int(self._tally[MASKED]), int(self._tally[MARKED])
        marked = self._marked + unasked - masked
        self._marked, self._tally[MASKED] = -unasked, 0
        return marked, masked


def sink_of(canvas: Canvas | None, most: int) -> Sink:
    """Room for the next events, at most so many; all are stored where there is no canvas."""
    return Sink(*_columns(most), np.zeros(MARKED + 1, np.int64)) if canvas is None else canvas.sink(most)


def _columns(
    most: int,
) -> tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.bool_]]:
    return (
        np.empty(most, np.int64),
        np.empty(most, np.uint16),
        np.empty(most, np.uint16),
        np.empty(most, np.bool_),
    )


def compiled(loop: Loop) -> Loop:
    """Decorator of every loop that decodes into a sink."""
    return cast(Loop, njit(before=_overloads, cache=True, nogil=True, **UNCOUNTED)(loop))


def put(sink: Sink, t_us: Any, x: Any, y: Any, p: Any) -> None:
    """Mark an event, or store it: within compiled loops."""


@functools.cache
def _overloads() -> None:
    """Say what `put` and `_masked` are in compiled loops.

    It depends on the types of a sink, so that it is decided once a loop, not once an event.
    """
    from numba import types
    from numba.extending import overload

    @overload(put, jit_options=UNCOUNTED)
    def _put(sink: Any, t_us: Any, x: Any, y: Any, p: Any) -> Any:
        return _store if isinstance(sink[GRID], types.NoneType) else _mark_or_store

    @overload(_masked, jit_options=UNCOUNTED)
    def _masked_of(mask: Any, row: Any, column: Any) -> Any:
        return _never if isinstance(mask, types.NoneType) else _looked_up


def _store(sink: Any, t_us: Any, x: Any, y: Any, p: Any) -> None:
    at = sink.tally[STORED]
    sink.t_us[at], sink.x[at], sink.y[at], sink.p[at] = t_us, x, y, p
    sink.tally[STORED] = at + 1


def _mark_or_store(sink: Any, t_us: Any, x: Any, y: Any, p: Any) -> None:
    tally, grid = sink.tally, sink.grid
    column, row = np.uint16(x), np.uint16(y)  # as a block holds them: what is below 0 lies outside
    if (t_us != tally[LAST] and not _goes_on(tally, t_us)) or not inside(
        column, row, grid.shape[1], grid.shape[0]
    ):
        _close(tally)
        _stored(sink, t_us, x, y, p)
    else:
        tally[MARKED] += 1
        if _masked(sink.mask, row, column):
            tally[MASKED] += 1
        elif grid.itemsize == 1:
            grid[row, column] = -1
        else:
            grid[row, column] += 1


_stored = njit(**UNCOUNTED)(_store)


@njit(**UNCOUNTED)
def _goes_on(tally: NDArray[np.int64], t_us: int) -> bool:
    """Whether the window that is open goes on to a time, which is then the last."""
    if t_us > tally[UNTIL] or not timely(t_us, tally[LAST]):
        return False
    tally[LAST] = t_us
    return True


@njit(cache=True, **UNCOUNTED)
def _close(tally: NDArray[np.int64]) -> None:
    """No time equals, or goes on from, that of a closed canvas."""
    if tally[UNTIL] != CLOSED:
        tally[MARKED_US] = tally[LAST]
        tally[LAST] = tally[UNTIL] = CLOSED


def _masked(mask: Any, row: Any, column: Any) -> Any:
    """Whether a pixel is masked."""


def _never(mask: Any, row: Any, column: Any) -> Any:
    return False


def _looked_up(mask: Any, row: Any, column: Any) -> Any:
    return mask[row, column]
