"""Where on the map: a causal Bayes filter over references and classes of speed, and what was seen on the way.

A score row enters as a z-score; how much that speaks for a reference is told by what other places score, as
measured on the map itself. History is in seconds: an image counts by the time since the last one, and by how
much it shows, since a camera that stands learns nothing new.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.matchers import Learned, Seen
from evplace.matchers import _route_filter as loops
from evplace.matchers import _surroundings as around
from evplace.matchers._ways import APART_M, Ways

Floats = NDArray[np.float64]

WRONG, CONTENT = "wrong", "content"
"""What a map has told: the density of wrong scores, and what its images show."""
SPEEDS = np.array([0.25, 0.4, 0.6, 0.8, 1.0, 1.4, 2.0, 3.0])
"""Classes of speed, as shares of the map's own."""
TICK_S = 0.1
"""Images that come faster count less each; the filter moves on about so often."""
MORE_NEW_S = (0.2, 1.0)
"""Images further apart than the first are less alike and count more, up to MOST_NEW from the second on."""
MOST_NEW = 1.5
"""How much an image may count, against one a tenth of a second after the last (ours: towns for tuning alone
would have it 2, but images of real drives are more alike)."""
MOVING_S = 0.8 * TICK_S
"""The filter moves once this much has been driven: never by steps much smaller than a reference."""
REMEMBERED = 300
"""Images, at ten a second, by which it is judged whether the camera stands."""
BELIEVED = 20
"""For how many of them what the map's own images show is taken."""
LONGEST_REST_S = 120.0
"""A camera that shows little for longer is taken to show no more."""
FAR_APART_S = 0.5
"""Images so far apart do not tell whether the camera stood between them."""
CHANGE = 0.1
"""Share of a class that becomes the next slower or faster one in a tick."""
LINK = 0.02
"""Share that passes to references beside in a tick."""
JUMP = 0.003
"""Share that may be anywhere after a tick."""


class Moment(NamedTuple):
    """What is kept of a stretch of images between two moves of the filter."""

    belief: NDArray[np.float32]
    """(references, speeds) after them."""
    evidence: Floats
    """(references,) logarithm of how much they say, together."""
    moved_s: float
    """Seconds of driving since the moment before."""


class Filter:
    """The belief, image by image."""

    def __init__(self, ways: Ways, wrong: Floats | None = None) -> None:
        """Over the items of a map; `wrong` as `around.density` measures it, None for the usual one."""
        self.ways = ways
        self.says = around.evidence(around.USUAL if wrong is None else wrong)
        self.belief = np.full((len(ways.way), len(SPEEDS)), 1 / (len(ways.way) * len(SPEEDS)))
        self.evidence = np.zeros(len(ways.way))
        self.moved_s = 0.0
        self._other = np.empty_like(self.belief)

    def move(self, seconds: float) -> None:
        """`seconds` of driving have passed, standing not counted."""
        after = moved(self.belief, self.ways, seconds, self._other)
        self.belief, self._other = after, self.belief
        self.evidence, self.moved_s = np.zeros(len(self.evidence)), seconds

    def see(self, z: NDArray[np.float32], weight: float) -> Floats:
        """(references,) the belief after one more row of z-scores of an image of some weight."""
        says = weight * self.says
        loops.weigh(self.belief, self.evidence, z, says, np.exp(says))
        marginal = np.empty(len(self.belief))
        loops.share_out(self.belief.reshape(-1), self.belief.sum(), marginal)
        return marginal

    @property
    def speeds(self) -> Floats:
        """(SPEEDS,) the belief in each class."""
        return np.asarray(self.belief.sum(axis=0), np.float64)

    def go_on(self, before: Filter, came_from: NDArray[np.int64]) -> None:
        """From a filter over other items of the map; `came_from` as in `Continuing`.

        What was believed of items that are no longer here may be anywhere.
        """
        self.belief = taken(before.belief, came_from)
        self.belief += (1 - self.belief.sum()) / self.belief.size
        self.evidence, self.moved_s = taken(before.evidence, came_from), before.moved_s

    @property
    def moment(self) -> Moment:
        """What is to be kept of the images since the last move."""
        return Moment(self.belief.astype(np.float32), self.evidence, self.moved_s)


def taken(values: NDArray[Any], came_from: NDArray[np.int64]) -> NDArray[Any]:
    """(items, ...) the values of items by where they were; 0 of new ones."""
    new = np.zeros((len(came_from), *values.shape[1:]), values.dtype)
    known = came_from >= 0
    new[known] = values[came_from[known]]
    return new


def moved(belief: Floats, ways: Ways, seconds: float, other: Floats) -> Floats:
    """(references, speeds) a belief after so many seconds of driving: it is `other`; `belief` is used up."""
    ticks = min(seconds / TICK_S, 1.0)
    loops.mix_speeds(belief, CHANGE * ticks, other)
    loops.move(other, ways.way, SPEEDS * ways.pace * seconds, belief, np.empty(len(SPEEDS), np.uint64))
    loops.pass_links(belief, *ways.links, LINK * ticks, other)
    kept = other.sum() * (1 - JUMP * ticks)
    loops.level(other, 1 - JUMP * ticks, (1 - kept) / other.size)
    return other


def smoothed(moments: list[Moment], ways: Ways, later: Floats | None = None) -> tuple[list[Floats], Floats]:
    """(references,) what is believed of each moment once all are known, and what they say of the one before.

    `later` is what those after them say of the last; None where there are none.
    """
    message = np.ones(moments[-1].belief.shape) if later is None else later
    out = []
    for moment in reversed(moments):
        joint = moment.belief * message
        marginal = joint.sum(axis=1)
        out.append(marginal / max(float(marginal.sum()), 1e-300))
        message = message_before(message, moment, ways)
    return out[::-1], message


def message_before(message: Floats, moment: Moment, ways: Ways) -> Floats:
    """What a moment, and all after it, say of the moment before it."""
    seen = message * np.exp(moment.evidence - moment.evidence.max())[:, None]
    ticks = min(moment.moved_s / TICK_S, 1.0)
    one, other = np.empty_like(seen), np.empty_like(seen)
    loops.pass_links_back(seen, *ways.links, LINK * ticks, one)
    loops.move_back(one, ways.way, SPEEDS * ways.pace * moment.moved_s, float(seen.mean()), other)
    loops.mix_speeds(other, CHANGE * ticks, one)
    back = (1 - JUMP * ticks) * one + JUMP * ticks * seen.mean()
    return np.asarray(back / max(float(back.max()), 1e-300), np.float64)


def reaches(ways: Ways) -> Floats:
    """(4,) metres for `loops.read`: wider where items lie far apart."""
    least = np.array([15.0, 4.0, APART_M, 2 * APART_M])
    return np.asarray(np.maximum(least, np.array([2.0, 1.1, 4.0, 8.0]) * ways.spacing), np.float64)


class Clock:
    """How much each image counts, and when the filter moves on.

    An image shows little when the camera stands: next to the median of what the last images have shown that
    showed something.
    """

    def __init__(self, usual: float = math.nan) -> None:
        """`usual` is what the map's own images show, where it is known: a drive may begin with a stop."""
        self.standing = False
        """Whether the last image said nothing new."""
        self.slow = False
        """Whether it came long after the one before it."""
        self._last_us: int | None = None
        self._driven_s = 0.0
        self._since_kept_s = 0.0
        self._rest_s = 0.0
        self._shown: deque[float] = deque([] if math.isnan(usual) else [usual] * BELIEVED, maxlen=REMEMBERED)

    def see(self, seen: Seen) -> tuple[float, float | None]:
        """The weight of an image, and the seconds driven where the filter is to move before it."""
        seconds = 0.0 if self._last_us is None else max(seen.t_us - self._last_us, 0) * 1e-6
        new = 1.0 if self._last_us is None else _new(seconds)
        self._last_us, self.slow = seen.t_us, seconds >= FAR_APART_S
        active = self._active(seen.content, seconds)
        self.standing = active == 0.0
        self._driven_s += seconds * active
        if self._driven_s < MOVING_S:
            return new * active, None
        driven, self._driven_s = self._driven_s, 0.0
        return new * active, driven

    def _active(self, content: float, seconds: float) -> float:
        """From 0, standing, to 1, also where it is not known."""
        if math.isnan(content) or seconds >= FAR_APART_S:
            return 1.0
        usual = _median(self._shown) if len(self._shown) >= 5 else content
        active = min(max((content / usual - 0.3) / 0.3, 0.0), 1.0) if usual > 0 else 1.0
        self._since_kept_s += seconds
        self._rest_s = 0.0 if active else self._rest_s + seconds
        if self._rest_s > LONGEST_REST_S:
            self._shown.clear()
        if active > 0 and (self._since_kept_s >= MOVING_S or not self._shown):
            self._shown.append(content)
            self._since_kept_s = 0.0
        return active


def _new(seconds: float) -> float:
    """How much an image shows that the last one, so many seconds ago, did not."""
    begin, end = MORE_NEW_S
    more = min(max((seconds - begin) / (end - begin), 0.0), 1.0)
    return min(seconds / TICK_S, 1.0 + (MOST_NEW - 1.0) * more)


def _median(values: deque[float]) -> float:
    """Of a few numbers; numpy's takes four times as long."""
    ordered = sorted(values)
    return (ordered[(len(ordered) - 1) // 2] + ordered[len(ordered) // 2]) / 2


def clock_of(learned: Learned) -> Clock:
    """A clock that knows what the map's images show, where that was learned."""
    return Clock(float(learned[CONTENT][0])) if CONTENT in learned else Clock()
