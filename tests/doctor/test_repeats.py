"""Duplicates and quick repeats, against a plain twin."""

from __future__ import annotations

import numpy as np
import pytest
from examined import SIZE, found, merged, noise

from evplace.core.events import Events
from evplace.doctor import repeats
from evplace.doctor._subject import SOON_US


def plain(events: Events) -> tuple[int, int]:
    last: dict[tuple[int, int], tuple[int, bool]] = {}
    twice = soon = 0
    for t, x, y, p in zip(*(getattr(events, name).tolist() for name in ("t_us", "x", "y", "p")), strict=True):
        before = last.get((x, y))
        if before == (t, p):
            twice += 1
        elif before is not None and t - before[0] < SOON_US:
            soon += 1
        last[x, y] = (t, p)
    return twice, soon


@pytest.mark.parametrize("seed", range(4))
def test_against_a_plain_loop(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n = 3000
    events = Events.of(
        np.sort(rng.integers(0, 20_000, n)),
        rng.integers(0, 4, n),
        rng.integers(0, 4, n),
        rng.random(n) < 0.5,
        SIZE,
    )
    twice, soon = plain(events)
    assert found(repeats, events, "duplicates").value == pytest.approx(100 * twice / n)
    assert found(repeats, events, "quick repeats").value == pytest.approx(100 * soon / n)


@pytest.mark.parametrize(("share", "state"), [(0, "good"), (0.02, "look"), (1.0, "bad")])
def test_events_written_twice(share: float, state: str) -> None:
    events = noise(20_000, 1)
    again = merged(events, events[: int(share * len(events))])
    finding = found(repeats, again, "duplicates")
    assert finding.state == state
    assert finding.value == pytest.approx(100 * share / (1 + share), abs=0.1)


def test_bursts_of_pixels_name_the_refractory_period() -> None:
    burst = Events.of(np.arange(0, 100_000, 100), np.full(1000, 5), np.full(1000, 5), np.ones(1000), SIZE)
    finding = found(repeats, burst, "quick repeats")
    assert (finding.state, finding.advice) == ("look", "`refractory_us=1000`")
