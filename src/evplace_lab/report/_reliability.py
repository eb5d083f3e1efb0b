"""How often an answer was right, by the probability that its matcher gave it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from evplace.evaluation import Result, reliability
from evplace_lab.report._html import Html, tag

SIDE, MARGIN = 240, 34
"""Pixels of a drawing's square, and around it."""
MOST_DRAWN = 12


def drawings(results: Mapping[str, Result]) -> Html | None:
    """One small drawing for each result whose matcher gives probabilities; None where none does."""
    found = {name: one for name, one in results.items() if one.is_probabilistic}
    if not found:
        return None
    figures = [_figure(name, one) for name, one in list(found.items())[:MOST_DRAWN]]
    words = (
        "Of the answers that were given a probability, the share that was right: on the line it is as said, "
        "below it too much was promised. The larger a dot, the more answers it stands for."
    )
    return tag("div", tag("p", words), tag("div", *figures, class_="small-multiples"))


def _figure(name: str, result: Result) -> Html:
    judged = result.judged
    bins = reliability(result.answers.score[judged], result.right[judged])
    bins = bins[bins[:, 2] > 0]
    dots = [_dot(said, right, many / bins[:, 2].max()) for said, right, many in bins.tolist()]
    whole = SIDE + 2 * MARGIN
    drawn = tag(
        "svg", _axes(), *dots, viewBox=f"0 0 {whole} {whole}", role="img", width=whole,
        aria_label=f"{name}: " + "; ".join(f"said {a:.0%}, right {b:.0%}" for a, b, _ in bins.tolist()),
    )  # fmt: skip
    return tag("figure", drawn, tag("figcaption", f"{name}, {result.timing}"))


def _axes() -> Html:
    """A square from 0 to 100 %, its diagonal, and what the axes are."""
    low, high = MARGIN, MARGIN + SIDE
    square = tag("rect", x=low, y=low, width=SIDE, height=SIDE, class_="frame")
    line = tag("line", x1=low, y1=high, x2=high, y2=low, class_="as-said")
    words = [
        tag("text", "0", x=low, y=high + 16, text_anchor="middle"),
        tag("text", "said, %", x=low + SIDE // 2, y=high + 28, text_anchor="middle"),
        tag("text", "100", x=high, y=high + 16, text_anchor="middle"),
        tag("text", "100", x=low - 5, y=low + 5, text_anchor="end"),
        tag("text", "right, %", x=low + 6, y=low + 16),
    ]  # fmt: skip
    return tag("g", square, line, *words)


def _dot(said: float, right: float, share: float) -> Html:
    x, y = MARGIN + SIDE * said, MARGIN + SIDE * (1 - right)
    radius = 3 + 9 * float(np.sqrt(share))
    return tag("circle", cx=f"{x:.1f}", cy=f"{y:.1f}", r=f"{radius:.1f}")
