from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from evplace.core.errors import InputError, SettingsError
from evplace.core.events import Events
from evplace.sources.simulators import esim
from evplace.sources.simulators.esim import PRESETS, SensorSettings, Simulator, simulate, simulate_adaptive

CLEAN = SensorSettings(threshold_spread=0.0, noise_hz=0.0, refractory_us=0)


class NumpyTwin:
    """The same model, one numpy pass a crossing: slow, and easy to check against the paper."""

    def __init__(self, sensor: Simulator) -> None:
        self.on, self.off, self.settings = sensor._on, sensor._off, sensor.settings
        self.fired = np.full(self.on.shape, np.iinfo(np.int64).min // 2, np.int64)
        self.light: NDArray[np.float32] | None = None
        self.size = sensor.size

    def push(self, frame: NDArray[np.generic], t_us: int) -> Events:
        scaled = frame / 255.0 if frame.dtype == np.uint8 else frame
        eps = self.settings.log_eps if frame.dtype == np.uint8 else np.float32(self.settings.log_eps)
        light = np.log(scaled + eps).astype(np.float32)
        if self.light is None:
            self.light, self.level, self.t_us = light, light.copy(), t_us
            return Events.empty(self.size)
        events = self._between(self.light, light, t_us)
        self.light, self.t_us = light, t_us
        return events

    def _between(self, old: NDArray[np.float32], new: NDArray[np.float32], t_us: int) -> Events:
        span = t_us - self.t_us
        leak = np.float32(self.settings.leak_hz * self.settings.threshold_on * span * 1e-6)
        end = new + leak
        up = end > self.level
        step = np.where(up, self.on, -self.off)
        start, change = old.astype(float), end.astype(float) - old.astype(float)
        pace = np.divide(span, change, out=np.zeros(change.shape), where=end != old)
        rows = []
        while True:
            after = self.level + step
            crosses = np.where(up, after <= end, after >= end)
            if not crosses.any():
                break
            late = np.clip((after.astype(float) - start) * pace, 1, span).astype(np.int64)
            fires = crosses & (self.t_us + late - self.fired >= self.settings.refractory_us)
            self.fired[fires] = (self.t_us + late)[fires]
            where = np.flatnonzero(fires)
            rows.append(np.stack([late.ravel()[where], where, np.full(len(where), len(rows))]))
            self.level = np.where(crosses, after, self.level)
        if leak:
            self.level = self.level - leak
        late, pixel, turn = np.concatenate(rows, 1) if rows else np.empty((3, 0), np.int64)
        order = np.lexsort([turn, pixel, late])
        late, pixel = late[order], pixel[order]
        x, y = pixel % self.size[0], pixel // self.size[0]
        return Events.of(self.t_us + late, x, y, up.ravel()[pixel], self.size)


def same(a: Events, b: Events) -> None:
    np.testing.assert_array_equal(a.x, b.x)
    np.testing.assert_array_equal(a.y, b.y)
    np.testing.assert_array_equal(a.p, b.p)
    np.testing.assert_array_equal(a.t_us, b.t_us)


def vid2e(data: Path, count: int) -> list[tuple[int, NDArray[np.uint8]]]:
    folder = data / "frames" / "vid2e"
    times = np.loadtxt(folder / "timestamps.txt")
    files = sorted((folder / "images").glob("*.png"))[:count]
    return [
        (round(t * 1e6), np.asarray(Image.open(f).convert("L"))) for t, f in zip(times, files, strict=False)
    ]


@pytest.mark.parametrize(
    "settings",
    [
        SensorSettings(noise_hz=0.0, log_eps=0.02),
        SensorSettings(noise_hz=0.0, threshold_on=0.1, threshold_off=0.15, refractory_us=3000, leak_hz=2.0),
    ],
)
def test_equals_the_numpy_twin_on_real_frames(data: Path, settings: SensorSettings) -> None:
    frames = vid2e(data, 60)
    sensor = Simulator((240, 180), settings, seed=3)
    twin, total = NumpyTwin(sensor), 0
    for t_us, frame in frames:
        events = sensor.push(frame, t_us)
        same(events, twin.push(frame, t_us))
        total += len(events)
    assert total > 50_000


def test_equals_the_numpy_twin_on_linear_light() -> None:
    rng = np.random.default_rng(5)
    sensor = Simulator((31, 17), SensorSettings(noise_hz=0.0, leak_hz=0.5, refractory_us=100))
    twin = NumpyTwin(sensor)
    for k in range(40):
        frame = rng.gamma(0.5, 1.0, (17, 31)).astype(np.float32)
        same(sensor.push(frame, 1000 * k), twin.push(frame, 1000 * k))


def test_a_ramp_is_crossed_at_the_analytic_times() -> None:
    settings = SensorSettings(0.2, 0.3, 0.0, log_eps=1e-6, refractory_us=0, noise_hz=0.0)
    sensor = Simulator((2, 1), settings)
    sensor.push(np.exp(np.array([[0.0, 0.0]])), 1_000_000)
    events = sensor.push(np.exp(np.array([[1.05, -1.0]])), 2_000_000)
    rising, falling = events.t_us[events.x == 0], events.t_us[events.x == 1]
    np.testing.assert_allclose(rising, 1e6 + np.array([0.2, 0.4, 0.6, 0.8, 1.0]) / 1.05 * 1e6, atol=2)
    np.testing.assert_allclose(falling, 1e6 + np.array([0.3, 0.6, 0.9]) * 1e6, atol=2)
    assert events.p[events.x == 0].all()
    assert not events.p[events.x == 1].any()


def test_the_first_interval_starts_at_the_first_image_itself() -> None:
    """A level that were the first image's own memory would move with it."""
    sensor = Simulator((1, 1), CLEAN)
    frame = np.array([[100]], np.uint8)
    sensor.push(frame, 0)
    frame[:] = 200
    first = sensor.push(frame, 1000)
    slow = Simulator((1, 1), CLEAN)
    slow.push(np.array([[100]], np.uint8), 0)
    same(first, slow.push(np.array([[200]], np.uint8), 1000))
    assert len(first) > 1


def test_refractory_pixels_give_no_events() -> None:
    busy = Simulator((1, 1), CLEAN)
    tired = Simulator((1, 1), SensorSettings(threshold_spread=0.0, noise_hz=0.0, refractory_us=400))
    for sensor in (busy, tired):
        sensor.push(np.array([[0.01]]), 0)
    many, few = (sensor.push(np.array([[1.0]]), 1000) for sensor in (busy, tired))
    assert len(many) > 10
    assert len(few) == 3
    assert np.diff(few.t_us).min() >= 400


def test_noise_is_as_frequent_as_the_settings_say() -> None:
    dark = np.zeros((100, 100))
    settings = SensorSettings(noise_hz=5.0, hot_pixels=0.001, hot_hz=200.0)
    sensor = Simulator((100, 100), settings, seed=1)
    sensor.push(dark, 0)
    events = sensor.push(dark, 1_000_000)
    hot = np.bincount(events.y.astype(int) * 100 + events.x, minlength=10_000)
    assert abs(len(events) - 52_000) < 1000
    assert np.sum(hot > 100) == 10
    assert abs(events.p.mean() - 0.5) < 0.02
    assert np.all(np.diff(events.t_us) >= 0)


def test_light_quietens_the_noise() -> None:
    sensor = Simulator((100, 100), SensorSettings(noise_hz=100.0, log_eps=0.1))
    bright = np.full((100, 100), 0.9)
    sensor.push(bright, 0)
    assert abs(len(sensor.push(bright, 1_000_000)) - 100_000) < 2000


def test_leak_gives_on_events_at_its_rate() -> None:
    still = np.full((10, 10), 0.5)
    sensor = Simulator((10, 10), SensorSettings(threshold_spread=0.0, noise_hz=0.0, leak_hz=2.0))
    packets = [sensor.push(still, 100_000 * k) for k in range(31)]
    events = Events.concatenate(packets)
    assert events.p.all()
    assert abs(len(events) / 100 / 3.0 - 2.0) < 0.4


def test_thresholds_spread_from_pixel_to_pixel_and_belong_to_the_seed() -> None:
    a, b = (Simulator((80, 60), SensorSettings(threshold_spread=0.03), seed=7, drive=d) for d in (0, 1))
    np.testing.assert_array_equal(a._on, b._on)
    assert abs(a._on.std() - 0.03) < 0.003
    assert not np.array_equal(a._on, a._off)
    flat = np.zeros((60, 80))
    noise = []
    for sensor in (a, b):
        sensor.push(flat, 0)
        noise.append(sensor.push(flat, 1_000_000))
    assert not np.array_equal(noise[0].t_us[:50], noise[1].t_us[:50])


def test_more_events_than_the_buffer_first_holds() -> None:
    sensor = Simulator((8, 8), SensorSettings(0.01, 0.01, 0.0, noise_hz=0.0, refractory_us=0, log_eps=1e-3))
    dark, bright = np.zeros((8, 8)), np.full((8, 8), 50.0)
    sensor.push(dark, 0)
    events = sensor.push(bright, 10)
    assert len(events) == 64 * 1081
    assert events.t_us.min() >= 1
    assert events.t_us.max() <= 10


def test_long_intervals_are_sorted_too() -> None:
    rng = np.random.default_rng(0)
    sensor = Simulator((20, 20), CLEAN)
    sensor.push(rng.random((20, 20)), 0)
    events = sensor.push(rng.random((20, 20)), 3_000_000)
    assert np.all(np.diff(events.t_us) >= 0)


def test_a_packet_comes_for_each_frame_but_the_first_and_a_seed_repeats_itself() -> None:
    rng = np.random.default_rng(2)
    frames = [(1000 * k, rng.random((12, 16)).astype(np.float32)) for k in range(6)]
    runs = [list(simulate(frames, (16, 12), PRESETS["weak"], seed=4)) for _ in range(2)]
    assert len(runs[0]) == 5
    for a, b in zip(*runs, strict=True):
        same(a, b)


def blob(at: float) -> NDArray[np.float32]:
    y, x = np.mgrid[:48, :64]
    return (0.05 + np.exp(-((x - at) ** 2 + (y - 24.0) ** 2) / 60.0)).astype(np.float32)


def test_too_few_frames_a_second_are_warned_of_once() -> None:
    fast = [(10_000 * k, blob(5.0 + 6.0 * k)) for k in range(9)]
    with pytest.warns(UserWarning, match="pixels from frame 1") as caught:
        list(simulate(fast, (64, 48), CLEAN))
    assert len(caught) == 1
    slow = [(10_000 * k, blob(5.0 + 0.5 * k)) for k in range(9)]
    list(simulate(slow, (64, 48), CLEAN))


def test_adaptive_sampling_asks_for_more_frames_where_the_image_moves() -> None:
    asked: list[int] = []

    def render(t_us: int) -> NDArray[np.float32]:
        asked.append(t_us)
        return blob(20.0 + (20.0 * max(t_us - 100_000, 0) / 100_000))

    events = Events.concatenate(list(simulate_adaptive(render, 0, 200_000, (64, 48), CLEAN)))
    still, moving = (sum(low <= t < low + 100_000 for t in asked) for low in (0, 100_000))
    assert moving > 2 * still
    fine = [(t, render(t)) for t in range(0, 200_001, 1000)]
    exact = Events.concatenate(list(simulate(fine, (64, 48), CLEAN)))
    assert abs(len(events) - len(exact)) < 0.03 * len(exact)
    with pytest.raises(InputError, match="must lie after"):
        next(simulate_adaptive(render, 10, 10, (64, 48)))


def test_what_cannot_be_simulated_is_refused() -> None:
    grey = np.zeros((12, 16), np.uint8)
    with pytest.raises(InputError, match="two are needed at least, 1 came"):
        list(simulate([(0, grey)], (16, 12)))
    with pytest.raises(InputError, match="two are needed at least, 0 came"):
        list(simulate([], (16, 12)))
    with pytest.raises(InputError, match="at 5 us came after one at 5 us"):
        list(simulate([(5, grey), (5, grey)], (16, 12)))
    with pytest.raises(InputError, match="15x12 came to a sensor of 16x12"):
        list(simulate([(0, grey), (5, grey[:, 1:])], (16, 12)))
    with pytest.raises(InputError, match="16x12x3"):
        list(simulate([(0, np.zeros((12, 16, 3), np.uint8))], (16, 12)))
    with pytest.raises(InputError, match="float64 came after one of uint8"):
        list(simulate([(0, grey), (5, grey / 2)], (16, 12)))


@pytest.mark.parametrize(
    "values",
    [
        {"threshold_on": 0.0},
        {"threshold_off": -0.2},
        {"log_eps": 0.0},
        {"noise_hz": -1.0},
        {"hot_pixels": 2.0},
    ],
)
def test_settings_without_sense_are_refused(values: dict[str, float]) -> None:
    with pytest.raises(SettingsError, match=next(iter(values))):
        SensorSettings(**values)  # type: ignore[arg-type]


def test_the_log_table_is_the_same_everywhere() -> None:
    table = esim.log_table(0.02)
    assert table.dtype == np.float32
    np.testing.assert_allclose(np.exp(table.astype(float)), np.arange(256) / 255 + 0.02, rtol=1e-6)
