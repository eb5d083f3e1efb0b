"""What a localizer says of a whole drive: image by image as it would have said it live, or in hindsight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core import families
from evplace.core.errors import SettingsError
from evplace.core.tables import empty_rows, rows_of
from evplace.imaging.traverse import Traverse
from evplace.matchers import Answer, Path, RouteMatcher, Seen
from evplace.matchers._checks import check_path
from evplace.scorers import Rows, Verifies

if TYPE_CHECKING:
    from evplace.localizer import Localizer

BLOCK = 64
"""Images scored at once in hindsight."""
Answers = Literal["live", "hindsight"]
"""What the camera would have been told as it drove; or what is known once the drive is over."""


class Answered(NamedTuple):
    """What a localizer says of a whole traverse."""

    path: Path
    """One answer an image."""
    rows: Rows
    """(n, items) the score rows."""
    delay: int
    """Images that came before an answer was known, at most."""


class Answering:
    """A localizer's answers to a whole traverse, in blocks of images; see `Localizer.answers`.

    Iterating gives (k,) the numbers of the next images that hold events, and (k, items) their rows, which are
    not kept unless that is asked for, or the matcher needs them all at once.
    """

    def __init__(
        self,
        localizer: Localizer,
        query: Traverse,
        answers: Answers = "live",
        rows: Rows | None = None,
        keep: bool = False,
    ) -> None:
        """`rows` are given, as in `Localizer.answers`; or they are made, and where `keep` says so, kept."""
        if localizer._near[0] is not None:
            raise SettingsError("answers to a whole traverse compare all references: leave out `near_m`")
        localizer.map.require_same(query)
        localizer.reset()
        self._of, self._query, self._given = localizer, query, rows
        self._filled = np.flatnonzero(query.counts != 0)
        self._live, self._seen, self._done = answers == "live", list[Seen](), 0
        at_once = not self._live and isinstance(localizer.matcher, RouteMatcher)
        made = keep or at_once
        self.rows = empty_rows(len(query), len(localizer.map.items)) if rows is None and made else rows
        """(n, items), 0 for images without events; None where they are not kept."""
        self._verifying: Rows | None = None
        with families.blaming("matchers", localizer.matcher):
            alone = not self._live and not at_once
            self._matching = localizer.matcher.start(localizer._distances) if alone else None
        self.delay = 0
        """Images that came before an answer was known, at most, so far."""
        nothing = np.full(len(query), -1, np.int64), np.full(len(query), np.nan)
        self._known = Path(*nothing, np.zeros(len(query), np.bool_))

    def __iter__(self) -> Iterator[tuple[NDArray[np.int64], Rows]]:
        """Live, image by image, since the size of a batch may change the last bits of a score."""
        block = 1 if self._live else BLOCK
        while self._done < len(self._filled):
            part = self._filled[self._done : self._done + block]
            rows, seen = self._next(part)
            self._take(rows, seen)
            self._done += len(part)
            yield part, rows

    def path(self) -> Path:
        """The answers, once all images were taken: -1 where an image holds no events."""
        if self._live:
            self._note(self._of._finish())
            return self._known
        matcher, items = self._of.matcher, len(self._of.map.items)
        with families.blaming("matchers", matcher):
            found = self._hindsight()
        check_path(found, len(self._filled), items, matcher)
        for known, values in zip(self._known, found, strict=True):
            known[self._filled] = values
        self.delay = max(0, len(self._filled) - 1)
        return self._known

    @property
    def state(self) -> dict[str, Any]:
        """What another of the same localizer and traverse goes on from, live, by `resume`."""
        of, rows = self._of, None if self.rows is None else self.rows[: self._reached]
        return {
            "done": self._done, "delay": self.delay, "known": tuple(self._known), "rows": rows,
            "matcher": (of._following, of._seeing, of._stepped),
        }  # fmt: skip

    def resume(self, state: Mapping[str, Any]) -> None:
        """Go on from there."""
        self._done, self.delay = state["done"], state["delay"]
        for known, values in zip(self._known, state["known"], strict=True):
            known[:] = values
        if self.rows is not None:
            self.rows[: self._reached] = state["rows"]
        self._of._following, self._of._seeing, self._of._stepped = state["matcher"]

    @property
    def _reached(self) -> int:
        return int(self._filled[self._done - 1]) + 1 if self._done else 0

    def _next(self, part: NDArray[np.int64]) -> tuple[Rows, list[Seen]]:
        """The rows of the next images, and what is seen of them; no image is scored without need."""
        images, seen = self._of._shown(self._query, part)
        if self._given is None:
            rows, seen = self._of._scored(images, seen)
            if self.rows is not None:
                self.rows[part] = rows
            return rows, seen
        if isinstance(self._of.matcher, RouteMatcher) and isinstance(self._of.scorer, Verifies):
            seen = self._of._scored(images, seen)[1]
        return self._given[part], seen

    def _take(self, rows: Rows, seen: list[Seen]) -> None:
        """Show the matcher the next images."""
        if self._matching is not None:
            with families.blaming("matchers", self._of.matcher):
                self._matching.extend(rows)
        elif not self._live:
            self._seen += [self._kept(one, len(self._seen) + at) for at, one in enumerate(seen)]
        else:
            for row, one in zip(rows, seen, strict=True):
                at = self._of._stepped
                answers = self._of._step(row, one)
                self.delay = max([self.delay, *(at - answer.query for answer in answers)])
                self._note(answers)

    def _kept(self, seen: Seen, number: int) -> Seen:
        """What was seen of an image, with what verifies in a table that need not lie in memory."""
        if seen.verifying is None:
            return seen
        if self._verifying is None:
            self._verifying = empty_rows(len(self._filled), len(seen.verifying))
        self._verifying[number] = seen.verifying
        return seen._replace(verifying=self._verifying[number])

    def _note(self, answers: list[Answer]) -> None:
        for answer in answers:
            at = self._filled[answer.query]
            for known, value in zip(self._known, answer[1:4], strict=True):
                known[at] = value

    def _hindsight(self) -> Path:
        if self._matching is not None:
            return self._matching.path()
        assert self.rows is not None
        of = self._of
        assert isinstance(of.matcher, RouteMatcher)
        return of.matcher.in_hindsight(of._route, rows_of(self.rows, self._filled), self._seen)
