"""Windows of the chosen length in which nothing happens: their images would be blank."""

from __future__ import annotations

import numpy as np

from evplace.core.events import Events
from evplace.doctor._outcome import Finding, Outcome, State
from evplace.doctor._subject import Subject
from evplace.imaging.windows import MICROSECONDS

OF = ("events",)


class Check:
    """Counts the windows that hold an event; those without are what is left, however many."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._dt = subject.windows.seconds * MICROSECONDS
        self._start_us: int | None = None
        self._open = 0
        self._filled = 0

    def see(self, events: Events) -> None:
        """Step from one window that holds events to the next."""
        if self._start_us is None:
            self._start_us = int(events.t_us[0])
        at = 0
        while at < len(events):
            number = self._number(int(events.t_us[at]))
            self._filled += number != self._open
            self._open = number
            end_us = self._start_us + number * self._dt.numerator // self._dt.denominator
            at += int(np.searchsorted(events.t_us[at:], end_us, side="right"))

    def outcome(self) -> Outcome:
        """Finding: empty windows."""
        total = self._open
        if not total:
            return Outcome()
        share = 100 * (total - self._filled) / total
        mean = self._subject.parts / max(self._filled, 1)
        sentence = (
            f"{total - self._filled:,} of {total:,} windows of {self._subject.windows.dt} s hold no event; "
            f"the others hold {mean:,.0f} on average."
        )
        state: State = "good" if share < 1 else "look" if share < 10 else "bad"
        advice = "" if state == "good" else "choose a longer `dt`; `every_events` leaves empty ones out"
        return Outcome([Finding("empty windows", state, share, "%", sentence, advice)])

    def _number(self, t_us: int) -> int:
        """The window of a time, from 1 (Eq. 4: open on the left; the first event is put into window 1)."""
        assert self._start_us is not None
        past = (t_us - self._start_us) * self._dt.denominator
        return max(1, -(-past // self._dt.numerator))
