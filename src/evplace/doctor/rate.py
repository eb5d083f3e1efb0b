"""How many events come, over time, and of which sign."""

from __future__ import annotations

import numpy as np

from evplace.core.events import Events
from evplace.doctor._outcome import Curve, Finding, Outcome
from evplace.doctor._subject import BIN_US, Subject

OF = ("events",)

FEW_HZ = 0.05
"""Events a pixel gives in a second, below which an image holds hardly any."""
LOPSIDED = 0.05
"""Share of the rarer sign below which one sign seems to be missing."""


class Check:
    """Counts signs; the subject counts the rest."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._brighter = 0

    def see(self, events: Events) -> None:
        """Count the events that are brighter."""
        self._brighter += int(np.count_nonzero(events.p))

    def outcome(self) -> Outcome:
        """Findings: event rate, signs; the rate over time as a curve."""
        if not self._subject.parts:
            none = Finding(
                "event rate", "bad", 0.0, "events/s", "The recording holds no event.",
                "record anew; check that the lens cap is off and the camera was started",
            )  # fmt: skip
            return Outcome([none])
        t_us, rates = self._subject.activity()
        curve = Curve(
            "rate", "Event rate", "time in s", "million events/s", self._subject.seconds(t_us), rates / 1e6
        )
        return Outcome([self._rate(float(rates.min()), float(rates.max())), self._signs()], [curve])

    def _rate(self, least: float, most: float) -> Finding:
        subject = self._subject
        if subject.span_s == 0:
            sentence = "All events have one time: nothing that needs a time can be measured."
            return Finding("event rate", "bad", None, "events/s", sentence, "give the right `time_unit`")
        rate = subject.parts / subject.span_s
        sentence = f"{rate / 1e6:.3f} million events/s"
        if subject.span_s * 1e6 >= 2 * BIN_US:
            sentence += f"; in single tenths of a second from {least / 1e6:.3f} to {most / 1e6:.3f}"
        if rate < FEW_HZ * subject.counts.size:
            return Finding(
                "event rate", "look", rate, "events/s",
                f"{sentence}: little for {subject.counts.size:,} pixels.",
                "lower the camera's thresholds; check the unit of time and the lens",
            )  # fmt: skip
        return Finding("event rate", "good", rate, "events/s", f"{sentence}.")

    def _signs(self) -> Finding:
        share = self._brighter / self._subject.parts
        sentence = f"{100 * share:.0f} % of the events are brighter, {100 * (1 - share):.0f} % darker."
        if LOPSIDED <= share <= 1 - LOPSIDED:
            return Finding("signs", "good", 100 * share, "%", sentence)
        return Finding(
            "signs", "look", 100 * share, "%", f"{sentence} One sign is all but missing.",
            "binary images do not mind; else balance the camera's two thresholds, or check the file's signs",
        )  # fmt: skip
