"""Regions of the sensor that hardly ever see a change: the bonnet, a vignette."""

from __future__ import annotations

import numpy as np

from evplace.cleaning import static_pixels
from evplace.doctor._outcome import Finding, Outcome
from evplace.doctor._subject import Subject
from evplace.events import Events

OF = ("events",)

ENOUGH = 5
"""Events of the median pixel below which a quiet region cannot be told from chance."""
MUCH = 5.0
"""Per cent of the sensor above which masking is worth a look."""


class Check:
    """Asks the counts of the whole file."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject

    def see(self, events: Events) -> None:
        """Nothing: the subject counts."""

    def outcome(self) -> Outcome:
        """Finding: static regions, by their share of the sensor."""
        counts = self._subject.counts
        if np.median(counts) < ENOUGH:
            told = f"Cannot be told: half of the pixels have fewer than {ENOUGH} events; record longer."
            return Outcome([Finding("static regions", "unknown", None, "%", told)])
        static = static_pixels(counts)
        share = 100 * float(static.mean())
        told = f"{share:.1f} % of the sensor hardly ever see a change{_where(static)}."
        if share < MUCH:
            return Outcome([Finding("static regions", "good", share, "%", told)])
        advice = "--static-mask; a bonnet at the bottom can also be cut with --crop-bottom"
        return Outcome([Finding("static regions", "look", share, "%", told, advice)])


def _where(static: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> str:
    if not static.any():
        return ""
    rows, columns = np.nonzero(static)
    return f", in rows {rows.min()} to {rows.max()}, columns {columns.min()} to {columns.max()}"
