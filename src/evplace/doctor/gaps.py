"""Stretches in which the whole sensor is silent although it was busy just before and after."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.doctor._outcome import Finding, Outcome, State, counted
from evplace.doctor._subject import BIN_US, Subject
from evplace.events import Events

OF = ("events",)

SHORTEST_US = 20_000
"""A shorter silence is none: a lamp alone, without any other event, leaves 10 ms between its flashes."""
MISSED = 50
"""Events that should have come, by the rate before and after, for a silence to be a gap."""


class Check:
    """Remembers silences; which of them are gaps is told at the end."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._last_us: int | None = None
        self._starts: list[NDArray[np.int64]] = []
        self._ends: list[NDArray[np.int64]] = []

    def see(self, events: Events) -> None:
        """Note the silences before and between these events."""
        t_us = events.t_us
        if self._last_us is not None and t_us[0] - self._last_us >= SHORTEST_US:
            self._starts.append(np.array([self._last_us]))
            self._ends.append(t_us[:1].copy())
        after = np.flatnonzero(np.diff(t_us) >= SHORTEST_US)
        if len(after):
            self._starts.append(t_us[after])
            self._ends.append(t_us[after + 1])
        self._last_us = int(t_us[-1])

    def outcome(self) -> Outcome:
        """Finding: gaps; value: their sum in seconds."""
        starts, ends = (np.concatenate([np.zeros(0, np.int64), *part]) for part in (self._starts, self._ends))
        gaps = _sudden(starts, ends, self._subject)
        starts, ends = starts[gaps], ends[gaps]
        return Outcome([_finding(starts, ends, self._subject)])


def _sudden(starts: NDArray[np.int64], ends: NDArray[np.int64], subject: Subject) -> NDArray[np.bool_]:
    """(n,) which silences are gaps: at the lower rate of before and after, MISSED events should have come."""
    _, counts = subject.rates.laid_out()
    if not len(counts):
        return np.zeros(0, np.bool_)
    first = np.minimum((starts - subject.t_first_us) // BIN_US, len(counts) - 1)
    last = np.minimum((ends - subject.t_first_us) // BIN_US, len(counts) - 1)
    before = np.maximum(counts[np.maximum(first - 1, 0)], counts[first])
    after = np.maximum(counts[last], counts[np.minimum(last + 1, len(counts) - 1)])
    return np.asarray(np.minimum(before, after) * ((ends - starts) / BIN_US) >= MISSED, np.bool_)


def _finding(starts: NDArray[np.int64], ends: NDArray[np.int64], subject: Subject) -> Finding:
    if not len(starts):
        return Finding("gaps", "good", 0.0, "s", "The stream of events has no gap.")
    lengths = (ends - starts) / 1e6
    longest = int(np.argmax(lengths))
    total = float(lengths.sum())
    state: State = "bad" if total > 0.05 * subject.span_s else "look"
    return Finding(
        "gaps", state, total, "s",
        f"The whole sensor is silent {counted(len(starts), 'time', 'times')}, {total:.3f} s in all; the "
        f"longest is {lengths[longest]:.3f} s at {float(subject.seconds(starts)[longest]):.3f} s: events are "
        "missing.",
        "check cable, hub and disk, or lower the event rate (biases); --every-events N leaves gaps out",
    )  # fmt: skip
