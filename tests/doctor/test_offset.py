"""The clocks' offset: recovered within its stated uncertainty, and not told where nothing tells it."""

from __future__ import annotations

import numpy as np
import pytest
from examined import SIZE, at_times, found, outcome, road
from numpy.typing import NDArray

from evplace.core.events import Events
from evplace.doctor import Curve, offset
from evplace.doctor._subject import mean_around
from evplace.doctor.offset import Fit, Offset
from evplace.sources.tracks import Track

Floats = NDArray[np.float64]

PAD_S = 60


def speed(rng: np.random.Generator, seconds: float) -> Floats:
    """Every tenth of a second: a car in a town, with stops."""
    n = int(seconds * 10)
    wanted = np.repeat(rng.choice([0.0, 5.0, 8.0, 12.0, 15.0], n // 150 + 1), 150)[:n]
    mps, now = np.empty(n), 8.0
    for at in range(n):
        now = max(now + min(max(wanted[at] - now, -0.25), 0.15), 0.0)
        mps[at] = now
    return mps


def texture(rng: np.random.Generator, mps: Floats) -> Floats:
    """What the scene adds: a factor that changes with the way, over some 30 m."""
    metres = np.cumsum(mps) * 0.1
    steps = rng.normal(size=int(metres[-1]) + 200)
    rough = mean_around(steps, 30) * np.sqrt(61) * 0.5
    return np.exp(np.interp(metres, np.arange(len(rough)), rough))


def case(
    seed: int, seconds: int = 300, related: bool = True, added_s: float | None = None
) -> tuple[float, Fit | str]:
    """The true offset and the fit of an activity to a track at 1 Hz with noise."""
    rng = np.random.default_rng(seed)
    mps = speed(rng, seconds + 2 * PAD_S)
    seen = mps if related else speed(rng, seconds + 2 * PAD_S)
    activity = rng.poisson((200 + 2000 * seen) * texture(rng, seen)) * 10.0
    true_s = rng.uniform(-8, 8) if added_s is None else added_s
    t_s = np.arange(len(mps)) * 0.1 - PAD_S
    here = (t_s >= 0) & (t_s < seconds)
    fixes_s = np.arange(1.0 - PAD_S, seconds + PAD_S - 1)
    metres = np.interp(fixes_s, t_s + 0.1, np.cumsum(mps) * 0.1) + rng.normal(0, 0.3, len(fixes_s))
    t_us = np.round(t_s[here] * 1e6).astype(np.int64) + 50_000
    return true_s, Fit.of(t_us, mean_around(activity, 5)[here], road(fixes_s - true_s, metres))


def offset_of(fit: Fit | str) -> Offset | None:
    found = fit if isinstance(fit, str) else fit.offset()
    return None if isinstance(found, str) else found


def test_the_stated_uncertainty_covers_the_truth() -> None:
    """95 % is stated; of 20 drives, chance leaves fewer than 17 covered in two cases of a hundred."""
    cases = [case(seed) for seed in range(20)]
    offsets = [(true_s, offset_of(fit)) for true_s, fit in cases]
    sure = [(true_s, found) for true_s, found in offsets if found is not None]
    assert len(sure) >= 16
    covered = [abs(found.seconds - true_s) <= found.uncertainty_s for true_s, found in sure]
    assert np.mean(covered) >= 17 / 20
    assert np.median([found.uncertainty_s for _, found in sure]) < 1.0
    assert np.median([abs(found.seconds - true_s) for true_s, found in sure]) < 0.25


def test_of_unrelated_drives_hardly_any_offset_is_told() -> None:
    assert sum(offset_of(case(seed, 150, related=False)[1]) is not None for seed in range(12)) <= 1


def test_a_longer_recording_is_surer() -> None:
    halves = [offset_of(case(3, seconds, added_s=1.0)[1]) for seconds in (300, 1200)]
    assert halves[0] is not None
    assert halves[1] is not None
    assert halves[1].uncertainty_s < halves[0].uncertainty_s


def drive(added_s: float) -> tuple[Events, Track]:
    """Events, a tenth as many as usual, and the track whose times lack `added_s`."""
    rng = np.random.default_rng(5)
    mps = speed(rng, 240)
    counts = rng.poisson((10 + 30 * mps) * texture(rng, mps) / 10)
    t_us = np.repeat(np.arange(len(mps)) * 100_000, counts) + rng.integers(0, 100_000, counts.sum())
    t_s = np.arange(0, 240.0)
    metres = np.interp(t_s, np.arange(len(mps)) * 0.1 + 0.1, np.cumsum(mps) * 0.1)
    return at_times(t_us), road(t_s - added_s, metres)


@pytest.mark.parametrize(("added_s", "state"), [(0.0, "good"), (-6.0, "bad"), (6.0, "bad")])
def test_the_finding_tells_what_to_add(added_s: float, state: str) -> None:
    events, track = drive(added_s)
    finding = found(offset, events, "clock offset", track)
    assert finding.state == state
    assert finding.value == pytest.approx(added_s, abs=1.0)
    assert ("`offset_us`" in finding.advice) == (state == "bad")
    (curve,) = outcome(offset, events, track).drawings
    assert isinstance(curve, Curve)
    assert curve.x[np.argmax(curve.y)] == pytest.approx(added_s, abs=1.0)
    assert curve.spans[0][0] < curve.spans[0][1]


@pytest.mark.parametrize("added_s", [18.0, -18.0])
def test_leap_seconds_are_named(added_s: float) -> None:
    events, track = drive(added_s)
    finding = found(offset, events, "clock offset", track)
    assert "GPS time is 18 s, the leap seconds, ahead of UTC" in finding.sentence
    assert "leap" not in found(offset, *drive(6.0)[:1], "clock offset", drive(6.0)[1]).sentence


def test_what_cannot_be_told_is_said() -> None:
    events, track = drive(0.0)
    t_s = np.arange(0, 240.0)
    for odd, why in [
        (road(t_s, 10 * t_s), "the speed hardly changes"),
        (road(t_s + 10_000, t_s), "share less than 60 s"),
        (road(t_s[:1], t_s[:1]), "share less than 60 s"),
    ]:
        finding = found(offset, events, "clock offset", odd)
        assert (finding.state, finding.value) == ("unknown", None)
        assert why in finding.sentence
    short = found(offset, events[: len(events) // 8], "clock offset", track)
    assert "60 s" in short.sentence
    assert found(offset, Events.empty(SIZE), "clock offset", track).state == "unknown"
    assert not outcome(offset, events).findings


def test_an_even_stream_of_events_tells_nothing() -> None:
    events = at_times(np.arange(0, 240_000_000, 5_000))
    assert found(offset, events, "clock offset", drive(0.0)[1]).state == "unknown"
