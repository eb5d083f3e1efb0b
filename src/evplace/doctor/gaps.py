"""Gaps of the whole stream: events that the camera sent, or should have, and that are not in the file."""

from __future__ import annotations

from evplace.doctor._outcome import Finding, Outcome, State, counted
from evplace.doctor._subject import Subject
from evplace.events import Events

OF = ("events",)

MUCH = 0.05
"""Share of the recording above which gaps are bad."""


class Check:
    """Asks the subject."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject

    def see(self, events: Events) -> None:
        """Nothing: the subject notes silences."""

    def outcome(self) -> Outcome:
        """Finding: gaps; value: their sum in seconds."""
        starts, ends = self._subject.gaps()
        if not len(starts):
            return Outcome([Finding("gaps", "good", 0.0, "s", "The stream of events has no gap.")])
        lengths = (ends - starts) / 1e6
        longest, total = int(lengths.argmax()), float(lengths.sum())
        state: State = "bad" if total > MUCH * self._subject.span_s else "look"
        told = (
            f"The whole sensor is silent {counted(len(starts), 'time', 'times')}, {total:.3f} s in all; the "
            f"longest is {lengths[longest]:.3f} s at {float(self._subject.seconds(starts)[longest]):.3f} s."
        )
        advice = "events are missing: check cable, hub and disk, or lower the event rate by the biases"
        return Outcome([Finding("gaps", state, total, "s", told, advice)])
