"""A drive matched on a part of a map that changes as the drive goes on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.zscores import ordered, z_by
from evplace.matchers import Answer, Continuing, Following, Matcher, Route, Row, Seen
from evplace.matchers._drives import follow

Items = NDArray[np.int64]


class InParts:
    """A Following that is told before each row which items it is of."""

    def __init__(self, matcher: Matcher, route: Route, distances: bool) -> None:
        self._matcher, self._route, self._distances = matcher, route, distances
        many = len(route.position)
        self._usual = np.arange(many)[ordered(many)]
        self._items: Items | None = None
        self._following: Following | None = None
        self._continuing = True
        """Whether the matcher sees the items that are compared alone, and goes on with others."""

    def within(self, items: Items | None) -> Items | None:
        """Only these items, sorted, are compared from now on; None: all. Gives those that rows are to be of.

        These are those that tell what is usual on the map, and then the items. A matcher that cannot go on
        with others sees all items all the time, those that were not compared as the least alike.
        """
        if self._following is None:
            self._begin(items)
        elif self._continuing and not _same(items, self._items):
            assert isinstance(self._following, Continuing)
            came_from = _numbers_in(self._items, items, len(self._route.position))
            self._following = self._following.continued(_part(self._route, items), came_from)
        self._items = items
        return None if items is None else np.concatenate([self._usual, items])

    def step(self, row: Row, seen: Seen) -> list[Answer]:
        """See Following; the row has a score for each of the items that `within` gave."""
        following = self._following or self._begin(None)
        if self._items is None:
            return following.step(row, seen)
        usual, some = np.split(row, [len(self._usual)])
        verifying = None if seen.verifying is None else seen.verifying[len(self._usual) :]
        if self._continuing:
            seen = seen._replace(verifying=verifying)
            return self._of_map(following.step(z_by(usual, some), seen))
        seen = seen._replace(verifying=None if verifying is None else self._whole(verifying))
        return following.step(self._whole(some), seen)

    def finish(self) -> list[Answer]:
        """See Following."""
        return [] if self._following is None else self._of_map(self._following.finish())

    def _whole(self, some: Row) -> Row:
        """(items of the map,) those that were not compared as the least alike."""
        whole = np.full(len(self._route.position), some.min(), some.dtype)
        whole[self._items] = some
        return whole

    def _begin(self, items: Items | None) -> Following:
        following = follow(self._matcher, _part(self._route, items), self._distances)
        self._continuing = isinstance(following, Continuing)
        if items is not None and not self._continuing:
            following = follow(self._matcher, self._route, self._distances)
        self._following = following
        return following

    def _of_map(self, answers: list[Answer]) -> list[Answer]:
        """Answers with the numbers that items have in the map."""
        if self._items is None or not self._continuing:
            return answers
        return [_renumbered(answer, self._items) for answer in answers]


def _renumbered(answer: Answer, items: Items) -> Answer:
    estimate = answer.estimate
    if estimate is not None:
        estimate = estimate._replace(others=tuple(int(items[item]) for item in estimate.others))
    item = int(items[answer.item]) if answer.item >= 0 else -1
    return answer._replace(item=item, estimate=estimate)


def _part(route: Route, items: Items | None) -> Route:
    if items is None:
        return route
    times = None if route.t_us is None else route.t_us[items]
    return route._replace(
        position=route.position[items],
        heading_deg=route.heading_deg[items],
        t_us=times,
        left_out=len(route.position) - len(items),
    )


def _numbers_in(before: Items | None, now: Items | None, many: int) -> Items:
    """(now,) the number that each item had among those before, -1 where it was none of them."""
    then, here = (np.arange(many) if items is None else items for items in (before, now))
    at = np.minimum(np.searchsorted(then, here), len(then) - 1)
    return np.where(then[at] == here, at, -1)


def _same(one: Items | None, other: Items | None) -> bool:
    return one is other or (one is not None and other is not None and np.array_equal(one, other))
