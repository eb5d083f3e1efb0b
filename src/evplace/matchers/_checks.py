"""What a matcher must answer, whoever wrote it: PartError where it does not."""

from __future__ import annotations

import numpy as np

from evplace.core import families
from evplace.core.errors import PartError
from evplace.matchers import Answer, Matcher, Path


def check_answer(answer: object, queries: int, items: int, matcher: Matcher) -> None:
    """PartError where a step answers something else than None, or an item for one of the queries so far."""
    if answer is None:
        return
    if isinstance(answer, Answer) and 0 <= answer.query < queries and -1 <= answer.item < items:
        return
    raise PartError(
        f"{families.described('matchers', matcher)} must answer one of the {queries} queries so far with an "
        f"item of {items} or -1, it gave {answer!r}"
    )


def check_path(found: object, queries: int, items: int, matcher: Matcher) -> None:
    """PartError where a path is not one answer a query, of the map's items."""
    if isinstance(found, Path) and _is_whole(found, queries, items):
        return
    kind = type(found).__name__
    if isinstance(found, Path):
        kind = ", ".join(f"{np.asarray(column).dtype} {np.shape(column)}" for column in found)
    raise PartError(
        f"{families.described('matchers', matcher)} must answer each of {queries} queries with an item of "
        f"{items} or -1, a score, and whether it is accepted, it gave {kind}"
    )


def _is_whole(found: Path, queries: int, items: int) -> bool:
    item, score, accepted = np.asarray(found.item), np.asarray(found.score), np.asarray(found.accepted)
    kinds = (item.dtype.kind, score.dtype.kind, accepted.dtype.kind)
    shapes = {item.shape, score.shape, accepted.shape}
    return kinds == ("i", "f", "b") and shapes == {(queries,)} and bool(np.all((item >= -1) & (item < items)))
