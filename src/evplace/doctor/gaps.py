"""Gaps of the whole stream: events that the camera sent, or should have, and that are not in the file."""

from __future__ import annotations

from evplace.doctor._outcome import Finding, Outcome, State, counted
from evplace.doctor._silences import LEAP_US
from evplace.doctor._subject import AtTheEnd

OF = ("events",)

MUCH = 0.05
"""Share of the recording above which gaps are bad."""


class Check(AtTheEnd):
    """Asks the subject."""

    def outcome(self) -> Outcome:
        """Finding: gaps; value: their sum in seconds."""
        starts, ends = self._subject.gaps()
        if not len(starts):
            return Outcome([Finding("gaps", "good", 0.0, "s", "The stream of events has no gap.")])
        lengths = (ends - starts) / 1e6
        longest, total = int(lengths.argmax()), float(lengths.sum())
        if lengths[longest] * 1e6 > LEAP_US:
            return Outcome([_leap(float(self._subject.seconds(starts)[longest]), float(lengths[longest]))])
        state: State = "bad" if total > MUCH * self._subject.span_s else "look"
        sentence = (
            f"The whole sensor is silent {counted(len(starts), 'time', 'times')}, {total:.3f} s in all; the "
            f"longest is {lengths[longest]:.3f} s at {float(self._subject.seconds(starts)[longest]):.3f} s."
        )
        advice = "events are missing: check cable, hub and disk, or lower the event rate by the biases"
        return Outcome([Finding("gaps", state, total, "s", sentence, advice)])


def _leap(at_s: float, length_s: float) -> Finding:
    return Finding(
        "gaps", "bad", length_s, "s",
        f"The clock leaps ahead by {length_s:,.0f} s at {at_s:.3f} s: no event comes for over an hour.",
        "cut the recording there, or mend its times; check the `time_unit`",
    )  # fmt: skip
