"""What a scorer says by one of its descriptors alone reaches the matcher, image by image."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import pytest
from numpy.typing import NDArray

from evplace.core.errors import PartError
from evplace.imaging.traverse import Traverse
from evplace.localizer import Localizer, _drive
from evplace.matchers import Answer, Path, Route, Seen
from evplace.matchers.bayes import Bayes
from evplace.placemap import PlaceMap
from evplace.scorers import Content, Scored, references_of

Rows = NDArray[np.float32]


def rows_of(images: NDArray[np.uint8], items: NDArray[np.int64]) -> Rows:
    """Numbers that tell of which image they are, and of which item."""
    shown = images.reshape(len(images), -1)[:, :40].sum(axis=1, dtype=np.int64)
    return np.asarray(shown[:, None] * 100 + items, np.float32)


@dataclass(frozen=True)
class Telling:
    """A scorer that verifies with what it says negated, or with something that is wrong."""

    changed: Callable[[Rows], Any] = lambda rows: rows
    asked: list[int] = field(default_factory=list)
    """Images that were scored, call by call."""

    def open(self, content: Content) -> Any:
        return _Opened(self, np.arange(len(references_of(content))))


class _Opened:
    distances = False

    def __init__(self, settings: Telling, items: NDArray[np.int64]) -> None:
        self._settings, self._items = settings, items

    def rows(self, images: NDArray[np.uint8]) -> Rows:
        return self.scored(images).rows

    def scored(self, images: NDArray[np.uint8], items: NDArray[np.int64] | None = None) -> Scored:
        self._settings.asked.append(len(images))
        rows = rows_of(images, self._items if items is None else items)
        return Scored(rows, self._settings.changed(-rows))


@dataclass(frozen=True)
class Plain(Telling):
    """The same without any that verifies."""

    def open(self, content: Content) -> Any:
        opened = super().open(content)

        class Alone:
            distances = False
            rows = staticmethod(opened.rows)

        return Alone()


@dataclass(frozen=True)
class Noting:
    """A matcher that knows the route, and keeps what it sees."""

    causal: ClassVar[bool] = False
    rows: list[Rows] = field(default_factory=list)
    seen: list[Seen] = field(default_factory=list)

    def learn(self, route: Route, rows: Any) -> dict[str, Any]:
        raise NotImplementedError

    def follow(self, route: Route, distances: bool = False) -> _Noted:
        return _Noted(self)

    def in_hindsight(self, route: Route, rows: Rows, seen: Sequence[Seen]) -> Path:
        self.rows.extend(rows)
        self.seen.extend(seen)
        return Path.of([Answer(query, 0, 0.0, True) for query in range(len(rows))])


class _Noted:
    def __init__(self, by: Noting) -> None:
        self._by = by

    def step(self, row: Rows, seen: Seen) -> list[Answer]:
        self._by.rows.append(row)
        self._by.seen.append(seen)
        return [Answer(len(self._by.rows) - 1, 0, 0.0, True)]

    def finish(self) -> list[Answer]:
        return []


@pytest.fixture
def telling(image_map: PlaceMap) -> PlaceMap:
    return dataclasses.replace(image_map, scorer=Telling(), matcher=None, learned=None)


@pytest.fixture
def drive(night: Traverse) -> Traverse:
    """Some of its images hold no events."""
    counts = night.counts.copy()
    counts[[0, 10, 11, 37]] = 0
    return dataclasses.replace(night, counts=counts)


def wanted_of(place_map: PlaceMap, drive: Traverse) -> Rows:
    """(images with events, items)."""
    return rows_of(drive.images[drive.counts != 0], np.arange(len(place_map.items)))


def check(noting: Noting, wanted: Rows) -> None:
    np.testing.assert_array_equal(noting.rows, wanted)
    np.testing.assert_array_equal([one.verifying for one in noting.seen], -wanted)


def test_live_each_image_is_verified_by_its_own_row(telling: PlaceMap, drive: Traverse) -> None:
    noting = Noting()
    list(Localizer(telling, noting).match_traverse(drive))
    check(noting, wanted_of(telling, drive))
    again = Noting()
    Localizer(telling, again).answers(drive)
    check(again, wanted_of(telling, drive))


@pytest.mark.parametrize("in_a_file", [False, True])
def test_in_hindsight_the_rows_lie_in_one_table(
    telling: PlaceMap, drive: Traverse, in_a_file: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Which need not be in memory; an image without events has none."""
    monkeypatch.setattr(_drive, "BLOCK", 7)
    if in_a_file:
        monkeypatch.setattr("evplace.core.tables.MEMORY_BYTES", 0)
    noting = Noting()
    Localizer(telling, noting).answers(drive, "hindsight")
    check(noting, wanted_of(telling, drive))
    rows = [one.verifying for one in noting.seen if one.verifying is not None]
    apart = np.diff([row.__array_interface__["data"][0] for row in rows])
    assert (apart == rows[0].nbytes).all()
    assert isinstance(rows[0], np.memmap) == in_a_file


@pytest.mark.parametrize("answers", ["live", "hindsight"])
def test_rows_that_are_given_are_verified_all_the_same(
    telling: PlaceMap, drive: Traverse, answers: _drive.Answers
) -> None:
    noting, wanted = Noting(), wanted_of(telling, drive)
    rows = np.zeros((len(drive), len(telling.items)), np.float32)
    rows[drive.counts != 0] = wanted + 1
    Localizer(telling, noting).answers(drive, answers, rows)
    np.testing.assert_array_equal(noting.rows, wanted + 1)
    np.testing.assert_array_equal([one.verifying for one in noting.seen], -wanted)


@pytest.mark.parametrize("answers", ["live", "hindsight"])
def test_where_nothing_verifies_rows_that_are_given_are_not_made_again(
    image_map: PlaceMap, drive: Traverse, answers: _drive.Answers
) -> None:
    noting, scorer = Noting(), Plain()
    place_map = dataclasses.replace(image_map, scorer=scorer, matcher=None, learned=None)
    rows = np.zeros((len(drive), len(place_map.items)), np.float32)
    Localizer(place_map, noting).answers(drive, answers, rows)
    assert scorer.asked == []
    assert {one.verifying for one in noting.seen} == {None}
    assert len(noting.rows) == (drive.counts != 0).sum()


def test_a_matcher_that_knows_no_route_needs_nothing_verified(telling: PlaceMap, drive: Traverse) -> None:
    scorer: Any = telling.scorer
    rows = np.zeros((len(drive), len(telling.items)), np.float32)
    Localizer(telling, "best").answers(drive, "live", rows)
    assert scorer.asked == []


def test_what_a_matcher_sees_of_a_traverse_is_verified(telling: PlaceMap, drive: Traverse) -> None:
    seen, rows = Localizer(telling).seen_of(drive)
    wanted = rows_of(drive.images, np.arange(len(telling.items)))
    np.testing.assert_array_equal(rows, wanted)
    np.testing.assert_array_equal([one.verifying for one in seen], -wanted)


def test_near_a_position_what_is_near_is_verified(telling: PlaceMap, night: Traverse) -> None:
    """What was not compared is the least alike."""
    noting, where = Noting(), telling.items.position
    list(Localizer(telling, noting, near_m=20.0, track=night.track).match_traverse(night))
    wanted = wanted_of(telling, night)
    assert len(noting.seen) == len(night)
    for at, one in enumerate(noting.seen):
        near = np.hypot(*(where - night.xy[at]).T) <= 20
        assert one.verifying is not None
        other = one.verifying != -wanted[at]
        assert other.any()
        assert not other[near].any()
        assert (one.verifying[other] == one.verifying.min()).all()


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        (lambda rows: rows[:, :-1], r"it gave float32 \(1, 59\)$"),
        (
            lambda rows: np.where(rows == rows.max(), np.nan, rows),
            "it gave float32 .* with NaN or infinity$",
        ),
        (lambda rows: rows.astype(complex), "it gave complex"),
        (lambda _: None, "it gave NoneType$"),
    ],
)
def test_what_verifies_must_be_scores(
    image_map: PlaceMap, night: Traverse, changed: Callable[[Rows], Any], told: str
) -> None:
    """Live, in hindsight, and near a position: one line that names the scorer."""
    place_map = dataclasses.replace(image_map, scorer=Telling(changed), matcher=None, learned=None)
    with pytest.raises(PartError, match=told) as failed:
        list(Localizer(place_map, Noting()).match_traverse(night))
    assert "\n" not in str(failed.value)
    assert "the scorer 'Telling'" in str(failed.value)
    with pytest.raises(PartError, match="finite scores"):
        Localizer(place_map, Noting()).answers(night, "hindsight")
    with pytest.raises(PartError, match="finite scores"):
        list(Localizer(place_map, Noting(), near_m=20.0, track=night.track).match_traverse(night))


def test_hindsight_is_the_same_from_a_table_in_a_file(
    telling: PlaceMap, night: Traverse, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its rows are read by compiled loops."""
    inside = Localizer(telling, Bayes()).answers(night, "hindsight").path
    monkeypatch.setattr("evplace.core.tables.MEMORY_BYTES", 0)
    in_a_file = Localizer(telling, Bayes()).answers(night, "hindsight").path
    for one, other in zip(inside, in_a_file, strict=True):
        np.testing.assert_array_equal(one, other)
