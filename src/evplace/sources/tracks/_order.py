"""Fixes in the order of time, and clocks that were set while the log was written."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Bools, Fixes, Floats, Keep
from evplace.sources.tracks._steps import AROUND, MOVING_MPS, SLACK_M

UNIT_US = 1_000_000
"""Clocks are set by about whole seconds."""
SET_US = 900_000
"""What a clock is set by at least,"""
WRONG_M = 20.0
"""and by how much it then places something wrongly, at least: less is no more than the noise."""
NEAREST = 3
"""Steps before and after that say how a vehicle moved when the clock was set."""
REGULAR = 0.8
"""Share of the steps that are as long as usual without which nothing is said of the clock."""
FEW = 5
"""So many fixes of another clock are wrong ones, not a clock that was set."""


def in_order(fixes: Fixes, keep: Keep | None = None) -> Fixes:
    """The fixes, which have metres, sorted by time; those whose clock was set wrong are counted.

    A log is written in the order of time. Where two fixes are one usual step apart on the way but not by the
    clock, the clock was set. Where it was set back later, what lies between is wrong; where it stays so,
    `keep` chooses a side, or both. Raises TrackError without it: which side is right cannot be known.
    """
    clock_s = _clock_s(fixes)
    times, sizes = np.unique(clock_s, return_counts=True)
    if len(times) > 1 and keep != "both":
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


def _clock_s(fixes: Fixes) -> NDArray[np.int64]:
    """(N,) seconds by which the clock was set so far, in the order of the file."""
    assert fixes.xy is not None
    moved, steps_us = np.diff(fixes.xy, axis=0), np.diff(fixes.t_us)
    ahead = steps_us[steps_us > 0]
    usual_us = float(np.median(ahead)) if len(ahead) else 0.0
    regular = np.abs(steps_us - usual_us) <= usual_us / 2
    clock_us = np.zeros(len(fixes))
    if len(ahead) and np.mean(regular) >= REGULAR:
        fastest = float(np.percentile(np.hypot(*moved[regular].T), 95)) / usual_us
        off_us = steps_us - usual_us
        harmful = (np.abs(off_us) > max(SET_US, usual_us / 2)) & (np.abs(off_us) * fastest > WRONG_M)
        for n in np.flatnonzero(harmful).tolist():
            if _is_usual(moved, regular, n, usual_us, float(off_us[n])):
                clock_us[n + 1] = off_us[n]
    return np.round(np.cumsum(clock_us) / UNIT_US).astype(np.int64)


def _is_usual(moved: Floats, regular: Bools, n: int, usual_us: float, off_us: float) -> bool:
    """Whether a vehicle `moved` one usual step in step n, though faster than the clock then says."""
    first, last = max(n - AROUND, 0), n + 1 + AROUND
    before = moved[first:n][regular[first:n]][-NEAREST:]
    after = moved[n + 1 : last][regular[n + 1 : last]][:NEAREST]
    sides = [side for side in (before[::-1], after) if len(side)]
    if max(map(len, sides), default=0) < NEAREST:
        return False
    usual = np.mean([np.median(side, axis=0) for side in sides], axis=0)
    metres, slowest = float(np.hypot(*usual)), min(map(_slowest, sides))
    wrong_m = slowest * abs(off_us) / usual_us
    noise = min(max(metres / 2, SLACK_M / 2), wrong_m / 3)
    fast = slowest / usual_us * 1e6 > MOVING_MPS and wrong_m > SLACK_M
    return fast and float(np.hypot(*(moved[n] - usual))) <= noise


def _slowest(side: Floats) -> float:
    """The shortest of steps (S, 2), the nearest first, and of the one before that if they went on changing.

    A vehicle that stops, while its log pauses, was slowing down.
    """
    metres = np.hypot(*side.T)
    return float(min(np.median(metres), metres[0], 2 * metres[0] - metres[min(1, len(metres) - 1)]))


def _was_set(fixes: Fixes, clock_s: NDArray[np.int64]) -> str:
    at = int(np.flatnonzero(np.diff(clock_s))[-1]) + 1
    return (
        f"the log's clock was set by {clock_s[at] - clock_s[at - 1]:+d} s at "
        f"{fixes.show(int(fixes.line[at]))}: the times before or those after it are wrong, and a log cannot "
        "tell which: `keep=before` or `keep=after` takes one side, `keep=both` both as they are"
    )
