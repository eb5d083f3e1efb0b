"""Score rows -> matches. One file a matcher; its name is the name that users give.

A score row holds one number for each map item (a place or a reference image); larger is better. A
distance d enters as the score -d. Items stand in the order in which the map's drive met them.

A file holds a frozen dataclass of the same name, which is a `Matcher`: `matchers.Local(K=5)`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from evplace.core import families

Row = NDArray[np.floating[Any]]
"""(items,) scores of one query against every map item, larger is better."""

Rows = NDArray[np.floating[Any]]
"""(queries, items) score rows in the order of the queries."""


Judge = Callable[[NDArray[np.float64], float], NDArray[np.bool_]]
"""(queries,) scores and a value of a parameter -> (queries,) accepted."""


State = Literal["localised", "ambiguous", "unseen", "lost", "standing"]
"""localised; ambiguous: two places are alike; unseen: the map has never been here; lost: for a while nothing
has been found; standing: the camera stands, at the place found last."""


class Estimate(NamedTuple):
    """What a matcher that knows the route can say of its answer."""

    state: State
    """What the answer is worth."""
    probability: float
    """That the camera is near the item and looks the same way."""
    uncertainty_m: float
    """Radius around the item that holds the camera with a probability of 68 %, if it is on the map; NaN where
    items have no positions."""
    others: tuple[int, ...]
    """The next best items, at other places, best first."""


class Answer(NamedTuple):
    """What a matcher says of one query."""

    query: int
    """Index of the score row, from 0, that this is about."""
    item: int
    """Index of the map item, or -1 where there is none."""
    score: float
    """The matcher's own confidence, larger is better; NaN where it has none."""
    accepted: bool
    """Whether the matcher stands by `item`; False means: not seen before."""
    estimate: Estimate | None = None
    """More, from a matcher that knows the route."""


class Path(NamedTuple):
    """Answers for all queries, in their order."""

    item: NDArray[np.int64]
    """(queries,) map items, -1 where there is none."""
    score: NDArray[np.float64]
    """(queries,) confidences, NaN where there is none."""
    accepted: NDArray[np.bool_]
    """(queries,) whether the matcher stands by the item."""

    @classmethod
    def of(cls, answers: list[Answer]) -> Path:
        """The answers, which must be one a query and in order, as arrays."""
        return cls(
            np.array([answer.item for answer in answers], np.int64),
            np.array([answer.score for answer in answers], np.float64),
            np.array([answer.accepted for answer in answers], np.bool_),
        )


class Matching(Protocol):
    """One traverse being matched: remembers what a sequence needs."""

    def step(self, row: Row) -> Answer | None:
        """Take the next query's row; say what is known by now, causally, or None while nothing is.

        A matcher that looks ahead (SeqSLAM) answers for an earlier query: see `Answer.query`.
        """

    def extend(self, rows: Rows) -> None:
        """Take the rows of many queries at once: the same as `step` on each, without a call for each.

        Any cutting of the rows into blocks gives the same `path`.
        """

    def path(self) -> Path:
        """The answers for all rows so far, in hindsight where the method has any.

        `step` may forget queries that lie far back, so that it runs for days: they are answered with -1.
        """


class Matcher(Protocol):
    """A way to match, with its settings: a frozen dataclass, such as `matchers.Local(K=5)`.

    A class may have `presets`, a mapping of names to objects of it, and say `of_similarities = True` where it
    takes scores above 0 alone.
    """

    causal: ClassVar[bool]
    """Whether `path` is what `step` has said: nothing is gained by hindsight."""

    def start(self, distances: bool = False) -> Matching:
        """Begin a traverse; `distances` says that the scores are negated distances."""

    def sweep(self, parameter: str | None = None) -> Sweep:
        """How a precision-recall curve over a parameter is drawn; None: over the usual one."""


class Seen(NamedTuple):
    """What is known of a query besides its score row."""

    t_us: int
    """Time in microseconds."""
    content: float
    """How much its image shows: mean grey level of an event image, mean change of a camera image; NaN where
    that is not known."""
    verifying: NDArray[np.float32] | None = None
    """(items,) z-scores by one of the scorer's descriptors alone; None where it has but one."""


Learned = Mapping[str, NDArray[Any]]
"""What a matcher has learned of a map: arrays by their names."""


class Route(NamedTuple):
    """What a map tells a matcher of its items, in the order in which its drive met them."""

    position: NDArray[np.float64]
    """(items, 2) metres east and north, NaN where unknown."""
    heading_deg: NDArray[np.float64]
    """(items,) clockwise from north, NaN where unknown."""
    t_us: NDArray[np.int64] | None = None
    """(items,) times of the map's drive in microseconds; None where they are not kept."""
    content: float = math.nan
    """What the map's images usually show, as in Seen."""
    learned: Learned | None = None
    """What `learn` has given for this map; None where it was not asked."""
    own: Sequence[NDArray[np.int64]] | None = None
    """The item of each of the images that `learn` may ask rows of, for each drive of the map, one behind the
    other; None where these are the items' own, one each, and a row also says how like itself an image is."""
    verifying: Callable[[slice], Rows] | None = None
    """For `learn`: as its `rows`, the z-scores that verify (see Seen); None where there are none."""
    left_out: int = 0
    """Items of the map that these are not all of; then rows are z-scores by all of them."""


class Following(Protocol):
    """One traverse being matched live by a matcher that knows the route, in flat memory."""

    def step(self, row: Row, seen: Seen) -> list[Answer]:
        """Take the next query; say what has become known, of it or of earlier ones."""

    def finish(self) -> list[Answer]:
        """The drive is over: the answers that were still to come."""


@runtime_checkable
class Continuing(Following, Protocol):
    """A Following that goes on where the drive comes to another part of the map."""

    def continued(self, route: Route, came_from: NDArray[np.int64]) -> Following:
        """On other items of the same map; `came_from` (items,) is the number of each so far, -1 of a new one.

        Queries go on being numbered. See `Route.left_out` for rows of a part of a map.
        """


@runtime_checkable
class RouteMatcher(Protocol):
    """A Matcher that also uses where a map's items are, and when and how much a query saw."""

    def learn(self, route: Route, rows: Callable[[slice], Rows]) -> Learned:
        """What the map's own images tell; `rows` gives the score rows of some of them: see Route.own."""

    def follow(self, route: Route, distances: bool = False) -> Following:
        """Begin a traverse."""

    def in_hindsight(self, route: Route, rows: Rows, seen: Sequence[Seen]) -> Path:
        """The answers for all queries of a traverse, once all are known."""


@runtime_checkable
class LearnsMore(Protocol):
    """A RouteMatcher that need not learn a map anew where some images come to it."""

    def learn_more(self, before: Learned, route: Route, rows: Callable[[slice], Rows]) -> Learned:
        """As `learn`, of the images that are new; `before` is what it has learned of the others."""


class Sweep(NamedTuple):
    """One parameter of a matcher over many values."""

    parameter: str
    """Its name."""
    matcher: Matcher
    """What runs, where one run serves all values."""
    judge: Judge | None = None
    """What is accepted at a value; None where the parameter steers the search: a run for each value."""
    values: Callable[[NDArray[np.float64], bool], NDArray[np.float64]] = lambda best, _: best
    """(n,) best scores of rows, and whether they are distances -> values worth trying."""


def stepped(step: Callable[[Row], Answer | None], rows: Rows) -> tuple[Path, int]:
    """What `step` says of each row (queries, items), and how many rows later it said the latest of it.

    A query that it never speaks of is answered with -1.
    """
    known = [Answer(at, -1, np.nan, False) for at in range(len(rows))]
    delay = 0
    for at, row in enumerate(rows):
        answer = step(row)
        if answer is not None:
            known[answer.query] = answer
            delay = max(delay, at - answer.query)
    return Path.of(known), delay


def open_matcher(
    name: str | Matcher, preset: str | None = None, distances: bool = False, **values: object
) -> Matching:
    """A fresh start of a matcher by name; `values` are its settings, over those of `preset`.

    Raises SettingsError for an unknown name, preset or setting; the text lists the known ones.
    """
    matcher: Matcher = families.make("matchers", name, preset, values)
    return matcher.start(distances)


from evplace.matchers._rows import Answers, RowCheck  # noqa: E402 - they are made of what stands above

__all__ = [
    "Answer", "Answers", "Continuing", "Estimate", "Following", "Judge", "Learned", "LearnsMore", "Matcher",
    "Matching", "Path", "Route", "RouteMatcher", "Row", "RowCheck", "Rows", "Seen", "State", "Sweep",
    "open_matcher", "stepped",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    return families.class_called("matchers", name)
