"""Which fixes can be true: a vehicle goes no faster than so, and goes as its log says that it does.

Wrong fixes are found by what stands around them: where a log jumps away and back, the stretch between is
left out, whichever it is, so that as many fixes as can be remain. What leaves no trace in a log, a slow
drift of the positions where it has no speed and course of its own, cannot be found.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import TrackError
from evplace.sources._times import DATED_US
from evplace.sources.tracks._fixes import Bools, Fixes, Floats, Keep
from evplace.sources.tracks._leaps import Leaps
from evplace.sources.tracks._steps import (
    AROUND,
    BASE_US,
    FEWEST,
    MOVING_MPS,
    NEAR_US,
    SLACK_M,
    around,
    knots,
    steps,
    velocities,
)

WAY_M = 5 * SLACK_M
"""A way against which noise is nothing."""
HELD_M = 5.0
"""Positions of a receiver that stands differ by less, by their noise."""
OWN_SLACK_M = 25.0
"""By so much positions may differ from where the log's own speed and course lead from the one before."""
STEPS_SLACK_M = 50.0
"""The same, where the log has no speed and the steps around stand for it."""
DRIFT_MPS = 1.0
"""And by so much more for each second between them."""
DRIFT_M = 15.0
"""By so much positions may lie off the way that those before have kept to."""
WANDER_MPS, WANDER = 0.2, 0.01
"""And that way wanders by so much a second, and by so much a metre."""
FAR_S = 60.0
"""Nor do speeds on the way say where a fix further away than this can be."""
FROZEN = 0.2
"""A step this much shorter than the log's own speed makes it is none."""
UNITS = {"m/s": 1.0, "knots": 1852 / 3600, "km/h": 1 / 3.6, "miles/h": 0.44704}
"""Metres a second in one of each unit of speed."""
AGREES = 1.25
"""How much the log's own speed may differ from that of its positions, as a factor."""
_WORK = 100_000_000
"""Pairs of fixes that are looked at, at most."""


def possible(fixes: Fixes, max_speed_mps: float, keep: Keep | None = None, zone: int = 0) -> Fixes:
    """The fixes, in the order of time and in metres of a UTM zone, that can be true; the others are counted.

    Raises TrackError where fewer than half can be, or where the log leaps for good and `keep` does not say
    which side of that is right.
    """
    speed = own_speed(fixes)
    frozen = _frozen(fixes, speed) | _held(fixes, max_speed_mps)
    fixes, speed = fixes.without(frozen, "repeated while moving"), speed[~frozen]
    other = Leaps.of(fixes).other_side(keep)
    fixes, speed = fixes.without(other, "of the other side of a leap"), speed[~other]
    own = _own_velocity(fixes, speed, zone)
    if own is None:
        kept, drift_shows = _by_leaps(fixes, speed, max_speed_mps), False
    else:
        kept, drift_shows = _by_way(fixes, own, max_speed_mps)
    few = 2 * kept.sum() < len(np.unique(fixes.t_us))
    if few or _usual_mps(fixes[kept]) > max_speed_mps:
        raise TrackError(_too_fast(fixes, max_speed_mps))
    has_speed = bool(np.isfinite(speed).any())
    by = "the log's own speed" if has_speed else "the movement around"
    good = _split(fixes, kept, max_speed_mps, f"against {by}")
    against = "speed and course" if drift_shows else "speed" if has_speed else ""
    return replace(good, held_against=against)


def _by_way(fixes: Fixes, velocity: Floats, max_speed_mps: float) -> tuple[Bools, bool]:
    """(N,) the fixes that go together where the log's own speed and course say how it moved.

    And whether a slow drift would show.
    """
    way = Way.of(fixes, velocity, OWN_SLACK_M)
    loose = _chain(fixes, way, max_speed_mps)
    if np.median(np.hypot(*velocity[np.isfinite(velocity[:, 0])].T)) < MOVING_MPS:
        return loose, False  # on foot, where noise is more than the movement
    kept = _chain(fixes, way, max_speed_mps, DRIFT_M)
    if 2 * kept.sum() >= loose.sum():
        Leaps.of(fixes).ask(~kept)
        return kept, True
    fixes.notes.append(
        "the positions keep drifting away from where the log's own speed and course lead: one of the two is "
        "wrong, and a log cannot tell which, so that the drift is not checked"
    )
    return loose, False


def _by_leaps(fixes: Fixes, speed: Floats, max_speed_mps: float) -> Bools:
    """(N,) the fixes that go together where only the movement around them says how it goes on."""
    kept = ~Leaps.of(fixes).wrong()
    if not kept.any():
        return kept
    rest, speed = fixes[kept], speed[kept]
    own = bool(np.isfinite(speed).any())
    way = Way.of(rest, _along(rest, speed) if own else _around(rest), OWN_SLACK_M if own else STEPS_SLACK_M)
    kept[kept] = _chain(rest, way, max_speed_mps)
    return kept


def own_speed(fixes: Fixes) -> Floats:
    """(N,) the log's own speed in m/s, in the unit that fits its positions; NaN where unknown or unfit."""
    at = knots(fixes)
    step_m, step_s = steps(fixes[at])
    said = np.diff(_summed(_between(fixes.speed, np.diff(fixes.t_us) / 1e6))[at])
    used = (step_s <= NEAR_US / 1e6) & (step_m > 0) & (said > MOVING_MPS * step_s)
    nothing = np.full(len(fixes), np.nan)
    if used.sum() < FEWEST:
        return nothing
    ratio = float(np.median(step_m[used] / said[used]))
    unit = min(UNITS, key=lambda name: abs(np.log(ratio / UNITS[name])))
    if AGREES > ratio > 1 / AGREES:
        unit = "m/s"
    if not 1 / AGREES < ratio / UNITS[unit] < AGREES:
        fixes.notes.append(
            f"the log's own speeds do not fit its positions ({ratio:.2g} m/s each): they are not used"
        )
        return nothing
    return fixes.speed * UNITS[unit]


def _between(values: Floats, span_s: Floats) -> Floats:
    """(N - 1, ...) what values (N, ...) a second make of each step; 0 where it is not known."""
    made = (values[1:] + values[:-1]) / 2 * (span_s if values.ndim == 1 else span_s[:, None])
    return np.where(np.isfinite(made), made, 0.0)


def _summed(steps: NDArray[Any]) -> NDArray[Any]:
    """(N, ...) sums of the steps (N - 1, ...) before each fix."""
    return np.concatenate([np.zeros_like(steps, shape=(1, *steps.shape[1:])), np.cumsum(steps, axis=0)])


def _frozen(fixes: Fixes, speed: Floats) -> Bools:
    """(N,) which fixes are where the receiver was a second before, although the log's own speed says no."""
    assert fixes.xy is not None
    before = np.searchsorted(fixes.t_us, fixes.t_us - int(0.9 * BASE_US), "right") - 1
    known = before >= 0
    before = np.maximum(before, 0)
    span_s = (fixes.t_us - fixes.t_us[before]) / 1e6
    slowest = np.minimum(speed[1:], speed[:-1]) * np.diff(fixes.t_us) / 1e6
    said = _summed(np.where(np.isfinite(slowest), slowest, 0.0))
    way = said - said[before]
    metres = np.hypot(*(fixes.xy - fixes.xy[before]).T)
    near = known & (span_s <= NEAR_US / 1e6)
    return np.asarray(near & (way > MOVING_MPS * span_s) & (metres < FROZEN * way), np.bool_)


def _held(fixes: Fixes, max_speed_mps: float) -> Bools:
    """(N,) which fixes stand still and are followed by a leap to where moving on would have led."""
    at = knots(fixes)
    xy, t_s = fixes[at].xy, fixes.t_us[at] / 1e6
    assert xy is not None
    step_m, step_s = steps(fixes[at])
    held, mps = np.zeros(len(fixes), np.bool_), step_m / np.maximum(step_s, 1e-6)
    for first, last in _standing(xy):
        around = np.concatenate([mps[max(first - AROUND, 0) : first], mps[last + 1 : last + 1 + AROUND]])
        usual = float(np.median(around)) if len(around) >= FEWEST else 0.0
        through = float(np.hypot(*(xy[last + 1] - xy[first]))) / (t_s[last + 1] - t_s[first])
        leaps = mps[last] > min(1.5 * usual + SLACK_M, max_speed_mps)
        if usual > MOVING_MPS and leaps and usual / 3 < through < 2 * usual + SLACK_M:
            held[at[first] + 1 : at[last + 1]] = True
    return held


def _standing(xy: Floats) -> Iterator[tuple[int, int]]:
    """First and last of positions (N, 2) that lie together and are followed by one elsewhere."""
    first = 0
    for n in range(1, len(xy)):
        if np.hypot(*(xy[n] - xy[first])) > HELD_M:
            if n - 1 > first:
                yield first, n - 1
            first = n


class Way(NamedTuple):
    """How a vehicle must have moved by the log's own speed and course, else by the steps around each fix."""

    xy: Floats
    """(N, 2) metres since the first fix."""
    metres: Floats
    """(N,) the length of the way since the first fix."""
    unknown: NDArray[np.int64]
    """(N,) steps before each fix of which nothing is known."""
    slack_m: float
    """By how much positions may differ from it."""

    @classmethod
    def of(cls, fixes: Fixes, velocity: Floats, slack_m: float) -> Way:
        """By the velocity (N, 2) at each fix, in metres a second."""
        step_s = np.diff(fixes.t_us) / 1e6
        known = (step_s <= NEAR_US / 1e6) & np.isfinite(velocity[1:] + velocity[:-1]).all(axis=1)
        return cls(
            _summed(_between(velocity, step_s)),
            _summed(_between(np.hypot(*velocity.T), step_s)),
            _summed((~known).astype(np.int64)),
            slack_m,
        )


def _own_velocity(fixes: Fixes, speed: Floats, zone: int) -> Floats | None:
    """(N, 2) metres a second by the log's own speed and course; None where these do not fit its positions."""
    north_deg = _north_deg(fixes, zone)
    course = np.deg2rad(np.where(speed > MOVING_MPS, fixes.heading_deg - north_deg, 0.0))
    own: Floats = speed[:, None] * np.column_stack([np.sin(course), np.cos(course)])
    return own if _fits(own, fixes) else None


def _north_deg(fixes: Fixes, zone: int) -> Floats:
    """(N,) degrees by which the north of a UTM zone lies clockwise from the true one."""
    if not zone:
        return np.zeros(len(fixes))
    east: Floats = fixes.longitude - (6 * zone - 183)
    return np.asarray(east * np.sin(np.deg2rad(fixes.latitude)), np.float64)


def _along(fixes: Fixes, speed: Floats) -> Floats:
    """(N, 2) metres a second at the log's own speed along the steps around each fix."""
    around = _around(fixes)
    return np.asarray(around / np.maximum(np.hypot(*around.T), 1e-9)[:, None] * speed[:, None], np.float64)


def _fits(own: Floats, fixes: Fixes) -> bool:
    """Whether the log's own velocities (N, 2) point as its positions move: most within 45 degrees."""
    assert fixes.xy is not None
    at = knots(fixes)
    moved = np.diff(fixes.xy[at], axis=0)
    fast = np.hypot(*own[at[1:]].T) * np.hypot(*moved.T)
    used = fast > MOVING_MPS**2  # False where NaN
    along = (own[at[1:]][used] * moved[used]).sum(axis=1) / fast[used]
    return len(along) >= FEWEST and bool(np.median(along) > np.cos(np.pi / 4))


def _around(fixes: Fixes) -> Floats:
    """(N, 2) metres a second: the middle of the AROUND seconds before and after each fix; NaN without any."""
    at = knots(fixes)
    found = around(velocities(fixes, at))
    return np.column_stack([np.interp(fixes.t_us, fixes.t_us[at], found[:, n]) for n in (0, 1)])


def _chain(fixes: Fixes, way: Way, max_speed_mps: float, drift_m: float = np.inf) -> Bools:
    """(N,) the most fixes of which each can be reached from the one before; of equals, the shortest way.

    `drift_m` is by how much they may lie off the way that those before have kept to.
    """
    assert fixes.xy is not None
    look = int(min(len(fixes), max(200, _WORK // max(len(fixes), 1))))
    kept: Bools = _longest(
        fixes.t_us,
        fixes.xy,
        way.xy,
        way.metres,
        way.unknown,
        way.slack_m,
        drift_m,
        float(max_speed_mps),
        look,
    )
    return kept


def _split(fixes: Fixes, kept: Bools, max_speed_mps: float, otherwise: str) -> Fixes:
    """The kept fixes; the others are counted by what is wrong with them."""
    assert fixes.xy is not None
    at = np.flatnonzero(kept)
    before = at[np.clip(np.searchsorted(at, np.arange(len(fixes)), "right") - 1, 0, None)]
    after = at[np.clip(np.searchsorted(at, np.arange(len(fixes))), 0, len(at) - 1)]
    twice = ~kept & ((fixes.t_us == fixes.t_us[before]) | (fixes.t_us == fixes.t_us[after]))
    far = np.zeros(len(fixes), np.bool_)
    for other in (before, after):
        span_s = np.abs(fixes.t_us - fixes.t_us[other]) / 1e6
        far |= np.hypot(*(fixes.xy - fixes.xy[other]).T) > max_speed_mps * span_s + SLACK_M
    reasons = {
        "duplicate time": twice,
        f"faster than {max_speed_mps:g} m/s": ~kept & ~twice & far,
        otherwise: ~kept & ~twice & ~far,
    }
    for reason, bad in reasons.items():
        fixes.without(bad, reason)
    return fixes[kept]


def _usual_mps(fixes: Fixes) -> float:
    """The usual speed from one fix to one so many further on that noise is nothing; 0 for a short way."""
    assert fixes.xy is not None
    lag = 1
    while lag < len(fixes):
        metres = np.hypot(*(fixes.xy[lag:] - fixes.xy[:-lag]).T)
        if np.median(metres) >= WAY_M:
            span_s = (fixes.t_us[lag:] - fixes.t_us[:-lag]) / 1e6
            return float(np.median(metres / np.maximum(span_s, 1e-6)))
        lag *= 2
    return 0.0


def _too_fast(fixes: Fixes, max_speed_mps: float) -> str:
    """Why most fixes cannot be true."""
    mps = _usual_mps(fixes)
    if mps <= max_speed_mps:
        return (
            f"fewer than half of the {len(fixes)} fixes fit together at {max_speed_mps:g} m/s or less: it "
            "holds several drives at once, or noise; `max_speed_mps` allows more"
        )
    told = f"the fixes move at {mps:,.0f} m/s, and no vehicle goes faster than {max_speed_mps:g} m/s"
    units = ["ns", "us", "ms", "s"]
    in_doubt = fixes.unit in units and not DATED_US[0] <= fixes.t_us[0] <= DATED_US[1]
    larger = units[units.index(fixes.unit) + 1 :] if in_doubt and fixes.unit else []
    for n, unit in enumerate(larger, 1):
        if mps / 1000**n <= max_speed_mps:
            return (
                f"{told}: its times were taken in {fixes.unit}, in {unit} it would be "
                f"{mps / 1000**n:.3g} m/s: `open_track(time_unit={unit})`"
            )
    return f"{told}: give the unit of its times, or another `max_speed_mps`"


@njit(cache=True)
def _reachable(
    i: int, j: int, metres: float, t_us: NDArray[np.int64], xy: Floats, way_xy: Floats, way_m: Floats,
    unknown: NDArray[np.int64], slack_m: float, max_mps: float,
) -> bool:  # fmt: skip
    """Whether a vehicle at fix i can be at fix j."""
    span_s = (t_us[j] - t_us[i]) / 1e6
    if span_s <= 0 or metres > max_mps * span_s + SLACK_M:
        return False
    way = way_m[j] - way_m[i]
    if span_s > FAR_S or unknown[j] > unknown[i] or way <= MOVING_MPS * span_s:
        return True
    off = (xy[j] - xy[i]) - (way_xy[j] - way_xy[i])
    return bool(np.hypot(off[0], off[1]) <= slack_m + DRIFT_MPS * span_s)


@njit(cache=True)
def _anchor(
    i: int, j: int, t_us: NDArray[np.int64], off: Floats, anchors: Floats, way_m: Floats,
    unknown: NDArray[np.int64],
) -> tuple[float, float]:  # fmt: skip
    """Where a chain that goes on from fix i has its way at fix j: it follows its fixes slowly."""
    span_s, way = (t_us[j] - t_us[i]) / 1e6, way_m[j] - way_m[i]
    if unknown[j] > unknown[i]:
        return off[j, 0], off[j, 1]
    by = WANDER_MPS * span_s + WANDER * way if way > MOVING_MPS * span_s else DRIFT_MPS * span_s
    east, north = off[j, 0] - anchors[i, 0], off[j, 1] - anchors[i, 1]
    share = min(1.0, by / max(np.hypot(east, north), 1e-9))
    return anchors[i, 0] + share * east, anchors[i, 1] + share * north


@njit(cache=True)
def _longest(
    t_us: NDArray[np.int64], xy: Floats, way_xy: Floats, way_m: Floats, unknown: NDArray[np.int64],
    slack_m: float, drift_m: float, max_mps: float, look: int,
) -> NDArray[np.bool_]:  # fmt: skip
    """Dynamic programming over the fixes; a better chain is looked for no further back than one can be."""
    n = len(t_us)
    count, most, before = np.ones(n, np.int64), np.ones(n, np.int64), np.full(n, -1)
    length, off = np.zeros(n), xy - way_xy
    anchors = off.copy()
    for j in range(n):
        for i in range(j - 1, max(j - look, 0) - 1, -1):
            if most[i] + 1 < count[j]:
                break
            metres = np.hypot(xy[j, 0] - xy[i, 0], xy[j, 1] - xy[i, 1])
            more = count[i] + 1 > count[j]
            shorter = count[i] + 1 == count[j] and length[i] + metres < length[j]
            if (more or shorter) and _reachable(
                i, j, metres, t_us, xy, way_xy, way_m, unknown, slack_m, max_mps
            ):
                east, north = _anchor(i, j, t_us, off, anchors, way_m, unknown)
                if np.hypot(off[j, 0] - east, off[j, 1] - north) <= drift_m:
                    count[j], length[j], before[j] = count[i] + 1, length[i] + metres, i
                    anchors[j] = east, north
        most[j] = max(count[j], most[j - 1]) if j else count[j]
    best = 0
    for j in range(n):
        if count[j] > count[best] or (count[j] == count[best] and length[j] < length[best]):
            best = j
    kept = np.zeros(n, np.bool_)
    while best >= 0:
        kept[best] = True
        best = before[best]
    return kept
