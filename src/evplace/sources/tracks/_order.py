"""Fixes in the order of time, and clocks that were set while the log was written."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Fixes
from evplace.sources.tracks._possible import AROUND, MOVING_MPS, SLACK_M

Keep = Literal["before", "after"]

UNIT_US = 1_000_000
"""Clocks are set by about whole seconds."""
SET_US = 2_500_000
"""What a clock is set by at least: one of the railway's logs (nordland, summer) slips by two seconds."""
REGULAR = 0.8
"""Share of the steps that are as long as usual without which nothing is said of the clock."""
FEW = 5
"""So many fixes of another clock are wrong ones, not a clock that was set."""


def in_order(fixes: Fixes, keep: Keep | None = None) -> Fixes:
    """The fixes, which have metres, sorted by time; those whose clock was set wrong are counted.

    A log is written in the order of time. Where two fixes are one usual step apart on the way but not by the
    clock, the clock was set. Where it was set back later, what lies between is wrong; where it stays so,
    `keep` chooses a side. Raises TrackError without it: which side is right cannot be known.
    """
    clock_s = np.round(_clock(fixes) / UNIT_US).astype(np.int64)
    times, sizes = np.unique(clock_s, return_counts=True)
    if len(times) > 1:
        first, last = clock_s[0], clock_s[-1]
        if keep is None and first != last and np.sort(sizes)[-2] > FEW:
            raise TrackError(_was_set(fixes, clock_s))
        usual = first if first == last else times[np.argmax(sizes)]
        right = {None: usual, "before": first, "after": last}[keep]
        fixes = fixes.without(clock_s != right, "of a clock that was set wrong")
    late = np.flatnonzero(np.diff(fixes.t_us) < 0)
    if not len(late):
        return fixes
    first_late = fixes.show(int(fixes.line[late[0] + 1]))
    fixes.notes.append(f"the log is not in the order of time: it was sorted (first {first_late})")
    return fixes[np.argsort(fixes.t_us, kind="stable")]


def _clock(fixes: Fixes) -> NDArray[np.float64]:
    """(N,) microseconds by which the clock was set so far, in the order of the file."""
    assert fixes.xy is not None
    moved, steps_us = np.diff(fixes.xy, axis=0), np.diff(fixes.t_us)
    sets = np.zeros(len(fixes))
    ahead = steps_us[steps_us > 0]
    if not len(ahead):
        return sets
    usual_us = float(np.median(ahead))
    regular = np.abs(steps_us - usual_us) <= usual_us / 2
    if np.mean(regular) < REGULAR:
        return sets
    for n in np.flatnonzero(np.abs(steps_us - usual_us) > max(SET_US, usual_us / 2)):
        around = slice(max(n - AROUND, 0), n + AROUND + 1)
        near = moved[around][regular[around]]
        off_us = steps_us[n] - usual_us
        if len(near) >= AROUND and _is_usual(moved[n], np.median(near, axis=0), usual_us, off_us):
            sets[n + 1] = off_us
    return np.cumsum(sets)


def _is_usual(moved: NDArray[np.float64], usual: NDArray[np.float64], usual_us: float, off_us: float) -> bool:
    """Whether a vehicle moved one usual step, and too fast for the clock to say anything else."""
    metres = float(np.hypot(*usual))
    noise = max(metres / 2, SLACK_M / 2)
    fast = metres / usual_us * 1e6 > MOVING_MPS and metres * abs(off_us) / usual_us > 2 * noise
    return fast and float(np.hypot(*(moved - usual))) <= noise


def _was_set(fixes: Fixes, clock_s: NDArray[np.int64]) -> str:
    at = int(np.flatnonzero(np.diff(clock_s))[-1]) + 1
    return (
        f"the log's clock was set by {clock_s[at] - clock_s[at - 1]:+d} s at "
        f"{fixes.show(int(fixes.line[at]))}: the times before or those after it are wrong, and a log cannot "
        "tell which: `keep=before` or `keep=after` takes one side"
    )
