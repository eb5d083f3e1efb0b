"""Each fast loop against a plain twin, and what each filter is for."""

from __future__ import annotations

import numpy as np
import pytest

from evplace.core.errors import RecordingError, SettingsError
from evplace.core.events import Events
from evplace.sources.cleaning import (
    FlickerFilter,
    FlickerMeter,
    Refractory,
    count_pixels,
    hot_pixels,
    static_pixels,
    without,
)

SIZE = (32, 24)


def noise(n: int = 3000, seconds: float = 1.0, seed: int = 0, size: tuple[int, int] = SIZE) -> Events:
    rng = np.random.default_rng(seed)
    times = np.sort(rng.integers(0, int(seconds * 1e6), n))
    return Events.of(
        times, rng.integers(0, size[0], n), rng.integers(0, size[1], n), rng.random(n) < 0.5, size
    )


def lamp(frequency_hz: float, seconds: float, x: int, y: int, phase_us: int = 0) -> Events:
    """One event brighter and, half a period later, one darker in every period."""
    n = int(seconds * frequency_hz)
    rise = (np.arange(n) * 1e6 / frequency_hz).astype(np.int64) + phase_us
    times = np.stack([rise, rise + int(5e5 / frequency_hz)], axis=1).ravel()
    return Events.of(times, np.full(2 * n, x), np.full(2 * n, y), np.tile([True, False], n), SIZE)


def merged(*parts: Events) -> Events:
    whole = Events.concatenate(parts)
    order = np.argsort(whole.t_us, kind="stable")
    return Events(whole.t_us[order], whole.x[order], whole.y[order], whole.p[order], whole.size)


def packets(events: Events, size: int) -> list[Events]:
    return [events[start : start + size] for start in range(0, len(events), size)]


def same(a: Events, b: Events) -> bool:
    return all(np.array_equal(getattr(a, name), getattr(b, name)) for name in ("t_us", "x", "y", "p"))


def test_counts_against_numpy() -> None:
    events = noise()
    twin = np.zeros(SIZE[::-1], np.int64)
    np.add.at(twin, (events.y, events.x), 1)
    assert (count_pixels(packets(events, 700), SIZE) == twin).all()


def hot_twin(counts: np.ndarray, ratio: float, min_events: int) -> np.ndarray:
    third = np.zeros_like(counts)
    for row, column in np.ndindex(counts.shape):
        top, left = (
            int(np.clip(at - 2, 0, n - 5)) for at, n in zip((row, column), counts.shape, strict=True)
        )
        block = counts[top : top + 5, left : left + 5].ravel()
        third[row, column] = np.sort(np.delete(block, (row - top) * 5 + column - left))[-3]
    return (counts >= max(ratio * np.median(counts), min_events)) & (counts > ratio * third)


@pytest.mark.parametrize("seed", range(5))
def test_hot_pixels_against_numpy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    counts = rng.poisson(10, SIZE[::-1]).astype(np.int64) * rng.choice([1, 1, 1, 8], SIZE[::-1])
    for ratio in (1.5, 3.0):
        assert (hot_pixels(counts, ratio, 5) == hot_twin(counts, ratio, 5)).all()


def test_hot_pixels_are_found_alone_in_pairs_and_in_corners_but_edges_stay() -> None:
    counts = np.random.default_rng(1).poisson(40, (60, 80)).astype(np.int64)
    counts[30, :] = 2000  # an edge that stays in view
    hot = [(5, 5), (5, 6), (0, 0), (59, 79), (45, 20)]
    for pixel in hot:
        counts[pixel] = 900
    assert set(zip(*map(tuple, np.nonzero(hot_pixels(counts))), strict=True)) == set(hot)


def test_half_a_percent_of_hot_pixels_goes() -> None:
    rng = np.random.default_rng(2)
    counts = rng.poisson(rng.gamma(4, 10, (120, 160))).astype(np.int64)
    truly = rng.random(counts.shape) < 0.005
    counts[truly] += rng.integers(1000, 5000, truly.sum())
    found = hot_pixels(counts)
    assert (found & truly).sum() >= 0.99 * truly.sum()
    assert (found & ~truly).sum() <= 2


def test_few_events_make_no_hot_pixel() -> None:
    counts = np.zeros((10, 10), np.int64)
    counts[4, 4] = 19
    assert not hot_pixels(counts).any()
    counts[4, 4] = 20
    assert hot_pixels(counts).sum() == 1


def test_static_regions_are_those_without_change() -> None:
    counts = np.full((50, 70), 100, np.int64)
    counts[32:] = 3
    mask = static_pixels(counts)
    assert mask[32:].all()
    assert not mask[:32].any()


def test_without_a_mask_against_numpy() -> None:
    events, mask = noise(), np.random.default_rng(4).random(SIZE[::-1]) < 0.3
    keep = ~mask[events.y, events.x]
    kept = without(events, mask)
    assert (kept.t_us == events.t_us[keep]).all()
    assert not mask[kept.y, kept.x].any()


@pytest.mark.parametrize("packet", [1, 7, 5000])
def test_refractory_against_a_plain_loop(packet: int) -> None:
    events = noise()
    last: dict[tuple[int, int], int] = {}
    keep = []
    for t, x, y in zip(events.t_us.tolist(), events.x.tolist(), events.y.tolist(), strict=True):
        keep.append((x, y) not in last or t - last[x, y] >= 200_000)
        if keep[-1]:
            last[x, y] = t
    twin = events.t_us[np.array(keep)]
    filter_ = Refractory(SIZE, 200_000)
    kept = Events.concatenate([filter_.push(part) for part in packets(events, packet)])
    assert (kept.t_us == twin).all()


def strengths_twin(events: Events, frequency: int, region: int, window_us: int) -> np.ndarray:
    window = (events.t_us - events.t_us[0]) // window_us
    since = (events.t_us - events.t_us[0]) % window_us
    place = events.y // region * -(-SIZE[0] // region) + events.x // region
    sign = np.where(events.p, 1.0, -1.0)
    beside = 2_000_000 // window_us
    agreement = []
    for tooth in (frequency, frequency - beside, frequency + beside):
        z = np.exp(2j * np.pi * (since // 4 * 4 * tooth) / 1e6)
        z = sign * (np.rint(127 * z.real) + 1j * np.rint(127 * z.imag)) / 127
        power, pairs = np.zeros(place.max() + 1), np.zeros(place.max() + 1)
        for w in range(window.max()):
            here = window == w
            n = np.bincount(place[here], minlength=len(pairs))
            real = np.bincount(place[here], z[here].real, len(pairs))
            imag = np.bincount(place[here], z[here].imag, len(pairs))
            power += real**2 + imag**2 - n
            pairs += n * (n - 1.0)
        agreement.append(power / pairs)
    comb = agreement[0] - (agreement[1] + agreement[2]) / 2
    return np.where(pairs >= 1000, np.clip(comb, 0, 1), np.nan)


@pytest.mark.parametrize("packet", [13, 100_000])
def test_flicker_strength_against_numpy(packet: int) -> None:
    events = merged(noise(4000, 1.3), lamp(100, 1.3, 3, 3))
    meter = FlickerMeter(SIZE, (50, 100), region=8)
    for part in packets(events, packet):
        meter.push(part)
    found = meter.strengths()
    assert found.shape == (3, 4, 2)
    for at, frequency in enumerate((50, 100)):
        twin = strengths_twin(events, frequency, 8, 250_000)
        np.testing.assert_allclose(found[:, :, at].ravel(), twin, atol=1e-9)


def test_a_lamp_is_measured_where_it_is_and_at_its_own_frequency() -> None:
    lamps = [lamp(100.2, 2, x, y, phase_us=300 * (x % 3)) for x in range(16, 24) for y in range(8)]
    meter = FlickerMeter(SIZE, region=8)
    meter.push(merged(noise(3000, 2), *lamps))
    found = meter.strengths()
    assert found[0, 2, 2] > 0.7
    others = found.copy()
    others[0, 2, 2] = 0
    others[0, 2, 4:] = 0  # 200 and 240 Hz: the harmonic of a beat that is no sine
    assert np.nanmax(others) < 0.1


def test_a_passing_edge_is_no_flicker() -> None:
    times = np.sort(np.random.default_rng(5).integers(0, 4000, 500)) + 100_000
    burst = Events.of(times, [0] * 500, [0] * 500, [1] * 500, SIZE)
    end = Events.of([300_000], [31], [23], [True], SIZE)
    meter = FlickerMeter(SIZE, region=8)
    meter.push(merged(Events.of([0], [31], [23], [True], SIZE), burst, end))
    assert np.nanmax(meter.strengths()[0, 0]) < 0.05
    assert np.isnan(meter.strengths()[1, 1]).all()


def flicker_twin(events: Events, low: float, high: float, cycles: int) -> list[bool]:
    rises: dict[tuple[int, int], int] = {}
    bright: dict[tuple[int, int], bool] = {}
    streak: dict[tuple[int, int], int] = {}
    keep = []
    for t, x, y, p in zip(*(getattr(events, n).tolist() for n in ("t_us", "x", "y", "p")), strict=True):
        pixel = (x, y)
        since = t - rises.get(pixel, -(10**15))
        if since > high:
            streak[pixel] = 0
        if p and not bright.get(pixel, True):
            streak[pixel] = streak.get(pixel, 0) + 1 if low <= since <= high else 0
            rises[pixel] = t
        bright[pixel] = p
        keep.append(streak.get(pixel, 0) < cycles)
    return keep


@pytest.mark.parametrize("packet", [3, 100_000])
def test_the_flicker_filter_against_a_plain_loop(packet: int) -> None:
    events = merged(noise(20_000, 1.0), lamp(100, 1, 3, 3), lamp(103, 1, 9, 9))
    filter_ = FlickerFilter(SIZE, 100, cycles=2)
    kept = Events.concatenate([filter_.push(part) for part in packets(events, packet)])
    keep = np.array(flicker_twin(events, 9000.0, 11000.0, 2))
    assert (kept.t_us == events.t_us[keep]).all()
    assert not keep.all()


def test_the_flicker_filter_takes_lamps_and_leaves_the_rest() -> None:
    light, scene = lamp(100, 2, 3, 3), lamp(37, 2, 20, 20)
    kept = FlickerFilter(SIZE, 100).push(merged(light, scene))
    assert np.sum(kept.x == 20) == len(scene)
    assert np.sum(kept.x == 3) <= 10
    nowhere = np.zeros(SIZE[::-1], np.bool_)
    assert same(FlickerFilter(SIZE, 100, where=nowhere).push(light), light)


def test_a_lamp_that_goes_out_gives_its_pixel_back() -> None:
    after = Events.of([5_000_000, 5_000_100], [3, 3], [3, 3], [True, False], SIZE)
    filter_ = FlickerFilter(SIZE, 100)
    filter_.push(lamp(100, 2, 3, 3))
    assert len(filter_.push(after)) == 2


def test_empty_packets_pass() -> None:
    empty = Events.empty(SIZE)
    assert not len(Refractory(SIZE, 10).push(empty))
    assert not len(FlickerFilter(SIZE, 50).push(empty))
    assert not len(without(empty, np.zeros(SIZE[::-1], np.bool_)))
    meter = FlickerMeter(SIZE)
    meter.push(empty)
    assert np.isnan(meter.strengths()).all()


def test_other_sensors_and_impossible_settings_are_refused() -> None:
    other = noise(size=(16, 16))
    with pytest.raises(RecordingError, match="16x16 sensor do not fit"):
        without(other, np.zeros(SIZE[::-1], np.bool_))
    with pytest.raises(RecordingError, match="16x16"):
        Refractory(SIZE, 10).push(other)
    with pytest.raises(SettingsError, match="period"):
        Refractory(SIZE, -1)
    with pytest.raises(SettingsError, match="ratio"):
        hot_pixels(np.zeros((2, 2), np.int64), ratio=1)
    with pytest.raises(SettingsError, match="frequencies"):
        FlickerMeter(SIZE, (5,))
    with pytest.raises(SettingsError, match="filter"):
        FlickerFilter(SIZE, 0)
    with pytest.raises(SettingsError, match="where"):
        FlickerFilter(SIZE, 100, where=np.zeros((3, 3), np.bool_))
