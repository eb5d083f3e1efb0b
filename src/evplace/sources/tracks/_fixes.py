"""Fixes: what every format of GPS log gives, and what is left out of it on the way to a track."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.sources._times import DAY_US

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Keep = Literal["before", "after", "both"]
"""Which side is right where a log's clock was set, or its positions leapt for good; of a clock also both."""

_SHOWN = 90
"""Characters of a line that are shown as an example."""


class Fix(NamedTuple):
    """One line of a log."""

    t_us: int
    latitude: float
    longitude: float
    heading_deg: float = np.nan
    speed: float = np.nan
    """The log's own, not computed from positions."""
    line: int = 0
    """Number of the line, point or message, from 1."""


class Losses:
    """What is left out of a log: how often for each reason, and the first of each."""

    def __init__(self) -> None:
        self.counts: dict[str, int] = {}
        """Reason -> number."""
        self._first: dict[str, str] = {}

    def add(self, reason: str, example: str, number: int = 1) -> None:
        """Count `number` more for a reason; the first example is kept."""
        self.counts[reason] = self.counts.get(reason, 0) + number
        self._first.setdefault(reason, example)

    def sentences(self) -> list[str]:
        """A sentence for each reason, with its example."""
        return [
            f"left out of the track: {number:,} {reason} (first {self._first[reason]})"
            for reason, number in self.counts.items()
        ]

    def __str__(self) -> str:
        """Appended to an error."""
        told = (f", {number} dropped: {reason}" for reason, number in self.counts.items())
        first = next(iter(self._first.values()), "")
        return "".join(told) + (f" (first {first})" if first else "")


def shown(text: str) -> str:
    """A line of a file as it may stand in a message: short, and nothing that moves a terminal's cursor."""
    plain = "".join(letter if letter.isprintable() else "?" for letter in text.strip()[: _SHOWN + 1])
    return plain if len(plain) <= _SHOWN else f"{plain[:_SHOWN]}..."


def line_of(lines: Sequence[str]) -> Callable[[int], str]:
    """What shows a line of a text file by its number."""
    return lambda number: f"line {number}: {shown(lines[number - 1])}"


def _numbered(number: int) -> str:
    return f"fix {number}"


@dataclass(frozen=True, slots=True, eq=False)
class Fixes:
    """Fixes in the order of the file, not yet checked."""

    t_us: NDArray[np.int64]
    """(N,) microseconds; since 1970 where the file has dates, else since midnight."""
    latitude: Floats
    """(N,) degrees, NaN where unknown."""
    longitude: Floats
    """(N,) degrees, NaN where unknown."""
    heading_deg: Floats
    """(N,) degrees clockwise from north, NaN where unknown."""
    speed: Floats = field(default_factory=lambda: np.zeros(0))
    """(N,) the log's own speed, NaN where unknown; empty where the log has none."""
    xy: Floats | None = None
    """(N, 2) metres in one plane; from the start for a local plane, else once the zone is known."""
    line: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    """(N,) where each stands in the file; empty where they stand one after the other."""
    show: Callable[[int], str] = _numbered
    """What stands at a line, for people."""
    dated: bool = True
    """Whether times count from 1970, not from the midnight before the first fix."""
    unit: str | None = None
    """The unit that the times were taken in, where the file does not say."""
    held_against: str = ""
    """What of the log's own its positions were held against as they go on, so that a drift shows."""
    losses: Losses = field(default_factory=Losses)
    """What the reader left out."""
    notes: list[str] = field(default_factory=list)
    """What was guessed or is remarkable, a sentence each."""
    fault: str | None = None
    """What broke the file off; these are the fixes before."""

    def __post_init__(self) -> None:
        n = len(self.t_us)
        if not len(self.speed):
            object.__setattr__(self, "speed", np.full(n, np.nan))
        if not len(self.line):
            object.__setattr__(self, "line", np.arange(1, n + 1))

    @classmethod
    def of(cls, fixes: Iterable[Fix], **about: Any) -> Fixes:
        """The fixes as arrays; `about` are the fields that are no columns."""
        t_us, latitude, longitude, heading, speed, line = list(zip(*fixes, strict=True)) or [()] * 6
        return cls(
            np.array(t_us, np.int64),
            np.array(latitude, np.float64),
            np.array(longitude, np.float64),
            np.array(heading, np.float64),
            np.array(speed, np.float64),
            line=np.array(line, np.int64),
            **about,
        )

    def __len__(self) -> int:
        return len(self.t_us)

    def __getitem__(self, part: NDArray[np.bool_] | NDArray[np.int64]) -> Fixes:
        columns = ("t_us", "latitude", "longitude", "heading_deg", "speed", "line")
        chosen = {name: getattr(self, name)[part] for name in columns}
        return replace(self, **chosen, xy=None if self.xy is None else self.xy[part])

    def without(self, bad: Bools, reason: str) -> Fixes:
        """The others; those where `bad` (N,) is True are counted, the first in the file is the example."""
        if not bad.any():
            return self
        self.losses.add(reason, self.show(int(self.line[bad].min())), int(bad.sum()))
        return self[~bad]


def unroll_days(t_us: NDArray[np.int64]) -> NDArray[np.int64]:
    """Times of day (N,) in microseconds that go on after midnight: a step back of over 12 h is a new day."""
    steps = np.diff(t_us, prepend=t_us[:1])
    return t_us + DAY_US * np.cumsum((steps < -DAY_US // 2).astype(np.int64))
