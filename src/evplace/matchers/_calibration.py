"""What a map can tell of itself: what wrong places score on it, and what its filter says of places it lacks.

The map's own images are localised on it while stretches of it, with all that lies beside them, are cut out:
what the two layers then say of images from there is what they will say of places never seen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from evplace.core.zscores import robust_z
from evplace.matchers import Learned, Route, Rows, Seen
from evplace.matchers import _surroundings as around
from evplace.matchers import _traces as traces
from evplace.matchers._answering import RIGHT_M
from evplace.matchers._belief import CONTENT, WRONG
from evplace.matchers._known import features, probability
from evplace.matchers._ways import Ways

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

LIVE, LATE = "unknown_live", "unknown_late"
"""Probabilities, sorted, at places cut out: live, and when what comes later is known."""
OTHER_M = 25.0
"""References further away than this show another place."""
CUT_M = (60.0, 150.0)
"""Shortest and longest stretch that is cut out, or left."""
SHORTEST_M = 150.0
"""A map shorter than this cannot do without a stretch."""
LEAST_ITEMS = 50
LEAST_UNKNOWN = 100
"""Images from places cut out, at least, for a share of them to be told."""
TRIALS = 6
MOST_IMAGES = 3000
"""Of the map's own, that are localised on it: the first ones of a longer map."""


def measured(route: Route, rows: Callable[[slice], Rows]) -> Learned:
    """What `Bayes` learns; nothing from a map too short or too small to be measured."""
    ways = Ways.of(route)
    items = len(ways.way)
    if items < LEAST_ITEMS or ways.way[-1] < SHORTEST_M:
        return {}
    queries = min(items, MOST_IMAGES)
    own = np.array(rows(slice(0, queries)), np.float32)
    own[np.arange(queries), np.arange(queries)] = own.min(axis=1)  # an image tells nothing of itself
    learned = {WRONG: _wrong(ways, own), CONTENT: np.array([route.content])}
    unknown = [_trial(route, own, learned, keep) for keep in _cuts(ways)]
    live, late = (np.sort(np.concatenate(column)) for column in zip(*unknown, strict=True))
    return learned if len(live) < LEAST_UNKNOWN else learned | {LIVE: live, LATE: late}


def _wrong(ways: Ways, own: Rows) -> Floats:
    """The density of z-scores of other places."""
    scores = [robust_z(row)[_elsewhere(ways, query)] for query, row in enumerate(own)]
    return around.density(np.concatenate(scores).astype(np.float64))


def _elsewhere(ways: Ways, item: int) -> Bools:
    apart = np.minimum(ways.away(item), np.abs(ways.way - ways.way[item]))
    return np.asarray(apart > OTHER_M, np.bool_)


def _cuts(ways: Ways) -> Iterator[Bools]:
    """(items,) each time, which are left in the map: every other of stretches drawn anew."""
    rng = np.random.default_rng(0)
    for trial in range(TRIALS):
        ends = [0.0]
        while ends[-1] < ways.way[-1]:
            ends.append(ends[-1] + rng.uniform(*CUT_M))
        yield (np.searchsorted(ends, ways.way, "right") + trial) % 2 == 0


def _trial(route: Route, own: Rows, learned: Learned, keep: Bools) -> tuple[Floats, Floats]:
    """(unknown,) what is said, live and late, of those of a map's images whose places are cut out."""
    whole, part = Ways.of(route), Ways.of(_part(route, keep))
    seen, rows = _driven(whole, len(own)), own[:, keep]
    unknown = np.array([not _known(whole, keep, query) for query in range(len(own))])
    live, late = traces.live(part, rows, seen, learned), traces.late(part, rows, seen, learned)
    return (
        probability(features(live.signs, live.weight, late=False))[unknown],
        probability(features(late.signs, late.weight, late=True))[unknown],
    )


def _part(route: Route, keep: Bools) -> Route:
    times = None if route.t_us is None else route.t_us[keep]
    return Route(route.position[keep], route.heading_deg[keep], times)


def _known(whole: Ways, keep: Bools, query: int) -> bool:
    """Whether an image's place is still in the map."""
    near = keep & (whole.away(query) <= RIGHT_M) & whole.looks_like(query)
    return bool(near.any())


def _driven(ways: Ways, images: int) -> list[Seen]:
    """The map's own images as a drive at its usual pace."""
    t_us = np.concatenate([[0.0], np.cumsum(np.minimum(np.diff(ways.way[:images]) / ways.pace, 1.0))]) * 1e6
    return [Seen(int(one), np.nan) for one in t_us]
