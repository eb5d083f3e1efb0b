"""Lamps on the mains, which beat at 50 or 60 Hz and multiples, region by region."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Events
from evplace.doctor._outcome import Finding, Map, Outcome, State
from evplace.doctor._subject import Subject
from evplace.sources.cleaning import MAINS_HZ, FlickerMeter

OF = ("events",)

STRONG = 0.1
"""Agreement with a beat above which a region flickers: about a third of its events are a lamp's."""
CHANCE = 16.0
"""Times 1 / sqrt(pairs): what chance passes in one of ten million regions, from the first window on."""


class Check:
    """Passes the events on to the meter that cleaning uses."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject
        self._meter = FlickerMeter(subject.size)

    def see(self, events: Events) -> None:
        """Measure the next events."""
        self._meter.push(events)

    def outcome(self) -> Outcome:
        """Finding: flicker, by the share of the events that regions which flicker give; a map of it."""
        strengths = self._meter.strengths()
        known = np.isfinite(strengths[:, :, 0])
        if not known.any():
            sentence = "Cannot be determined: no region has enough events in whole quarters of a second."
            return Outcome([Finding("flicker", "unknown", None, "%", sentence)])
        best = np.where(known, np.max(strengths, axis=2, initial=0, where=known[:, :, None]), 0)
        pairs = np.maximum(self._meter.pairs(), 1)
        flickers = best > np.maximum(STRONG, CHANCE / np.sqrt(pairs))
        beats = np.where(flickers, np.argmax(np.nan_to_num(strengths), axis=2), -1)
        events = _of_regions(self._subject.counts, self._meter.region)
        drawing = Map(
            "flicker",
            "Flicker: agreement with the strongest beat of the mains",
            "0: none, 1: all events; white: too few",
            np.where(known, best, np.nan),
            pixels=self._meter.region,
            top=1,
        )
        return Outcome([_finding(beats, events)], [drawing])


def _finding(beats: NDArray[np.int64], events: NDArray[np.float64]) -> Finding:
    """`beats` (rows, columns) is each region's index in MAINS_HZ, -1 where it does not flicker."""
    share = 100 * float(events[beats >= 0].sum()) / max(float(events.sum()), 1.0)
    if not (beats >= 0).any():
        return Finding("flicker", "good", 0.0, "%", "No region beats with lamps on the mains.")
    weights = [float(events[beats == at].sum()) for at in range(len(MAINS_HZ))]
    beating = ", ".join(
        f"{MAINS_HZ[at]} Hz in {int((beats == at).sum())}" for at in np.argsort(weights)[::-1] if weights[at]
    )
    state: State = "good" if share < 1 else "look" if share < 20 else "bad"
    return Finding(
        "flicker", state, share, "%",
        f"Lamps beat at {beating} of {beats.size:,} regions, which give {share:.1f} % of the events.",
        "" if state == "good" else f"`flicker_hz={MAINS_HZ[int(np.argmax(weights))]}`",
    )  # fmt: skip


def _of_regions(counts: NDArray[np.int64], region: int) -> NDArray[np.float64]:
    """(rows, columns) events of each region of `region` x `region` pixels."""
    rows, columns = (np.arange(0, n, region) for n in counts.shape)
    return np.add.reduceat(np.add.reduceat(counts, rows, axis=0), columns, axis=1).astype(np.float64)
