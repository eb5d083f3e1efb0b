"""Leaps: single steps that no vehicle makes, from one way to another.

A leap aside and one back enclose a stretch that lies aside. After a leap that is alone, the positions stay:
those before it had drifted, or those after it are off, and a log cannot tell which. Beside a gap, a receiver
that has just found, or is about to lose, its way stands off until it leaps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import TrackError
from evplace.sources.tracks._fixes import Bools, Fixes, Floats, Keep
from evplace.sources.tracks._steps import around, knots, velocities

SUDDEN_MPS = 20.0
"""No vehicle changes its velocity by so much from one second to the next, and back in the one after."""
BACK, BACK_M = 0.3, 15.0
"""A leap back differs from the one aside by this share of it, or by so much, at most."""
STRETCH_S = 60.0
"""A stretch between a leap aside and one back is no longer than this."""
SHORT_S = 30.0
"""A side of a leap that is no longer than this is the wrong one."""
DRIFT_S, DRIFTED_M = 30.0, 250.0
"""Before a leap, or after it, positions may have drifted for so long, and by no more than that."""
ALONE_M, ALONE = 60.0, 2.0
"""A leap alone is over so many metres and usual steps: shorter ones are a receiver's late corrections."""
MANY = 4
"""More leaps alone are noise, of which no side can be taken."""


@dataclass(frozen=True)
class Leaps:
    """The leaps of a log."""

    fixes: Fixes
    """(N,) in the order of time."""
    alone: NDArray[np.int64]
    """(L,) the fix after each leap that is alone; none where there are too many."""
    metres: Floats
    """(L,) how long each is."""
    aside: Bools
    """(N,) which fixes lie between a leap aside and one back."""

    @classmethod
    def of(cls, fixes: Fixes) -> Leaps:
        """The leaps of fixes in the order of time."""
        at = knots(fixes)
        mps = velocities(fixes, at)
        usual = around(mps)
        off = (mps - np.nan_to_num(usual[1:] + usual[:-1]) / 2) * (np.diff(fixes.t_us[at]) / 1e6)[:, None]
        after = [_after(fixes, at, n) for n in range(len(mps))]
        t_s, gaps = fixes.t_us[after] / 1e6, np.flatnonzero(np.isnan(mps[:, 0])).tolist()
        aside, alone = np.zeros(len(fixes), np.bool_), list[int]()
        for n in np.flatnonzero(_sudden(mps, usual)).tolist():
            near = [m for m in alone if t_s[n] - t_s[m] <= STRETCH_S and _is_back(off[m], off[n])]
            if near:
                aside[after[near[0]] : after[n]] = True
                del alone[alone.index(near[0]) :]
            else:
                alone.append(n)
        metres, step_m = np.hypot(*off.T), np.hypot(*mps[np.isfinite(mps[:, 0])].T)
        alone = [n for n in alone if metres[n] > max(ALONE_M, ALONE * np.median(step_m))]
        for n in alone.copy():
            near = [gap for gap in gaps if abs(t_s[gap] - t_s[n]) <= SHORT_S]
            if near:
                first, last = sorted((n, min(near, key=lambda gap: abs(gap - n))))
                aside[after[first] : after[last]] = True
                alone.remove(n)
        found = alone if len(alone) <= MANY else []
        return cls(fixes, np.array(after, np.int64)[found], metres[found], aside)

    def other_side(self, keep: Keep | None) -> Bools:
        """(N,) which fixes lie on the side of a leap for good that is not to be kept."""
        at, every = self._for_good(), np.arange(len(self.fixes))
        if keep not in ("before", "after") or not len(at):
            return np.zeros(len(every), np.bool_)
        return np.asarray(every >= at[0] if keep == "before" else every < at[-1], np.bool_)

    def wrong(self) -> Bools:
        """(N,) which fixes lie aside, on the short side of a leap, or near one, where they may have drifted.

        Raises TrackError where both sides of a leap are long.
        """
        self.ask(np.ones(len(self.fixes), np.bool_))
        found, since_s = self.aside.copy(), (self.fixes.t_us - self.fixes.t_us[0]) / 1e6
        for n, metres in zip(self.alone, self.metres, strict=True):
            found[:n] |= since_s[n] <= since_s[-1] / 2
            found[n:] |= since_s[n] > since_s[-1] / 2
            if metres < DRIFTED_M:
                found |= np.abs(since_s - since_s[n]) <= DRIFT_S
        return found

    def ask(self, lost: Bools) -> None:
        """TrackError for a leap whose sides are both long, where all fixes (N,) of one of them are lost."""
        for n, metres in zip(self.alone, self.metres, strict=True):
            if n in self._for_good() and (lost[:n].all() or lost[n:].all()):
                line = self.fixes.show(int(self.fixes.line[n]))
                raise TrackError(
                    f"the log leaps by {metres:,.0f} m at {line}, and not back: positions before or after it "
                    "are wrong, and a log cannot tell which: `keep=before` or `keep=after` takes one side"
                )

    def _for_good(self) -> NDArray[np.int64]:
        """The fix after each leap whose sides are both long, so that either may be the right one."""
        t_us = self.fixes.t_us
        side_us = np.minimum(t_us[self.alone] - t_us[0], t_us[-1] - t_us[self.alone])
        return np.asarray(self.alone[side_us > SHORT_S * 1e6], np.int64)


def _sudden(mps: Floats, usual: Floats) -> Bools:
    """(S,) which velocities (S, 2) differ too much from the one before, the one after and those around."""
    change = np.hypot(*np.diff(mps, axis=0).T)
    change = np.where(np.isfinite(change), change, np.inf)
    before, after = np.append(np.inf, change)[: len(mps)], np.append(change, np.inf)[-len(mps) :]
    away = np.hypot(*(mps - (usual[1:] + usual[:-1]) / 2).T)
    return np.asarray((np.minimum(before, after) > SUDDEN_MPS) & (away > SUDDEN_MPS), np.bool_)


def _is_back(forth: Floats, back: Floats) -> bool:
    """Whether one leap (2,) undoes another."""
    return bool(np.hypot(*(forth + back)) <= max(BACK_M, BACK * np.hypot(*forth)))


def _after(fixes: Fixes, at: NDArray[np.int64], n: int) -> int:
    """The fix after the longest step between the fixes at[n] and at[n + 1]."""
    assert fixes.xy is not None
    part = fixes.xy[at[n] : at[n + 1] + 1]
    return int(at[n]) + 1 + int(np.argmax(np.hypot(*np.diff(part, axis=0).T)))
