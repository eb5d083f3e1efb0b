"""What a map can tell of itself: what wrong places score on it, and what its filter says of places it lacks.

The map's own images are localised on it while stretches of it, with all that lies beside them, are cut out:
what the two layers then say of images from there is what they will say of places never seen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import repeat
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import PlaceMapError
from evplace.core.zscores import robust_z
from evplace.matchers import Learned, Route, Rows, Seen
from evplace.matchers import _surroundings as around
from evplace.matchers import _traces as traces
from evplace.matchers._belief import CONTENT, WRONG
from evplace.matchers._known import judges, limit, of_late, of_live, probability
from evplace.matchers._ways import Ways

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

LIVE, LATE = "unknown_live", "unknown_late"
"""Probabilities, sorted, at places cut out: live, and when what comes later is known."""
SLOW = "_slow"
"""The end of the same names, of answers judged as those of a slow camera."""
UNKNOWN = (LIVE, LATE, LIVE + SLOW, LATE + SLOW)
OTHER_M = 25.0
"""References further away than this show another place."""
CUT_M = (60.0, 150.0)
"""Shortest and longest stretch that is cut out, or left."""
NEAR_M, LIKE_DEG = 35.0, 60.0
"""Up to so far from what is left of the map, an image of its own drive may look like it: nearer than on any
later drive, so that such images would tell too much."""
SHORTEST_M = 150.0
"""A map shorter than this cannot do without a stretch."""
LEAST_ITEMS = 50
LEAST_UNKNOWN = 100
"""Images from places cut out, at least, for a share of them to be told."""
TRIALS = (4, 24)
"""Ways to cut a map, of a large one and of a small one."""
TRIED = 6000
"""Images that are localised in all trials, about."""
MOST_IMAGES = 3000
"""Of the map's own, that are localised on it: the first ones of a longer map."""
MOST_SCORES = 20_000_000
"""From which the density of wrong scores is made; of more, every second, third ... is taken."""


class Strangers(NamedTuple):
    """What the two layers make of a map's images whose places are cut out."""

    learned: Learned
    """What the first layer learns of the map."""
    live: Floats
    """(unknown, features) what the second one sees of them, live."""
    late: Floats
    """(unknown, features) and when what comes later is known."""


def measured(route: Route, rows: Callable[[slice], Rows], least: int = LEAST_UNKNOWN) -> Learned:
    """What `Bayes` learns; nothing from a map too short or too small to be measured."""
    found = strangers(route, rows, least)
    if found is None:
        return {}
    said = {
        name + (SLOW if slow else ""): np.sort(probability(features, slow))
        for name, features in ((LIVE, found.live), (LATE, found.late))
        for slow in (False, True)
    }
    return {**found.learned, **said}


def limits(learned: Learned, kind: str, false_accept: float) -> tuple[float, float] | None:
    """What a probability must be above for so many false accepts, of a quick camera and of a slow one.

    `kind` is LIVE or LATE; None where the map could not be measured.
    """
    if kind not in learned:
        return None
    by = judges()[kind == LATE]
    quick, slow = (limit(learned[kind + end], by, bool(end), false_accept) for end in ("", SLOW))
    return quick, slow


def together(before: Learned, more: Learned) -> Learned:
    """What was measured of a map, and of some more of it; each counts by its images from places cut out."""
    if not more:
        return before
    many = np.array([len(one[LIVE]) for one in (before, more)]) / (len(before[LIVE]) + len(more[LIVE]))
    wrong = np.log(many @ np.exp(np.stack([before[WRONG], more[WRONG]])))
    content = many @ np.stack([before[CONTENT], more[CONTENT]])
    both = {name: np.sort(np.concatenate([before[name], more[name]])) for name in UNKNOWN}
    return {WRONG: wrong, CONTENT: content, **both}


def strangers(route: Route, rows: Callable[[slice], Rows], least: int = LEAST_UNKNOWN) -> Strangers | None:
    """Localise a map's images on what is left of it; None for a map too short or too small for that."""
    ways = Ways.of(route)
    items = len(ways.way)
    if items < LEAST_ITEMS or ways.way[-1] < SHORTEST_M:
        return None
    drives = [np.arange(min(items, MOST_IMAGES))] if route.own is None else route.own
    at = np.concatenate(drives)
    own = _of_others(rows, route, len(at))
    verifying = None if route.verifying is None else _of_others(route.verifying, route, len(at))
    learned = {WRONG: _wrong(ways, own, at), CONTENT: np.array([route.content])}
    ends = np.cumsum([len(drive) for drive in drives])[:-1]
    parts = [None] * len(drives) if verifying is None else np.split(verifying, ends)
    each = list(zip(drives, np.split(own, ends), parts, strict=True))
    unknown = [_trial(route, ways, *one, learned, keep) for keep in _cuts(ways) for one in each]
    live, late = (np.concatenate(column) for column in zip(*unknown, strict=True))
    return None if len(live) < least else Strangers(learned, live, late)


def _of_others(rows: Callable[[slice], Rows], route: Route, images: int) -> Rows:
    """(images, items) rows of a map's own images, which tell nothing of themselves."""
    found = np.array(rows(slice(0, images)), np.float32)
    if route.own is None:
        at = np.arange(images)
        found[at, at] = found.min(axis=1)
    return found


def _wrong(ways: Ways, own: Rows, at: Ints) -> Floats:
    """The density of z-scores of other places."""
    every = -(-own.size // MOST_SCORES)
    scores = [robust_z(row)[_elsewhere(ways, item)][::every] for row, item in zip(own, at, strict=True)]
    return around.density(np.concatenate(scores).astype(np.float64))


def _elsewhere(ways: Ways, item: int) -> Bools:
    apart = np.minimum(ways.away(item), np.abs(ways.way - ways.way[item]))
    return np.asarray(apart > OTHER_M, np.bool_)


def _cuts(ways: Ways) -> Iterator[Bools]:
    """(items,) each time, which are left in the map: every other of stretches drawn anew."""
    rng = np.random.default_rng(0)
    for trial in range(int(np.clip(TRIED // len(ways.way), *TRIALS))):
        ends = [0.0]
        while ends[-1] < ways.way[-1]:
            ends.append(ends[-1] + rng.uniform(*CUT_M))
        yield (np.searchsorted(ends, ways.way, "right") + trial) % 2 == 0


def _trial(
    route: Route, whole: Ways, at: Ints, own: Rows, verifying: Rows | None, learned: Learned, keep: Bools
) -> tuple[Floats, Floats]:
    """(unknown, features) live and late, of those of a drive's images whose places are cut out."""
    part = Ways.of(_part(route, keep))
    rows = own[:, keep]
    seen = _driven(whole, at, None if verifying is None else verifying[:, keep])
    unknown = np.array([not _near(whole, keep, item) for item in at])
    live, late = traces.live(part, rows, seen, learned), traces.late(part, rows, seen, learned)
    return (
        of_live(live.signs, live.weight)[unknown],
        of_late(late.signs, late.live, late.weight)[unknown],
    )


def _part(route: Route, keep: Bools) -> Route:
    times = None if route.t_us is None else route.t_us[keep]
    return Route(route.position[keep], route.heading_deg[keep], times)


def _near(whole: Ways, keep: Bools, item: int) -> bool:
    """Whether the map still has a place that an item's image may look like: its own, or what lies ahead."""
    turn = np.abs((whole.heading_deg - whole.heading_deg[item] + 180) % 360 - 180)
    return bool((keep & (whole.away(item) <= NEAR_M) & ~(turn > LIKE_DEG)).any())


def _driven(ways: Ways, at: Ints, verifying: Rows | None) -> list[Seen]:
    """Images at some items, in their order, as a drive at the map's usual pace."""
    steps = np.abs(np.diff(ways.way[at])) / ways.pace
    t_us = np.concatenate([[0.0], np.cumsum(np.minimum(steps, 1.0))]) * 1e6
    rows = repeat(None) if verifying is None else verifying
    return [Seen(int(time), np.nan, row) for time, row in zip(t_us, rows, strict=False)]


def checked(learned: Learned | None) -> Learned:
    """What was learned of a map, or nothing; PlaceMapError where it is not such."""
    if not learned:
        return {}
    wrong, content = (np.asarray(learned.get(name)) for name in (WRONG, CONTENT))
    good = wrong.shape == around.GRID.shape and _are_finite(wrong) and content.shape == (1,)
    good = good and content.dtype == np.float64 and not (content < 0).any()
    if not good or not all(_are_shares(np.asarray(learned.get(name))) for name in UNKNOWN):
        raise PlaceMapError(
            "what the map has told of itself is damaged, missing in part, or of an earlier evplace: measure "
            "it again, with evplace calibrate"
        )
    return learned


def _are_shares(values: NDArray[Any]) -> bool:
    """Whether they are sorted, from 0 to 1."""
    if values.ndim != 1 or not len(values) or not _are_finite(values):
        return False
    return bool((np.diff(values) >= 0).all() and values[0] >= 0 and values[-1] <= 1)


def _are_finite(values: NDArray[Any]) -> bool:
    return values.dtype == np.float64 and bool(np.isfinite(values).all())
