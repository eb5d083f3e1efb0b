"""A drive matched on parts of a map, against the same drive matched on all of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.zscores import robust_z
from evplace.matchers import Answer, Matcher, Route, Seen
from evplace.matchers._answering import RISE, Reader
from evplace.matchers._known import ASKED, LATE_SIGNS, LONGER, SIGNS, SPANS, Judges, Trees
from evplace.matchers._parts import InParts
from evplace.matchers._ways import Ways
from evplace.matchers.bayes import Bayes

ITEMS = 5000
VERIFIES = 3
"""The number of the sign of what verifies."""


def road(items: int = ITEMS) -> Route:
    """Two metres an item."""
    position = np.stack([500_000 + 2.0 * np.arange(items), np.full(items, 4e6)], axis=1)
    return Route(position, np.full(items, 90.0), np.arange(items, dtype=np.int64) * 200_000)


def drive(queries: int = 80, start: int = 2000) -> tuple[NDArray[np.float32], list[Seen]]:
    """An item a query from `start` on; rows that are robust z-scores, as the usual scorer gives them."""
    rows = np.random.default_rng(0).standard_normal((queries, ITEMS))
    away = np.arange(ITEMS) - start - np.arange(queries)[:, None]
    rows += 8 * np.exp(-0.5 * (away / 2.0) ** 2)
    seen = [Seen(query * 200_000, np.nan) for query in range(queries)]
    return np.stack([robust_z(row) for row in rows]), seen


def matched(
    matcher: Matcher, rows: NDArray[np.float32], seen: list[Seen], regions: list[NDArray[np.int64] | None]
) -> list[Answer]:
    parts = InParts(matcher, road(), False)
    found = []
    for row, one, items in zip(rows, seen, regions, strict=True):
        wanted = parts.within(items)
        if wanted is not None:
            row, one = row[wanted], one._replace(verifying=_of(one.verifying, wanted))
        found += parts.step(row, one)
    return found + parts.finish()


def _of(row: NDArray[np.float32] | None, items: NDArray[np.int64]) -> NDArray[np.float32] | None:
    return None if row is None else row[items]


def verified(seen: list[Seen]) -> list[Seen]:
    """With rows that verify, other for each image."""
    rows = np.random.default_rng(3).standard_normal((len(seen), ITEMS)).astype(np.float32) + 2
    return [one._replace(verifying=row) for one, row in zip(seen, rows, strict=True)]


def windows(queries: int, every: int, start: int = 2000) -> list[NDArray[np.int64] | None]:
    """Items around the camera, others every so many queries."""
    middles = [start + query // every * every for query in range(queries)]
    return [np.arange(middle - 150, middle + 150) for middle in middles]


@pytest.fixture
def by_what_verifies(monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers are judged by what verifies them alone: the mean of the last images' sign."""
    last = VERIFIES * len(SPANS) + 1
    nothing = Trees(0.0, np.zeros((1, 1), np.int64), np.zeros((1, 1)), np.zeros((1, 2)))
    many = SIGNS * len(SPANS) + 1
    live, late = np.zeros(1 + many), np.zeros(1 + LATE_SIGNS * len(SPANS) + len(LONGER) + 2 + many)
    live[1 + last] = late[1 + last] = 1.0
    both = [Judges(nothing, one, np.zeros((2, len(ASKED)))) for one in (live, late)]
    monkeypatch.setattr("evplace.matchers._known.judges", lambda: both)
    monkeypatch.setattr("evplace.matchers._belief.FAR_APART_S", 0.0)


class Noting:
    """A matcher that keeps what it sees; whether it goes on with other items, is said."""

    causal = True

    def __init__(self, continuing: bool) -> None:
        self._continuing = continuing
        self.seen: list[tuple[NDArray[np.float32], Seen]] = []

    def follow(self, _: Route, distances: bool = False) -> Any:
        return _Continuing(self) if self._continuing else _Following(self)

    def learn(self, _: Route, rows: Any) -> Any: ...

    def in_hindsight(self, _: Route, rows: Any, seen: Any) -> Any: ...


class _Following:
    def __init__(self, by: Noting) -> None:
        self._by = by

    def step(self, row: NDArray[np.float32], seen: Seen) -> list[Answer]:
        self._by.seen.append((row, seen))
        return []

    def finish(self) -> list[Answer]:
        return []


class _Continuing(_Following):
    def continued(self, _: Route, came_from: Any) -> _Continuing:
        return _Continuing(self._by)


@pytest.mark.parametrize("continuing", [False, True])
def test_what_verifies_is_split_as_the_row_is(continuing: bool) -> None:
    """Of the items alone; where all are seen, those that were not compared are the least alike."""
    rows, seen = drive(4)
    seen = [*verified(seen[:3]), seen[3]]
    items = np.array([3, 1990, 2001, 4999])
    noting: Any = Noting(continuing)
    matched(noting, rows, seen, [items, None, items + 0, items])
    found = [one.verifying for _, one in noting.seen]
    assert found[3] is None
    for at in (0, 1, 2):
        whole, verifying = seen[at].verifying, found[at]
        assert whole is not None
        assert verifying is not None
        assert verifying.shape == noting.seen[at][0].shape
        if at == 1:
            np.testing.assert_array_equal(verifying, whole)
            continue
        np.testing.assert_array_equal(verifying if continuing else verifying[items], whole[items])
        if not continuing:
            assert (np.delete(verifying, items) == whole[items].min()).all()


@pytest.mark.parametrize("lag_s", [0.0, 2.0])
def test_what_verifies_goes_along_where_the_part_changes(lag_s: float, by_what_verifies: None) -> None:
    """Also that of images which wait for their answers."""
    rows, seen = drive(40)
    seen = verified(seen)
    wanted = matched(Bayes(lag_s=lag_s), rows, seen, [None] * 40)
    found = matched(Bayes(lag_s=lag_s), rows, seen, windows(40, 7))
    same = [one.item == other.item for one, other in zip(found, wanted, strict=True)]
    apart = np.array([one.score - other.score for one, other in zip(found, wanted, strict=True)])
    assert np.mean(same[10:]) > 0.9
    assert np.abs(apart[10:][same[10:]]).max() < 0.05
    assert np.std([one.score for one in found]) > 0.01


@pytest.mark.parametrize("lag_s", [0.0, 2.0])
def test_all_items_are_a_part_that_changes_nothing(lag_s: float, by_what_verifies: None) -> None:
    rows, seen = drive(30)
    seen = verified(seen)
    wanted = matched(Bayes(lag_s=lag_s), rows, seen, [None] * 30)
    found = matched(Bayes(lag_s=lag_s), rows, seen, [np.arange(ITEMS)] * 30)
    assert found == wanted


@pytest.mark.parametrize("every", [1, 7, 100])
@pytest.mark.parametrize("lag_s", [0.0, 2.0])
def test_the_belief_goes_along_where_the_part_changes(every: int, lag_s: float) -> None:
    rows, seen = drive()
    found = matched(Bayes(lag_s=lag_s), rows, seen, windows(80, every))
    assert [answer.query for answer in found] == list(range(80))
    wanted = matched(Bayes(lag_s=lag_s), rows, seen, [None] * 80)
    late = slice(10, None)
    off = np.array([answer.item for answer in found]) - [answer.item for answer in wanted]
    assert np.abs(off[late]).max() <= 2
    assert all(answer.score > 0.9 for answer in found[late])
    assert all(
        2000 - 150 <= other < 2080 + 150
        for answer in found
        if answer.estimate
        for other in answer.estimate.others
    )


def test_from_all_of_the_map_to_a_part_and_back() -> None:
    rows, seen = drive()
    whole: list[NDArray[np.int64] | None] = [None] * 20
    found = matched(Bayes(), rows, seen, [*whole, *windows(80, 5)[20:60], *whole])
    items = np.array([answer.item for answer in found])
    assert np.abs(items[10:] - 2000 - np.arange(10, 80)).max() <= 3


def test_a_belief_that_is_handed_on_is_the_same_belief() -> None:
    rows, seen = drive(20)
    following = Bayes().follow(road())
    for row, one in zip(rows, seen, strict=True):
        following.step(row, one)
    before = following._filter.belief
    items = np.arange(1900, 2200)
    part = Route(road().position[items], road().heading_deg[items], left_out=ITEMS - 300)
    after = following.continued(part, items)._filter.belief
    assert after.sum() == pytest.approx(1)
    np.testing.assert_allclose(after - after.min(), before[items] - before[items].min(), atol=1e-4)


@pytest.mark.parametrize("name", families.names("matchers"))
def test_any_matcher_finds_its_way_on_parts(name: str) -> None:
    """One that cannot go on with others sees what was not compared as the least alike."""
    rows, seen = drive()
    found = matched(families.make("matchers", name), rows + 5, seen, windows(80, 7))
    right = [abs(answer.item - 2000 - answer.query) <= 3 for answer in found if answer.item >= 0]
    assert len(right) > 60
    assert np.mean(right) > 0.95


def test_a_part_is_judged_as_if_all_of_the_map_were_compared() -> None:
    """The belief as of so many times as many items, the best of others a little higher."""
    ways = Ways.of(road(400))
    belief = np.full(400, 0.5 / 400)
    belief[100] += 0.5
    z = np.random.default_rng(0).standard_normal(400).astype(np.float32)
    alone, among = Reader(ways).find(belief, z), Reader(ways, left_out=400 * 9).find(belief, z)
    assert (alone.item, alone.mass) == (among.item, among.mass)
    mass = alone.mass
    tenfold = mass / (mass + 10 * (1 - mass))
    assert among.signs[2] == pytest.approx(np.log((tenfold + 1e-3) / (1 - tenfold + 1e-3)))
    assert alone.signs[1] - among.signs[1] == pytest.approx(RISE * np.log(10))
