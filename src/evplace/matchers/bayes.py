"""Where on the map, and whether on it: a Bayes filter along the route, calibrated on the map itself.

Two layers. The first says where the camera is, if it is on the map: a filter over the references, each with
a class of speed (Markov localisation: Fox, Burgard and Thrun, JAIR 11, 1999). The second says whether that
answer is right, from what the answers of the last two seconds looked like (ours). What separates known from
unknown is measured on the map: its own images are localised while stretches of the map are cut out;
`false_accept` is the share of those never seen that may be accepted, halfway with what other towns need.

Answers are live; with `lag_s` each is about the time so many seconds ago, and better; in hindsight all images
count. Times are in seconds and ways in metres, so that images of any rate give the same answers.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.core.zscores import robust_z
from evplace.matchers import (
    Answer,
    Estimate,
    Following,
    Learned,
    Matching,
    Path,
    Route,
    Row,
    Rows,
    Seen,
    State,
    Sweep,
)
from evplace.matchers._answering import Found, Reader
from evplace.matchers._belief import WRONG, Clock, Filter, Moment, clock_of, smoothed, taken
from evplace.matchers._calibration import LATE, LIVE, checked, limits, measured, together
from evplace.matchers._kept import Kept, after, live_rows
from evplace.matchers._known import LATE_SIGNS, Means, joined, means_ahead, of_late, probability
from evplace.matchers._rows import RowCheck, above
from evplace.matchers._traces import late
from evplace.matchers._ways import Ways

Floats = NDArray[np.float64]

UNKNOWN = LIVE
"""What a map has learned of its places that were cut out, one number for each image."""
UNDECIDED = 0.1
"""Below this share of the threshold an answer is no longer lost, but of a place never seen."""
LEAST = 0.1
"""An answer less probable than this is accepted by no calibration."""
ALIKE = 0.5
"""A runner-up with so large a share of the best one's belief makes an answer ambiguous."""


@dataclass(frozen=True)
class Bayes:
    """The settings; how the camera moves and what scores are worth is not set, but measured."""

    false_accept: float = 0.01
    """Share of the images of places never seen that may be accepted, as measured on the map and elsewhere."""
    threshold: float | None = None
    """Accept an answer whose probability is above this, whatever `false_accept` says. Default: by that."""
    lag_s: float = 0.0
    """Seconds that an answer waits for what comes next: 0, or from 1 to 60."""

    presets: ClassVar[Mapping[str, Bayes]]
    causal: ClassVar[bool] = False
    probabilistic: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if not 0 < self.false_accept < 1:
            raise SettingsError(f"'false_accept' is a share between 0 and 1, not {self.false_accept}")
        if self.lag_s and not 1 <= self.lag_s <= 60:
            raise SettingsError(f"'lag_s' is 0 or from 1 to 60 seconds, not {self.lag_s}")

    def learn(self, route: Route, rows: Callable[[slice], Rows]) -> Learned:
        """See RouteMatcher."""
        return measured(route, rows)

    def learn_more(self, before: Learned, route: Route, rows: Callable[[slice], Rows]) -> Learned:
        """See LearnsMore."""
        return together(checked(before), measured(route, rows, least=1))

    def follow(self, route: Route, distances: bool = False) -> Following:  # noqa: ARG002 - a distance is -d
        """See RouteMatcher."""
        return _Lagging(self, route) if self.lag_s else _Live(self, route)

    def in_hindsight(self, route: Route, rows: Rows, seen: Sequence[Seen]) -> Path:
        """See RouteMatcher."""
        trace = late(Ways.of(route), rows, seen, checked(route.learned))
        right = probability(of_late(trace.signs, trace.live, trace.weight), trace.slow)
        return Path(trace.item, right, right > np.array(self._limits(route, LATE))[trace.slow.astype(int)])

    def start(self, distances: bool = False) -> Matching:  # noqa: ARG002 - a distance is -d
        """On rows alone: items a step apart, one query a step."""
        return _OnRows(self)

    def sweep(self, parameter: str | None = None) -> Sweep:
        """See Matcher."""
        usual = parameter in (None, "threshold")
        return Sweep(parameter or "threshold", self, above if usual else None)

    def limits(self, learned: Learned) -> dict[str, float]:
        """What a probability must be above, by what a map has told: live, and late; of a slow camera, too."""
        route = Route(np.empty((0, 2)), np.empty(0), learned=checked(learned))
        kinds = {"live": LIVE, "late": LATE}
        found = {name: self._limits(route, kind) for name, kind in kinds.items()}
        return {
            name + end: limit
            for name, both in found.items()
            for end, limit in zip(("", "_slow"), both, strict=True)
        }

    def _limits(self, route: Route, kind: str) -> tuple[float, float]:
        """What a probability must be above, of a quick camera and of a slow one; any where the map could not
        be measured.
        """
        if self.threshold is not None:
            return self.threshold, self.threshold
        found = limits(route.learned or {}, kind, self.false_accept)
        return (-1.0, -1.0) if found is None else (max(found[0], LEAST), max(found[1], LEAST))


Bayes.presets = {"best": Bayes()}


class _Live:
    """Answers each image at once, from those before it."""

    def __init__(self, settings: Bayes, route: Route) -> None:
        learned = checked(route.learned)
        self._settings = settings
        self._limits, self._measured = settings._limits(route, LIVE), LIVE in learned
        self._filter = Filter(Ways.of(route), learned.get(WRONG))
        self._reader, self._is_part = Reader(self._filter.ways, route.left_out), route.left_out > 0
        self._clock, self._check, self._means = clock_of(learned), RowCheck(), Means()

    def step(self, row: Row, seen: Seen) -> list[Answer]:
        """See Following."""
        row = self._check(row[None])[0]
        z = np.asarray(row, np.float32) if self._is_part else robust_z(row)
        weight, drive_s = self._clock.see(seen)
        if drive_s is not None:
            self._filter.move(drive_s)
        belief = self._filter.see(z, weight)
        found = self._reader.find(belief, z, seen.verifying, self._filter.speeds)
        right = float(probability(self._means.add(found.signs, weight)[None], self._clock.slow)[0])
        return [_answer(self, self._check.queries - 1, belief, found, right, self._clock)]

    def finish(self) -> list[Answer]:
        """See Following."""
        return []

    def continued(self, route: Route, came_from: NDArray[np.int64]) -> _Live:
        """See Continuing."""
        other = _Live(self._settings, route)
        _go_on(other, self, came_from)
        return other


class _Seen(NamedTuple):
    query: int
    t_us: int
    z: NDArray[np.float32]
    verifying: NDArray[np.float32] | None
    weight: float
    standing: bool
    slow: bool
    moment: int
    """Its number, of all moments so far."""
    said: Floats
    """What the weights of live answers are of."""


class _Lagging:
    """Answers each image `lag_s` later, when what came next is known, too."""

    def __init__(self, settings: Bayes, route: Route) -> None:
        learned = checked(route.learned)
        self._settings = settings
        self._limits, self._measured = settings._limits(route, LATE), LATE in learned
        self._lag_us = round(settings.lag_s * 1e6)
        self._filter = Filter(Ways.of(route), learned.get(WRONG))
        self._reader, self._is_part = Reader(self._filter.ways, route.left_out), route.left_out > 0
        self._clock, self._check, self._means = clock_of(learned), RowCheck(), Means(LATE_SIGNS)
        self._said = Means()
        self._waiting: deque[_Seen] = deque()
        self._moments: deque[Moment] = deque()
        self._moved = 0

    def step(self, row: Row, seen: Seen) -> list[Answer]:
        """See Following."""
        row = self._check(row[None])[0]
        z = np.asarray(row, np.float32) if self._is_part else robust_z(row)
        weight, drive_s = self._clock.see(seen)
        if drive_s is not None:
            self._moments.append(self._filter.moment)
            self._filter.move(drive_s)
            self._moved += 1
        belief = self._filter.see(z, weight)
        found = self._reader.find(belief, z, seen.verifying, self._filter.speeds)
        said, clock = self._said.add(found.signs, weight), self._clock
        query, verifying = self._check.queries - 1, seen.verifying
        self._waiting.append(
            _Seen(query, seen.t_us, z, verifying, weight, clock.standing, clock.slow, self._moved, said)
        )
        return self._answers(sum(one.t_us <= seen.t_us - self._lag_us for one in self._waiting))

    def finish(self) -> list[Answer]:
        """See Following."""
        return self._answers(len(self._waiting))

    def continued(self, route: Route, came_from: NDArray[np.int64]) -> _Lagging:
        """See Continuing."""
        other = _Lagging(self._settings, route)
        _go_on(other, self, came_from)
        other._moved, other._said = self._moved, self._said
        other._waiting.extend(_taken(one, came_from) for one in self._waiting)
        other._moments.extend(
            Moment(taken(one.belief, came_from), taken(one.evidence, came_from), one.moved_s)
            for one in self._moments
        )
        return other

    def _answers(self, due: int) -> list[Answer]:
        """The first `due` of those that wait, each judged by all that is known."""
        if not due:
            return []
        moments = [*self._moments, self._filter.moment]
        first = self._moved - len(self._moments)
        beliefs, _ = smoothed(moments, self._filter.ways)
        found = [
            self._reader.find(beliefs[one.moment - first], one.z, one.verifying) for one in self._waiting
        ]
        weights = np.array([one.weight for one in self._waiting])
        ahead = means_ahead(np.array([one.signs for one in found]), weights)
        answers = []
        for at in range(due):
            one = self._waiting.popleft()
            before = self._means.add(found[at].signs, one.weight)
            features = np.concatenate([joined(before, ahead[at]), one.said])
            right = float(probability(features[None], one.slow)[0])
            belief = beliefs[one.moment - first]
            answers.append(_answer(self, one.query, belief, found[at], right, one))
        while self._waiting and self._waiting[0].moment > self._moved - len(self._moments):
            self._moments.popleft()
        return answers


def _go_on(now: _Live | _Lagging, before: _Live | _Lagging, came_from: NDArray[np.int64]) -> None:
    """Take over what does not depend on which items are compared, and the belief."""
    now._filter.go_on(before._filter, came_from)
    now._clock, now._means = before._clock, before._means
    now._check.queries = before._check.queries


def _taken(seen: _Seen, came_from: NDArray[np.int64]) -> _Seen:
    """What was seen, of other items; `came_from` as in `Continuing`."""
    verifying = None if seen.verifying is None else taken(seen.verifying, came_from)
    return seen._replace(z=taken(seen.z, came_from), verifying=verifying)


def _answer(
    by: _Live | _Lagging, query: int, belief: Floats, found: Found, right: float, image: Clock | _Seen
) -> Answer:
    """The answer to an image that stood or not, came slowly or not, with what it is worth."""
    limit = by._limits[image.slow]
    accepted = right > limit
    others = by._reader.others(belief, found.item)
    estimate = Estimate(
        _state(right, limit, image.standing, found.mass, others.mass),
        right if by._measured else math.nan,
        by._reader.uncertainty_m(belief, found.item),
        others.items,
    )
    return Answer(query, found.item, right, accepted, estimate)


def _state(right: float, threshold: float, standing: bool, mass: float, runner_up: float) -> State:
    """What an answer is worth that is right with a probability, its place and the next with their beliefs."""
    if right > threshold:
        return "standing" if standing else "localised"
    if right <= UNDECIDED * threshold:
        return "unseen"
    return "ambiguous" if runner_up > ALIKE * mass else "lost"


class _OnRows:
    """Bayes on score rows alone: nothing is known of the map, and queries come at an even pace."""

    def __init__(self, settings: Bayes) -> None:
        self._settings, self._check = settings, RowCheck()
        self._rows = Kept()
        self._following: Following | None = None

    def step(self, row: Row) -> Answer | None:
        """See Matching."""
        row = self._check(row[None])[0]
        if self._following is None:
            self._following = self._settings.follow(_nowhere(len(row)))
        self._rows.append(row[None])
        self._rows.forget_but(live_rows(row.nbytes))
        answers = self._following.step(row, _on_time(self._check.queries - 1))
        return answers[0] if answers else None

    def extend(self, rows: Rows) -> None:
        """See Matching."""
        self._rows.append(self._check(rows))

    def path(self) -> Path:
        """See Matching."""
        if not self._check.queries:
            return Path.of([])
        rows, first = self._rows.table(), self._rows.first
        seen = [_on_time(query) for query in range(first, len(self._rows))]
        return after(first, self._settings.in_hindsight(_nowhere(rows.shape[1]), rows, seen))


def _nowhere(items: int) -> Route:
    return Route(np.full((items, 2), np.nan), np.full(items, np.nan))


def _on_time(query: int) -> Seen:
    return Seen(query * 1_000_000, 1.0)
