"""Hot pixels: those that were made, and no others."""

from __future__ import annotations

import numpy as np
import pytest
from examined import SIZE, found, merged, noise, outcome

from evplace.core.events import Events
from evplace.doctor import Map, hot

HOT = [(3, 4), (40, 30), (63, 47)]


def fired(rate_hz: float, seconds: float) -> Events:
    parts = []
    for seed, (x, y) in enumerate(HOT):
        events = noise(rate_hz, seconds, seed)
        parts.append(Events.of(events.t_us, np.full(len(events), x), np.full(len(events), y), events.p, SIZE))
    return merged(*parts)


def test_known_hot_pixels_are_circled() -> None:
    scene = noise(30_000, 4)
    events = merged(scene, fired(1000, 4))
    finding = found(hot, events, "hot pixels")
    assert (finding.state, finding.advice) == ("look", "`mask_hot=True`")
    assert finding.value == pytest.approx(100 * 3000 / 33_000, rel=0.05)
    assert finding.sentence.startswith("3 of 3,072 pixels")
    (drawing,) = outcome(hot, events).drawings
    assert isinstance(drawing, Map)
    assert drawing.marks.tolist() == [[3, 4], [40, 30], [63, 47]]


def test_states_go_by_the_share_of_the_events() -> None:
    scene = noise(30_000, 4)
    assert found(hot, scene, "hot pixels").value == 0
    assert found(hot, merged(scene, fired(50, 4)), "hot pixels").state == "good"
    assert found(hot, merged(scene, fired(5000, 4)), "hot pixels").state == "bad"
