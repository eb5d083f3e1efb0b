"""What examinations say: findings for people and programs, curves and maps for pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

State = Literal["bad", "look", "unknown", "good"]
STATES: tuple[State, ...] = ("bad", "look", "unknown", "good")
"""Worst first. unknown: the recording does not tell, for example because it is too short."""


@dataclass(frozen=True)
class Finding:
    """One thing that was measured, and what it means."""

    name: str
    state: State
    value: float | None
    """In `unit`; None where nothing could be measured."""
    unit: str
    sentence: str
    """What was found, for a person."""
    advice: str = ""
    """What to do; empty where nothing is needed."""


def counted(number: int, one: str, many: str) -> str:
    """1 fix, 2 fixes, 1,000 fixes."""
    return f"{number:,} {one if number == 1 else many}"


@dataclass(frozen=True)
class Curve:
    """A line over another quantity."""

    name: str
    """The picture's file name, without suffix."""
    title: str
    across: str
    """What runs along the horizontal axis, with its unit."""
    up: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    spans: Sequence[tuple[float, float, str]] = ()
    """Stretches to shade, all of one kind: from, to, what."""


@dataclass(frozen=True)
class Map:
    """A value for each pixel or region of the sensor."""

    name: str
    """The picture's file name, without suffix."""
    title: str
    label: str
    """What the colours stand for."""
    values: NDArray[np.float64]
    """(rows, columns); NaN where there is none."""
    marks: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    """(n, 2) column and row of what is to be circled."""
    pixels: int = 1
    """Side of a region in pixels."""
    top: float | None = None
    """The value at the top of the colours; None: the largest there is."""


@dataclass(frozen=True)
class Outcome:
    """What one examination gives."""

    findings: Sequence[Finding] = ()
    drawings: Sequence[Curve | Map] = ()


@dataclass(frozen=True)
class Examination:
    """All findings about one recording, the worst first."""

    path: str
    facts: dict[str, Any]
    """kind, format, width, height, events or frames, t_first_us, t_last_us."""
    findings: tuple[Finding, ...]
    drawings: tuple[Curve | Map, ...]
    fault: str | None
    """What broke the recording off; then its good part was examined."""

    def count(self, state: State) -> int:
        """How many findings are of this state."""
        return sum(finding.state == state for finding in self.findings)

    def named(self, name: str) -> Finding:
        """The finding of that name; KeyError where there is none."""
        return {finding.name: finding for finding in self.findings}[name]
