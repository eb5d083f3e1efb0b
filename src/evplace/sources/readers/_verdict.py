"""Whether what was read can be a recording at all: bytes of another kind may decode, too."""

from __future__ import annotations

from collections.abc import Mapping

from evplace.core.events import Size

FASTEST = 1e9
"""Events a second that no camera sends."""
SLOWEST, LONG_S = 10.0, 3600.0
"""Events a second that every camera sends, by its noise alone, and for how many seconds it must not have."""
OR_ELSE = "or else it is no recording of this format"
OTHER_UNIT = f"give `time_unit=UNIT` if the unit of the times is another; {OR_ELSE}"
ENOUGH = 1000
"""Events that make a rate."""


def verdict(events: int, dropped: Mapping[str, int], span_us: int, size: Size) -> str | None:
    """Why this can hardly be a recording; None where nothing speaks against it."""
    left_out = sum(dropped.values())
    if left_out > events:
        most = max(dropped, key=lambda reason: dropped[reason])
        return f"{left_out:,} of {left_out + events:,} events were left out, most of which {_why(most, size)}"
    span_s = span_us / 1e6
    if events >= ENOUGH and span_s * FASTEST <= events:
        return f"{events:,} events in {span_s:.6g} s are more than a camera sends: {OTHER_UNIT}"
    if events and span_s >= LONG_S and events < SLOWEST * span_s:
        return f"{events:,} events in {span_s:,.0f} s are fewer than a camera sends: {OTHER_UNIT}"
    return None


def _why(reason: str, size: Size) -> str:
    """What is wrong with most of the events that were left out, and what to do."""
    return {
        "out_of_range": f"lie outside the sensor of {size[0]}x{size[1]} pixels: give `size` if it "
        f"is another; {OR_ELSE}",
        "backwards": f"are earlier than one before them: sort it by time if it was merged; {OR_ELSE}",
        "jump": f"came while the clock leapt away: its clock is broken; {OR_ELSE}",
        "untimed": f"have no time: it is cut off at its start; {OR_ELSE}",
    }[reason]
