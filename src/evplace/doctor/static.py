"""Regions of the sensor that hardly ever see a change: the bonnet, a vignette."""

from __future__ import annotations

import numpy as np

from evplace.doctor._outcome import Finding, Map, Outcome
from evplace.doctor._subject import AtTheEnd
from evplace.sources.cleaning import static_pixels

OF = ("events",)

ENOUGH = 5
"""Events of the median pixel below which a quiet region cannot be sentence apart from chance."""
MUCH = 5.0
"""Per cent of the sensor above which masking is worth a look."""

BLOCK = 0.8
"""Share of static pixels in the rectangle around all of them that makes it one block."""


class Check(AtTheEnd):
    """Asks the counts of the whole file."""

    def outcome(self) -> Outcome:
        """Finding: static regions, by their share of the sensor."""
        counts = self._subject.counts
        if np.median(counts) < ENOUGH:
            sentence = (
                f"Cannot be determined: half of the pixels have fewer than {ENOUGH} events; record longer."
            )
            return Outcome([Finding("static regions", "unknown", None, "%", sentence)])
        static = static_pixels(counts)
        share = 100 * float(static.mean())
        drawing = Map("static_regions", "Static regions", "1: static", static.astype(np.float64), top=1)
        sentence = f"{share:.1f} % of the sensor hardly ever see a change{_where(static)}."
        if share < MUCH:
            return Outcome([Finding("static regions", "good", share, "%", sentence)], [drawing])
        advice = "`static_mask=True`; a bonnet at the bottom can also be cut with `crop_bottom`"
        return Outcome([Finding("static regions", "look", share, "%", sentence, advice)], [drawing])


def _where(static: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> str:
    """Rows and columns, where the regions make up one block."""
    if not static.any():
        return ""
    rows, columns = np.nonzero(static)
    top, bottom, left, right = rows.min(), rows.max(), columns.min(), columns.max()
    if static[top : bottom + 1, left : right + 1].mean() < BLOCK:
        return ", in several places"
    return f", in rows {top} to {bottom}, columns {left} to {right}"
