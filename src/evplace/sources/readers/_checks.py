"""The checks that every event passes: inside the sensor, never earlier than the one before.

An event is dropped, and counted under its reason, when it is
- out_of_range: x or y lies outside the sensor;
- backwards: it is earlier than the last kept event;
- jump: it is more than JUMP_US ahead of the last kept event, and most of the next LOOK_AHEAD events are
  not: the clock leapt and came back. Where they stay ahead it is a gap in the recording, and all are kept.
  Before any event is kept, one is dropped when most of the next ones are JUMP_US earlier than it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.events import Size
from evplace.sources.readers._source import Block

JUMP_US = 1_000_000
"""A step forward by more than this is looked into: one that returns would cost everything until then."""
LOOK_AHEAD = 4096
"""Events that decide whether a step forward is a gap or a fault."""
REASONS = ("out_of_range", "backwards", "jump", "untimed")
"""Why events are dropped; the keys of `Recording.dropped`."""
NOTHING_YET = np.iinfo(np.int64).min
"""Stands for the last kept time where there is none."""


def checked(block: Block, size: Size, last_us: int, final: bool) -> tuple[Block, Block | None, list[int]]:
    """The good events of `block`, the undecided end of it (if any), and the drops in the order of REASONS.

    `last_us` is the time of the last kept event, or NOTHING_YET. Events near the end that cannot be judged
    before more are seen are handed back, unless the block is `final`. Where nothing is dropped the arrays
    are passed on, not copied.
    """
    t_us, x, y, p, untimed, *_ = block
    start = _first_doubt(t_us, x, y, size[0], size[1], last_us)
    if start == len(t_us):
        return block, None, [0, 0, 0, untimed]
    keep = np.ones(len(t_us), np.bool_)
    drops, back_us = np.zeros(3, np.int64), np.zeros(1, np.int64)
    decided = _sift(t_us, x, y, size[0], size[1], last_us, start, final, keep, drops, back_us)
    part = keep[:decided]
    kept = Block(
        _picked(t_us[:decided], part),
        _picked(x[:decided], part),
        _picked(y[:decided], part),
        _picked(p[:decided], part),
        back_us=int(back_us[0]),
    )
    rest = Block(t_us[decided:], x[decided:], y[decided:], p[decided:]) if decided < len(t_us) else None
    return kept, rest, [*drops.tolist(), untimed]


def _picked(field: NDArray[Any], keep: NDArray[np.bool_]) -> NDArray[Any]:
    return field if keep.all() else field[keep]


@njit(cache=True)
def inside(x: int, y: int, width: int, height: int) -> bool:
    """Whether an event lies on the sensor."""
    return x < width and y < height


@njit(cache=True)
def timely(t_us: int, last_us: int) -> bool:
    """Whether an event comes soon after the last one: then it is good without a look at those that follow."""
    return t_us >= last_us and t_us - JUMP_US <= last_us


@njit(cache=True)
def _first_doubt(
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    width: int,
    height: int,
    last_us: int,
) -> int:
    """Index of the first event that is not plainly good; the length where all are."""
    last = last_us
    for i in range(len(t_us)):
        if not (inside(x[i], y[i], width, height) and timely(t_us[i], last)):
            return i
        last = t_us[i]
    return len(t_us)


@njit(cache=True)
def _sift(
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    width: int,
    height: int,
    last_us: int,
    start: int,
    final: bool,
    keep: NDArray[np.bool_],
    drops: NDArray[np.int64],
    back_us: NDArray[np.int64],
) -> int:
    """Mark what is dropped in `keep`, count it in `drops`, note the largest step back in `back_us`;
    return how many events are decided.
    """
    last = t_us[start - 1] if start > 0 else last_us
    fault_until, fault_us = 0, last_us  # up to here steps forward, to about this time, are known to be faults
    for i in range(start, len(t_us)):
        t = t_us[i]
        if x[i] >= width or y[i] >= height:
            keep[i] = False
            drops[0] += 1
            continue
        if last != NOTHING_YET and t < last:
            keep[i] = False
            drops[1] += 1
            back_us[0] = max(back_us[0], last - t)
            continue
        if last == NOTHING_YET or t - JUMP_US > last:
            if i >= fault_until:
                end = min(i + 1 + LOOK_AHEAD, len(t_us))
                if end < i + 1 + LOOK_AHEAD and not final:
                    return i
                if _comes_back(t_us[i + 1 : end], t, last):
                    fault_until, fault_us = end, t
            if i < fault_until and (last != NOTHING_YET or t >= fault_us - JUMP_US // 2):
                keep[i] = False
                drops[2] += 1
                continue
        last = t
    return len(t_us)


@njit(cache=True)
def _comes_back(following: NDArray[np.int64], t: int, last: int) -> bool:
    """Whether most of the following events belong to the time before the step to `t`."""
    back = 0
    ahead = 0
    for other in following:
        if other >= t - JUMP_US // 2:
            ahead += 1
        elif last == NOTHING_YET:
            back += other < t - JUMP_US
        else:
            back += other >= last
    return back > ahead
