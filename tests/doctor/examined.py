"""What the examinations' tests share: one examination of made events, and a made drive."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Events, Size
from evplace.doctor import Finding, Outcome, Subject
from evplace.imaging.windows import WindowSettings
from evplace.sources.tracks import Track

SIZE = (64, 48)


def outcome(
    part: ModuleType, events: Events, track: Track | None = None, dt: str = "1/30", packet: int = 100_000
) -> Outcome:
    """What one examination says about these events."""
    subject = Subject(Path("made"), "events", events.size, WindowSettings(dt), track)
    check = part.Check(subject)
    for start in range(0, len(events), packet):
        subject.see_events(events[start : start + packet])
        check.see(events[start : start + packet])
    found: Outcome = check.outcome()
    return found


def found(
    part: ModuleType, events: Events, name: str, track: Track | None = None, dt: str = "1/30"
) -> Finding:
    """The finding of that name."""
    return next(finding for finding in outcome(part, events, track, dt).findings if finding.name == name)


def at_times(t_us: NDArray[np.integer], seed: int = 0, size: Size = SIZE) -> Events:
    """Events at these times, anywhere."""
    rng, n = np.random.default_rng(seed), len(t_us)
    return Events.of(
        np.sort(t_us), rng.integers(0, size[0], n), rng.integers(0, size[1], n), rng.random(n) < 0.5, size
    )


def noise(rate_hz: float, seconds: float, seed: int = 0, size: Size = SIZE) -> Events:
    """Events at any time, anywhere."""
    rng = np.random.default_rng(seed)
    return at_times(rng.integers(0, int(seconds * 1e6), rng.poisson(rate_hz * seconds)), seed, size)


def merged(*parts: Events) -> Events:
    """All of them in the order of time."""
    whole = Events.concatenate(parts)
    order = np.argsort(whole.t_us, kind="stable")
    return Events(whole.t_us[order], whole.x[order], whole.y[order], whole.p[order], whole.size)


def road(t_s: NDArray[np.float64], metres: NDArray[np.float64]) -> Track:
    """A straight road."""
    return Track.local(np.round(t_s * 1e6).astype(np.int64), np.column_stack([metres, 0 * metres]))
