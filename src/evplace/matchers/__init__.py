"""Score rows -> matches. One file a matcher; its name is the name that users give.

A score row holds one number for each map item (a place or a reference image); larger is better. A
distance d enters as the score -d. Items stand in the order in which the map's drive met them.

Each file holds `Settings`, a frozen dataclass; `PRESETS`, named Settings (may be empty); and
`matcher(settings, distances) -> Matcher`, where `distances` says that the scores are negated distances.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from evplace.core import families as plugs
from evplace.core import settings

Row = NDArray[np.floating[Any]]
"""(items,) scores of one query against every map item, larger is better."""

Rows = NDArray[np.floating[Any]]
"""(queries, items) score rows in the order of the queries."""


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


class Matcher(Protocol):
    """Remembers what a sequence needs; a fresh one for each traverse."""

    def step(self, row: Row) -> Answer | None:
        """Take the next query's row; say what is known by now, causally, or None while nothing is.

        A matcher that looks ahead (SeqSLAM) answers for an earlier query: see `Answer.query`.
        """

    def extend(self, rows: Rows) -> None:
        """Take the rows of many queries at once: the same as `step` on each, without a call for each.

        Any cutting of the rows into blocks gives the same `path`.
        """

    def path(self) -> Path:
        """The answers for all rows so far, in hindsight where the method has any."""


def open_matcher(name: str, preset: str | None = None, distances: bool = False, **values: object) -> Matcher:
    """A fresh matcher by name; `values` are its settings, over those of `preset`.

    Raises SettingsError for an unknown name, preset or setting; the text lists the known ones.
    """
    matcher: Matcher = plugs.load("matchers", name).matcher(_settings(name, preset, values), distances)
    return matcher


def resolved_settings(name: str, preset: str | None = None, **values: object) -> dict[str, Any]:
    """All settings of a matcher as plain values; raises as `open_matcher` does."""
    return settings.to_dict(_settings(name, preset, values))


def _settings(name: str, preset: str | None, values: dict[str, object]) -> object:
    kind, presets = plugs.settings_of("matchers", name)
    return settings.make(kind, values, settings.preset_of(f"the matcher '{name}'", presets, preset))
