"""What is kept of each pixel, in one number, against a plain loop: also over hours and leaps of the clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from evplace.core.events import Events
from evplace.doctor._subject import AGO_US, SOON_US, STAMPS_US, Subject
from evplace.imaging.windows import WindowSettings

STEPS = st.sampled_from([0, 1, SOON_US - 1, SOON_US, AGO_US, STAMPS_US - 1, STAMPS_US, 10**15])


def plain(events: Events) -> tuple[int, int, list[list[int]]]:
    last: dict[tuple[int, int], tuple[int, bool]] = {}
    twice, soon, counts = 0, 0, [[0, 0], [0, 0]]
    for t, x, y, p in zip(*(getattr(events, name).tolist() for name in ("t_us", "x", "y", "p")), strict=True):
        before = last.get((x, y))
        twice += before == (t, p)
        soon += before is not None and before != (t, p) and t - before[0] < SOON_US
        counts[y][x] += 1
        last[x, y] = (t, p)
    return twice, soon, counts


@settings(deadline=None)
@given(
    st.integers(-(10**12), 10**12),
    st.lists(st.tuples(STEPS, st.integers(0, 1), st.integers(0, 1), st.booleans()), min_size=1, max_size=40),
    st.integers(1, 7),
)
@example(0, [(0, 0, 0, True), (STAMPS_US - 1, 0, 0, True), (SOON_US, 0, 0, True)], 7)
@example(0, [(0, 0, 0, True), (STAMPS_US - 1, 0, 0, True), (SOON_US - 1, 0, 0, True)], 7)
@example(0, [(1, 0, 1, True)] * 5000 + [(1, 1, 1, True)] * 2047, 7)
def test_against_a_plain_loop(start_us: int, rows: list[tuple[int, int, int, bool]], packet: int) -> None:
    steps, x, y, p = (np.array(column) for column in zip(*rows, strict=True))
    events = Events.of(start_us + np.cumsum(steps), x, y, p, (2, 2))
    subject = Subject(Path("made"), "events", (2, 2), WindowSettings())
    for start in range(0, len(events), packet):
        subject.see_events(events[start : start + packet])
    assert (subject.twice, subject.soon, subject.counts.tolist()) == plain(events)
