"""Fixes in the order of time, and clocks that were set while the log was written."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Fixes, Keep
from evplace.sources.tracks._steps import AROUND, MOVING_MPS, SLACK_M

UNIT_US = 1_000_000
"""Clocks are set by about whole seconds."""
SET_US = 900_000
"""What a clock is set by at least,"""
WRONG_M = 25.0
"""and by how much it then places what lies on one side of it wrongly, at least."""
SLIP_US = 2_500_000
"""Without a speed of the log's own, less is only told: railways' logs slip by two seconds."""
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
    clock_s = np.round(_clock(fixes, _sets(fixes)) / UNIT_US).astype(np.int64)
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


def _clock(fixes: Fixes, sets: dict[int, float]) -> NDArray[np.float64]:
    """(N,) microseconds by which the clock was set so far, in the order of the file; small slips are told."""
    clock = np.zeros(len(fixes))
    for n, off_us in sets.items():
        if abs(off_us) > SLIP_US or np.isfinite(fixes.speed).any():
            clock[n] = off_us
        else:
            fixes.notes.append(
                f"the log's clock slips by {off_us / UNIT_US:+.0f} s at {fixes.show(int(fixes.line[n]))}: "
                "positions before or after it are late or early by as much, and it is not known which"
            )
    return np.cumsum(clock)


def _sets(fixes: Fixes) -> dict[int, float]:
    """The fixes at which the clock was set, and by how many microseconds, in the order of the file."""
    assert fixes.xy is not None
    moved, steps_us = np.diff(fixes.xy, axis=0), np.diff(fixes.t_us)
    ahead = steps_us[steps_us > 0]
    usual_us = float(np.median(ahead)) if len(ahead) else 0.0
    regular = np.abs(steps_us - usual_us) <= usual_us / 2
    if not len(ahead) or np.mean(regular) < REGULAR:
        return {}
    sets = {}
    for n in np.flatnonzero(np.abs(steps_us - usual_us) > max(SET_US, usual_us / 2)).tolist():
        around = slice(max(n - AROUND, 0), n + AROUND + 1)
        near = moved[around][regular[around]]
        off_us = float(steps_us[n] - usual_us)
        if len(near) >= AROUND and _is_usual(moved[n], np.median(near, axis=0), usual_us, off_us):
            sets[n + 1] = off_us
    return sets


def _is_usual(moved: NDArray[np.float64], usual: NDArray[np.float64], usual_us: float, off_us: float) -> bool:
    """Whether a vehicle moved one usual step, and too fast for the clock to say anything else."""
    metres = float(np.hypot(*usual))
    noise = max(metres / 2, SLACK_M / 2)
    wrong_m = metres * abs(off_us) / usual_us
    large = wrong_m > 2 * noise if abs(off_us) > SLIP_US else wrong_m > WRONG_M
    fast = metres / usual_us * 1e6 > MOVING_MPS and large
    return fast and float(np.hypot(*(moved - usual))) <= noise


def _was_set(fixes: Fixes, clock_s: NDArray[np.int64]) -> str:
    at = int(np.flatnonzero(np.diff(clock_s))[-1]) + 1
    return (
        f"the log's clock was set by {clock_s[at] - clock_s[at - 1]:+d} s at "
        f"{fixes.show(int(fixes.line[at]))}: the times before or those after it are wrong, and a log cannot "
        "tell which: `keep=before` or `keep=after` takes one side"
    )
