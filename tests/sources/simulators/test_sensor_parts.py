"""The simulator's loops against plain twins, and what must hold for any film."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from evplace.core.errors import SettingsError
from evplace.core.events import Events
from evplace.sources.film import Film
from evplace.sources.simulators.esim import (
    _BUCKETS,
    MIN_THRESHOLD,
    PRESETS,
    SensorSettings,
    Simulator,
    _Buffer,
    _counted,
    _looked_up,
    log_light,
    log_table,
    simulate,
    simulate_adaptive,
)
from evplace.sources.simulators.motion import MotionCheck, image_motion
from evplace.sources.simulators.recording import SimulatedRecording

CLEAN = SensorSettings(threshold_spread=0.0, noise_hz=0.0, refractory_us=0)
levels = st.lists(st.floats(0.0, 1.0), min_size=2, max_size=8)


def events_of(sensor: Simulator, film: list[NDArray[np.generic]], step_us: int = 10_000) -> list[Events]:
    return [sensor.push(frame, k * step_us) for k, frame in enumerate(film)]


def pixel(*values: float) -> list[NDArray[np.generic]]:
    return [np.full((1, 1), value) for value in values]


@given(levels, st.floats(0.05, 0.6), st.floats(0.05, 0.6))
def test_the_events_of_a_pixel_add_up_to_its_change_of_light(
    light: list[float], on: float, off: float
) -> None:
    """To less than one threshold: what ESIM's model is."""
    settings = SensorSettings(on, off, 0.0, noise_hz=0.0, refractory_us=0)
    sensor = Simulator((1, 1), settings)
    packets = events_of(sensor, pixel(*light))
    moved = 0.0
    for n, events in enumerate(packets):
        moved += on * events.p.sum() - off * (~events.p).sum()
        change = np.log(light[n] + settings.log_eps) - np.log(light[0] + settings.log_eps)
        assert -off - 1e-3 < change - moved < on + 1e-3
        assert len({*events.p.tolist()}) < 2, "in one interval a pixel only rises or only falls"


@given(levels, st.integers(1, 8))
def test_times_are_in_order_within_their_interval(light: list[float], seed: int) -> None:
    film = [np.random.default_rng(seed + k).random((6, 9)) * value for k, value in enumerate(light)]
    sensor = Simulator((9, 6), PRESETS["weak"], seed)
    for k, events in enumerate(events_of(sensor, film)):
        if len(events):
            assert np.all(np.diff(events.t_us) >= 0)
            assert (k - 1) * 10_000 < events.t_us[0]
            assert events.t_us[-1] <= k * 10_000
            assert events.x.max() < 9
            assert events.y.max() < 6


@given(st.floats(0.01, 1.0), st.floats(0.01, 1.0), st.integers(2, 6))
def test_frames_between_change_nothing_where_log_light_is_straight(a: float, b: float, parts: int) -> None:
    """Between two frames the logarithm is taken as linear: more frames of that line say the same."""
    eps, log = CLEAN.log_eps, np.log
    between = np.exp(np.linspace(log(a + eps), log(b + eps), parts + 1)) - eps
    whole = Events.concatenate(events_of(Simulator((1, 1), CLEAN), pixel(a, b), 60_000))
    fine = Events.concatenate(events_of(Simulator((1, 1), CLEAN), pixel(*between), 60_000 // parts))
    assert abs(len(whole) - len(fine)) <= 1  # one that falls on the last bit of the end
    both = min(len(whole), len(fine))
    np.testing.assert_allclose(whole.t_us[:both], fine.t_us[:both], atol=60)
    np.testing.assert_array_equal(whole.p[:both], fine.p[:both])


@given(st.integers(0, 10_000), st.integers(1, 300), st.integers(0, 60))
def test_counting_sorts_as_a_stable_sort_does(seed: int, span: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    dt, x, y = rng.integers(0, span + 1, 80), rng.integers(0, 99, 80), rng.integers(0, 99, 80)
    p = rng.random(80) < 0.5
    arrays = dt, x.astype(np.uint16), y.astype(np.uint16), p
    order = np.argsort(dt[:count], kind="stable")
    got = _counted(span, count, 5_000, *arrays)
    for found, wanted in zip(got, (dt + 5_000, *arrays[1:]), strict=True):
        np.testing.assert_array_equal(found, wanted[:count][order])


@pytest.mark.parametrize("span", [1000, _BUCKETS - 1, _BUCKETS, 3_000_000])
def test_short_and_long_intervals_are_sorted_alike(span: int) -> None:
    rng, buffer = np.random.default_rng(1), _Buffer(0)
    dt = rng.integers(1, span + 1, 500)
    dt[100:200] = dt[0]
    x, y = rng.integers(0, 9, 500), rng.integers(0, 9, 500)
    buffer.put(0, dt, x, y, rng.random(500) < 0.5)
    events = buffer.sorted(500, 70, 70 + span, (9, 9))
    order = np.argsort(dt, kind="stable")
    np.testing.assert_array_equal(events.t_us, 70 + dt[order])
    np.testing.assert_array_equal(events.x, x[order])
    np.testing.assert_array_equal(events.y, y[order])


def test_a_buffer_grows_and_keeps_what_is_in_it() -> None:
    buffer = _Buffer(10)
    first = np.arange(4000)
    buffer.put(0, first, first % 7, first % 5, first % 2 == 0)
    buffer.put(4000, first, first % 3, first % 2, first % 3 == 0)
    dt, x, y, p = (array[:8000] for array in buffer.arrays)
    np.testing.assert_array_equal(dt, np.tile(first, 2))
    np.testing.assert_array_equal(x[:4000], first % 7)
    np.testing.assert_array_equal(y[4000:], first % 2)
    np.testing.assert_array_equal(p[4000:], first % 3 == 0)


@given(st.integers(0, 1000), st.floats(0.001, 0.1))
def test_eight_bits_are_looked_up(seed: int, eps: float) -> None:
    frame = np.random.default_rng(seed).integers(0, 256, (5, 7), np.uint8)
    table = log_table(eps)
    np.testing.assert_array_equal(_looked_up(frame, table), table[frame])
    np.testing.assert_allclose(log_light(frame, table, eps), np.log(frame / 255 + eps), atol=1e-6)
    np.testing.assert_allclose(log_light(frame / 255, table, eps), np.log(frame / 255 + eps), atol=1e-6)


def test_no_threshold_is_drawn_too_low() -> None:
    sensor = Simulator((50, 40), SensorSettings(0.02, 0.02, threshold_spread=0.5), seed=2)
    for thresholds in (sensor._on, sensor._off):
        assert thresholds.min() == np.float32(MIN_THRESHOLD)
        assert 0.2 < (thresholds == np.float32(MIN_THRESHOLD)).mean() < 0.7


def test_a_sensors_own_faults_do_not_change_from_drive_to_drive() -> None:
    one, other = (Simulator((60, 50), PRESETS["weak"], seed=3, drive=drive) for drive in (0, 7))
    np.testing.assert_array_equal(one._hot, other._hot)
    np.testing.assert_array_equal(one._off, other._off)
    assert len(one._hot) == round(0.0005 * 3000)
    assert not np.array_equal(one._on, Simulator((60, 50), PRESETS["weak"], seed=4)._on)


def test_leak_and_falling_light_cancel_each_other() -> None:
    """A leak of 2 Hz lifts the signal by 2 thresholds a second: light that falls so gives no event."""
    settings = SensorSettings(0.2, 0.2, 0.0, log_eps=1e-9, refractory_us=0, noise_hz=0.0, leak_hz=2.0)
    fall = np.exp(-0.2 * 2.0 * 0.01 * np.arange(200))
    assert sum(map(len, events_of(Simulator((1, 1), settings), pixel(*fall)))) == 0
    rise = events_of(Simulator((1, 1), settings), pixel(*(1 / fall)))
    assert sum(map(len, rise)) == pytest.approx(2 * 2.0 * 1.99, abs=1)


def plain_motion(before: NDArray[np.float64], after: NDArray[np.float64]) -> float:
    here, there = np.sqrt(before), np.sqrt(after)
    change = np.abs(there - here)[:-1, :-1].sum()
    gradient = np.hypot(here[:-1, 1:] - here[:-1, :-1], here[1:, :-1] - here[:-1, :-1]).sum()
    return float(change / gradient) if gradient > 0 else 0.0


@given(st.integers(0, 10_000), st.booleans())
def test_motion_equals_its_twin(seed: int, flat: bool) -> None:
    rng = np.random.default_rng(seed)
    before = np.full((7, 9), 3.0) if flat else rng.random((7, 9)) * 4
    after = rng.random((7, 9)) * 4
    assert image_motion(before, after) == pytest.approx(plain_motion(before, after))
    assert image_motion(before, before) == 0
    assert image_motion(before[:, ::-1], after[:, ::-1]) == pytest.approx(
        plain_motion(before[:, ::-1], after[:, ::-1])
    )


@pytest.mark.parametrize("every", [2, 5])
def test_one_pair_of_frames_in_so_many_is_looked_at(every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    pairs: list[tuple[int, int]] = []

    def measured(before: NDArray[np.int64], after: NDArray[np.int64]) -> float:
        pairs.append((int(before[0]), int(after[0])))
        return 0.0

    monkeypatch.setattr("evplace.sources.simulators.motion.image_motion", measured)
    check = MotionCheck(every)
    for k in range(12):
        check.see(np.array([k]))
    assert pairs == [(k, k + 1) for k in range(0, 11, every)]


def test_a_repeated_buffer_is_seen_as_it_was() -> None:
    """A camera may write each frame into the same memory."""
    check, buffer = MotionCheck(2), np.zeros((4, 4))
    check.see(buffer)
    buffer[:, 2:] = 9.0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check.see(buffer)
    assert not caught, "the first frame was flat: its gradient tells no motion"
    assert check._before is None


@given(st.floats(0.05, 5.0), st.integers(500, 3000))
def test_adaptive_steps_keep_to_their_bounds(pixels: float, least_us: int) -> None:
    asked: list[int] = []

    def render(t_us: int) -> NDArray[np.float32]:
        asked.append(t_us)
        x = np.arange(32) - t_us / 4000
        return np.tile(0.5 + 0.4 * np.sin(x / 3), (8, 1)).astype(np.float32)

    bounds = (least_us, 9_000)
    events = list(simulate_adaptive(render, 0, 60_000, (32, 8), CLEAN, pixels=pixels, step_us=bounds))
    steps = np.diff(asked)
    assert (asked[0], asked[-1]) == (0, 60_000)
    assert len(events) == len(steps)
    assert np.all(steps[:-1] >= least_us)
    assert steps.max() <= 9_000
    wanted = 4000 * pixels / 1.0  # the picture moves a pixel in 4000 us
    if bounds[0] * 1.5 < wanted < bounds[1] / 1.5:
        assert np.median(steps[1:]) == pytest.approx(wanted, rel=0.3)


class TwoFrames:
    """A film of two frames, and how often it was read."""

    path, size, read = Path("made"), (6, 4), 0

    def __iter__(self) -> object:
        self.read += 1
        return iter([(0, np.full((4, 6), 10, np.uint8)), (1000, np.full((4, 6), 200, np.uint8))])


def test_a_simulated_recording_is_simulated_anew_each_time() -> None:
    film: Film = TwoFrames()  # type: ignore[assignment]
    recording = SimulatedRecording(film, seed=5)
    first, again = (Events.concatenate(list(recording.packets())) for _ in range(2))
    assert film.read == 2  # type: ignore[attr-defined]
    np.testing.assert_array_equal(first.t_us, again.t_us)
    direct = Events.concatenate(list(simulate(film, (6, 4), PRESETS["from-8bit"], 5)))
    np.testing.assert_array_equal(first.t_us, direct.t_us)
    assert (recording.path, recording.size, recording.dropped) == (Path("made"), (6, 4), {})
    other = Events.concatenate(list(SimulatedRecording(film, seed=6).packets()))
    assert not np.array_equal(first.t_us, other.t_us)


@pytest.mark.parametrize("name", ["threshold_spread", "refractory_us", "leak_hz", "hot_pixels", "hot_hz"])
@pytest.mark.parametrize("value", [-1.0, float("nan")])
def test_what_cannot_be_below_nothing_is_refused(name: str, value: float) -> None:
    with pytest.raises(SettingsError, match=f"'{name}' cannot be"):
        SensorSettings(**{name: value})  # type: ignore[arg-type]
