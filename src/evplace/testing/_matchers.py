"""What holds for every matcher."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from evplace.core import families, settings
from evplace.core.errors import ScoresError
from evplace.evaluation.sweeps import sweep
from evplace.matchers import Answer, Matcher, Path, Rows, Sweep, stepped
from evplace.matchers._checks import check_answer
from evplace.testing._require import check_settings, held_to_it, refusing, require

SIZES = [(0, 5), (1, 1), (40, 1), (30, 7), (40, 60)]
"""Queries and items of the tables that a matcher is tried on."""
BAD_SHAPES = [(3, 0), (4,), (1, 2, 2)]
"""Of what is no table of scores."""
POINTS = 5
"""Points of a curve that are run again."""


class _Table(NamedTuple):
    rows: Rows
    distances: bool
    what: str


def check_matcher(matcher: Matcher) -> None:
    """AssertionError where a matcher, with its settings, breaks what `evplace.matchers.Matcher` promises.

    It is tried on random scores, ties, a single item, a drive along the map, and the same as distances: any
    cutting of the rows gives one path, `step` gives the same path as `extend`, `causal` is as said, rows that
    cannot be are refused, and its curve is what it answers at each value.
    """
    check_settings("matchers", matcher)
    who = families.described("matchers", matcher)
    require(isinstance(getattr(matcher, "causal", None), bool), f"{who} must say whether it is 'causal'")
    gains = [_gains_by_hindsight(matcher, table, who) for table in _tables()]
    if matcher.causal:
        require(not any(gains), f"{who} says that it is causal, but its path is not what its steps have said")
    else:
        require(any(gains), f"{who} says that it is not causal, but its path is what its steps have said")
    _check_refusals(matcher, who)
    _check_sweep(matcher, who)


def _gains_by_hindsight(matcher: Matcher, table: _Table, who: str) -> bool:
    """Check one table; returns whether the path is anything but what the steps have said."""
    before = table.rows.copy()
    whole = _path(matcher, table, [len(table.rows)])
    require(np.array_equal(before, table.rows), f"{who} changes the rows that it is given")
    _check_path(whole, table, who)
    _require_same(
        whole, _path(matcher, table, [len(table.rows)]), f"{who} answers {table.what} anew each time"
    )
    for cuts in _cuttings(len(table.rows)):
        sizes = f"blocks of {', '.join(map(str, cuts[:5]))} ... rows"
        _require_same(whole, _path(matcher, table, cuts), f"{who} answers {table.what} otherwise in {sizes}")
    said, path = _said(matcher, table)
    _require_same(whole, path, f"{who} answers {table.what} otherwise by 'step' than by 'extend'")
    return not _same(whole, said)


def _path(matcher: Matcher, table: _Table, cuts: list[int]) -> Path:
    """The path after blocks of those sizes; asked for in the middle too, which must change nothing."""
    matching = matcher.start(table.distances)
    start = 0
    for size in cuts:
        matching.extend(table.rows[start : start + size])
        start += size
        if len(cuts) < 9 and start:
            matching.path()
    return matching.path()


def _said(matcher: Matcher, table: _Table) -> tuple[Path, Path]:
    """What the steps have said of each query, and the path after them."""
    matching = matcher.start(table.distances)
    seen = [0]

    def step(row: Rows) -> Answer | None:
        answer = matching.step(row)
        seen[0] += 1
        with held_to_it():
            check_answer(answer, seen[0], table.rows.shape[1], matcher)
        return answer

    return stepped(step, table.rows)[0], matching.path()


def _check_path(path: Path, table: _Table, who: str) -> None:
    queries, items = table.rows.shape
    require(isinstance(path, Path), f"the path of {who} must be a Path, it is {type(path).__name__}")
    for name, column, kind in zip(path._fields, path, (np.int64, np.float64, np.bool_), strict=True):
        require(
            isinstance(column, np.ndarray) and column.dtype == kind and column.shape == (queries,),
            f"the {name} of the path of {who} must be {np.dtype(kind)} ({queries},) for {table.what}",
        )
    require(
        np.all((path.item >= -1) & (path.item < items)),
        f"{who} answers {table.what} with an item beyond the {items} that there are",
    )
    require(not path.accepted[path.item < 0].any(), f"{who} accepts the answer that there is no item")


def _check_refusals(matcher: Matcher, who: str) -> None:
    """That NaN, infinity and what is no table of scores raise ScoresError, by `extend` and by `step`."""
    for bad in (np.nan, np.inf, -np.inf):
        rows = np.full((4, 3), 0.5)
        rows[2, 1] = bad
        with refusing(ScoresError, f"{who} must refuse rows with {bad} with ScoresError"):
            matcher.start().extend(rows)
        matching = matcher.start()
        matching.step(rows[0])
        with refusing(ScoresError, f"{who} must refuse a row with {bad} with ScoresError"):
            matching.step(rows[2])
    for shape in BAD_SHAPES:
        with refusing(ScoresError, f"{who} must refuse rows of shape {shape} with ScoresError"):
            matcher.start().extend(np.zeros(shape))
    matching = matcher.start()
    matching.extend(np.full((2, 3), 0.5))
    with refusing(ScoresError, f"{who} must refuse rows of another length than those before"):
        matching.extend(np.full((2, 4), 0.5))


def _check_sweep(matcher: Matcher, who: str) -> None:
    """That the usual curve names a setting, and is at each value what the matcher answers there."""
    found = matcher.sweep()
    require(isinstance(found, Sweep), f"the sweep of {who} must be a Sweep, it is {type(found).__name__}")
    names = [field.name for field in dataclasses.fields(type(matcher))]  # type: ignore[arg-type]
    require(found.parameter in names, f"{who} sweeps '{found.parameter}', which is none of its settings")
    rows = _drive(np.random.default_rng(1), 30, 25).astype(np.float32)
    with held_to_it():
        points = list(sweep(matcher, rows, answers="hindsight"))
    for value, path in points[:: max(1, len(points) // POINTS)]:
        changed = settings.make(type(matcher), {found.parameter: float(value)}, found.matcher)
        answered = _path(changed, _Table(rows, False, ""), [len(rows)])
        at = f"at {found.parameter} = {value}"
        _require_same(path, answered, f"{who} is swept to another answer than it gives {at}")


def _tables() -> Iterator[_Table]:
    rng = np.random.default_rng(0)
    for queries, items in SIZES:
        size = f"{queries} queries of {items} items"
        random = rng.uniform(0, 1, (queries, items))
        yield _Table(random.astype(np.float32), False, f"random float32 scores, {size},")
        yield _Table(-random, True, f"random float64 distances, {size},")
        yield _Table(np.full((queries, items), 0.5, np.float32), False, f"equal scores, {size},")
        yield _Table(_drive(rng, queries, items), False, f"a drive along the map, {size},")
        yield _Table(_drive(rng, queries, items) - 2, True, f"a drive by distances, {size},")


def _drive(rng: np.random.Generator, queries: int, items: int) -> Rows:
    """Scores up to 1 that are high where the query passes the map's items in their order."""
    rows = rng.uniform(0.05, 0.5, (queries, items))
    at = np.clip(np.arange(queries) - 3, 0, items - 1)
    rows[np.arange(queries), at] += rng.uniform(0, 0.5, queries)
    return rows


def _cuttings(queries: int) -> Iterator[list[int]]:
    """Sizes of blocks that make up all queries: one by one, by sevens with an empty one, and at random."""
    yield [1] * queries
    yield [0, *[7] * (queries // 7 + 1)]
    rng = np.random.default_rng(queries)
    yield [*rng.integers(0, 12, queries).tolist(), queries]


def _same(one: Path, other: Path) -> bool:
    return all(
        np.array_equal(mine, theirs, equal_nan=mine.dtype.kind == "f")
        for mine, theirs in zip(one, other, strict=True)
    )


def _require_same(one: Path, other: Path, sentence: str) -> None:
    require(_same(one, other), sentence)
