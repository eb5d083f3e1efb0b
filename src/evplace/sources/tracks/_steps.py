"""Steps from one fix to another about a second later, and how fast a log moves around each fix."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.sources.tracks._fixes import Fixes, Floats

MOVING_MPS = 2.0
"""Above this speed a vehicle moves for sure."""
SLACK_M = 10.0
"""Noise and the receiver's own corrections move a fix by up to this."""
BASE_US = 1_000_000
"""Speed is taken over about this long: over less, noise of a metre is more than the movement."""
NEAR_US = 3_000_000
"""Fixes further apart than this say nothing of the speed between them."""
AROUND = 5
"""Steps before and after by which a step is judged."""
FEWEST = 5
"""Steps without which nothing is said of a speed."""


def steps(fixes: Fixes) -> tuple[Floats, Floats]:
    """(N - 1,) metres and seconds from each fix to the next."""
    assert fixes.xy is not None
    return np.hypot(*np.diff(fixes.xy, axis=0).T), np.diff(fixes.t_us) / 1e6


def knots(fixes: Fixes) -> NDArray[np.int64]:
    """Fixes about a second apart, or further where the log has no others."""
    _, first = np.unique(fixes.t_us // BASE_US, return_index=True)
    return first


def velocities(fixes: Fixes, at: NDArray[np.int64]) -> Floats:
    """(len(at) - 1, 2) metres a second from each of the fixes `at` to the next; NaN where that is far."""
    assert fixes.xy is not None
    span_s = np.diff(fixes.t_us[at]) / 1e6
    near = (span_s > 0) & (span_s <= NEAR_US / 1e6)
    return np.asarray(np.diff(fixes.xy[at], axis=0) / np.where(near, span_s, np.nan)[:, None], np.float64)


def around(mps: Floats) -> Floats:
    """(N + 1, 2) the middle of the AROUND velocities (N, 2) before and after each fix; NaN where too few."""
    padded = np.pad(mps, ((AROUND, AROUND), (0, 0)), constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND, axis=0)
    found = np.full((len(mps) + 1, 2), np.nan)
    some = np.isfinite(windows).sum(axis=2).min(axis=1) >= FEWEST
    found[some] = np.nanmedian(windows[some], axis=2)
    return found
