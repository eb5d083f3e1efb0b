"""Pixels that fire by themselves."""

from __future__ import annotations

import numpy as np

from evplace.doctor._outcome import Finding, Map, Outcome, State
from evplace.doctor._subject import AtTheEnd
from evplace.sources.cleaning import hot_pixels

OF = ("events",)


class Check(AtTheEnd):
    """Asks the counts of the whole file."""

    def outcome(self) -> Outcome:
        """Finding: hot pixels, by their share of the events; a map of the counts with them circled."""
        counts = self._subject.counts
        hot = hot_pixels(counts)
        number, share = int(hot.sum()), 100 * float(counts[hot].sum()) / max(float(counts.sum()), 1.0)
        state: State = "good" if share < 1 else "look" if share < 10 else "bad"
        sentence = f"{number:,} of {hot.size:,} pixels fire by themselves, with {share:.2f} % of the events."
        advice = "" if state == "good" else "`mask_hot=True`"
        rows, columns = np.nonzero(hot)
        drawing = Map(
            "hot_pixels",
            f"Events of each pixel; {number} hot ones circled",
            "events, log10(1 + n)",
            np.log10(1.0 + counts),
            np.column_stack([columns, rows]).astype(np.float64),
        )
        return Outcome([Finding("hot pixels", state, share, "%", sentence, advice)], [drawing])
