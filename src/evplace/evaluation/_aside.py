"""Matches that all lie to one side of a drive's track: a track that drifts, or a clock that is off.

A matcher errs here and there; a receiver that drifts moves all that is matched by the same metres.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.evaluation._result import Result

WINDOW_S = 10.0
"""Matches of so many seconds are looked at together."""
FEWEST = 10
"""Matches without which nothing is said of a window."""
ALIKE_M = 10.0
"""Half of them lie no further than this from their middle: the ground of a map's cell."""
ASIDE_M = 25.0
"""By so much they lie aside, at least, all of them,"""
FAR_M = 250.0
"""and no further than this: no receiver drifts so far, a matcher may err so far."""
MOVED_M = 50.0
"""The drive and its matches move on by so much in a window: one that stands may be matched wrong."""


def aside(result: Result) -> str:
    """Where all matches of a result lie to one side of the drive's track, in a sentence; else nothing.

    In two windows after one another: a turn or a wrong match may look so in one.
    """
    if result.query_xy is None or result.item_xy is None or (result.t_us < 0).any():
        return ""
    used = result.answers.accepted & (result.answers.item >= 0)
    here, there = result.query_xy[used], result.item_xy[result.answers.item[used]]
    t_s = (result.t_us[used] - result.t_us[0]) / 1e6
    known = np.isfinite(here + there).all(axis=1)
    here, there, t_s = here[known], there[known], t_s[known]
    windows = (t_s // WINDOW_S).astype(np.int64)
    metres = {int(w): _metres(here[windows == w], there[windows == w]) for w in np.unique(windows)}
    metres = {w: m for w, m in metres.items() if m and any(metres.get(w + n, 0.0) for n in (-1, 1))}
    if not metres:
        return ""
    return (
        f"all matches lie {min(metres.values()):.0f} to {max(metres.values()):.0f} m to one side of the "
        f"drive's track for {len(metres) * WINDOW_S:.0f} s (first {min(metres) * WINDOW_S:.0f} s after its "
        "start): its positions or those of the map drift there, or a clock is off"
    )


def _metres(here: NDArray[np.float64], there: NDArray[np.float64]) -> float:
    """How far aside the positions `there` (n, 2) of the matches lie, all alike; 0 where they do not."""
    moved = min(float(np.hypot(*np.ptp(xy, axis=0))) for xy in (here, there))
    if len(here) < FEWEST or moved < MOVED_M:
        return 0.0
    away = there - here
    middle = np.median(away, axis=0)
    metres, spread = float(np.hypot(*middle)), float(np.median(np.hypot(*(away - middle).T)))
    return metres if spread <= ALIKE_M and ASIDE_M <= metres <= FAR_M else 0.0
