"""Events that a pixel gives twice: the same one again, and others too soon after."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.events import Events
from evplace.doctor._outcome import Finding, Outcome, State
from evplace.doctor._subject import Subject

OF = ("events",)

SOON_US = 1000
"""A pixel whose last event is less than so long ago repeats itself."""
MANY = 0.5
"""Share of repeats above which they are the greater part of the data."""


class Check:
    """Remembers each pixel's last event."""

    def __init__(self, subject: Subject) -> None:
        shape = (subject.size[1], subject.size[0])
        self._subject = subject
        self._last = np.full(shape, np.iinfo(np.int64).min // 2)
        self._twice = self._soon = 0

    def see(self, events: Events) -> None:
        """Count repeats among the next events."""
        twice, soon = _repeats(events.t_us, events.x, events.y, events.p, SOON_US, self._last)
        self._twice += twice
        self._soon += soon

    def outcome(self) -> Outcome:
        """Findings: duplicates, quick repeats."""
        total = max(self._subject.parts, 1)
        return Outcome([_twice(self._twice, total), _soon(self._soon, total)])


def _twice(number: int, total: int) -> Finding:
    if not number:
        return Finding("duplicates", "good", 0.0, "%", "No event comes twice.")
    share = 100 * number / total
    state: State = "good" if share < 0.1 else "look" if share < 5 else "bad"
    return Finding(
        "duplicates", state, share, "%",
        f"{number:,} of {total:,} events equal the one before them of their pixel: time, place and sign.",
        "" if state == "good" else "`refractory_us=1` drops them; look for packets that were written twice",
    )  # fmt: skip


def _soon(number: int, total: int) -> Finding:
    share = number / total
    sentence = f"{100 * share:.1f} % of the events follow one of their pixel within {SOON_US / 1000:g} ms."
    if share < MANY:
        return Finding("quick repeats", "good", 100 * share, "%", sentence)
    return Finding("quick repeats", "look", 100 * share, "%", sentence, f"`refractory_us={SOON_US}`")


@njit(cache=True)
def _repeats(
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
    soon_us: int,
    last: NDArray[np.int64],
) -> tuple[int, int]:
    """How many equal their pixel's last event, and how many others come within `soon_us` of it.

    `last` (H, W) is each pixel's last time, doubled, and one more where it became brighter: what is far apart
    in memory costs more than all else.
    """
    twice, soon = 0, 0
    for i in range(len(t_us)):
        now = t_us[i] << 1 | np.int64(p[i])
        before = last[y[i], x[i]]
        last[y[i], x[i]] = now
        if now == before:
            twice += 1
        elif t_us[i] - (before >> 1) < soon_us:
            soon += 1
    return twice, soon
