"""How fast the camera moved and turned, from its positions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.sources.tracks import Track

Floats = NDArray[np.float64]

BASE_US = 1_000_000
"""Speed is taken over about this long: over less, noise of a metre is more than the movement."""
REACH_US = 3_000_000
"""Not over longer than this: that is a gap."""
SHORTEST_M = 2.0
"""A turn is not taken from steps shorter than this: noise would turn them."""


def speeds(track: Track) -> tuple[NDArray[np.int64], Floats]:
    """(n,) times in microseconds and (n,) metres a second, between each fix and the first a second later."""
    t_us, xy = track.t_us, track.xy
    later = np.searchsorted(t_us, t_us + BASE_US)
    first = np.flatnonzero(later < len(t_us))
    later = later[first]
    span_us = t_us[later] - t_us[first]
    near = span_us <= REACH_US
    first, later, span_us = first[near], later[near], span_us[near]
    metres = np.hypot(*(xy[later] - xy[first]).T)
    return t_us[first] + span_us // 2, metres / span_us * 1e6


def speed_at(track: Track, t_us: Floats, known: tuple[NDArray[np.int64], Floats] | None = None) -> Floats:
    """Metres a second at the times `t_us` (m,), NaN beyond the track and in its gaps."""
    at_us, mps = known or speeds(track)
    if len(at_us) < 2:
        return np.full(len(t_us), np.nan)
    found = np.interp(t_us, at_us, mps, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(at_us, t_us), 1, len(at_us) - 1)
    found[at_us[after] - at_us[after - 1] > REACH_US] = np.nan
    return found


def turning_at(track: Track, t_us: Floats) -> Floats:
    """Radians a second at the times `t_us` (m,): between the way of the second before and of that after.

    0 where it is not known, or the way is too short to have a direction.
    """
    before, here, after = (_position(track, t_us + shift) for shift in (-BASE_US, 0, BASE_US))
    a, b = here - before, after - here
    angle = np.abs(np.arctan2(a[0] * b[1] - a[1] * b[0], a[0] * b[0] + a[1] * b[1])) / (BASE_US / 1e6)
    known = np.minimum(np.hypot(*a), np.hypot(*b)) >= SHORTEST_M  # False where NaN
    return np.where(known, angle, 0.0)


def _position(track: Track, t_us: Floats) -> Floats:
    """(2, m) metres, linear between fixes; NaN beyond the track and in its gaps."""
    at_us, xy = track.t_us, track.xy
    after = np.clip(np.searchsorted(at_us, t_us), 1, max(len(at_us) - 1, 1))
    far = np.diff(at_us, append=at_us[-1:])[after - 1] > REACH_US
    found = np.stack([np.interp(t_us, at_us, metres, left=np.nan, right=np.nan) for metres in xy.T])
    found[:, far] = np.nan
    return found
