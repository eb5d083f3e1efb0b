"""Frames to events: ESIM's model of an event camera (Rebecq et al., "ESIM: an Open Event Camera
Simulator", CoRL 2018, section 3), with noise, hot pixels and leak.

Each pixel keeps the logarithm of the light at its last event. Between two frames the logarithm is taken as
linear in time; an event falls where it has moved by one threshold. The level that the first frame sets is
its own copy, so that the first interval's times are right.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import InputError, SettingsError
from evplace.core.events import Events, Size
from evplace.sources.simulators.motion import Frame, MotionCheck, image_motion

LogLight = NDArray[np.float32]

_BUCKETS = 1 << 16
"""Intervals of at most so many microseconds are sorted by counting."""


@dataclass(frozen=True)
class SensorSettings:
    """An event camera."""

    threshold_on: float = 0.2
    """Rise of log light that gives an event. Source: ESIM's default range 0.1-0.5; paper: not stated."""
    threshold_off: float = 0.2
    """Fall of log light that gives an event, above 0."""
    threshold_spread: float = 0.03
    """Standard deviation of both thresholds from pixel to pixel (Lichtsteiner et al. 2008: 2.1 % of
    contrast; ESIM: 0.03)."""
    log_eps: float = 0.003
    """Added to the light (1 = full scale) before the logarithm: how dark the sensor still sees."""
    refractory_us: int = 500
    """Microseconds after an event in which the pixel gives none."""
    noise_hz: float = 0.1
    """Background events per second of a pixel in the dark, of either sign. In light they are fewer by
    eps / (eps + light): shot noise matters less the more light there is (ours)."""
    leak_hz: float = 0.0
    """ON events per second of a pixel that sees no change (v2e, Hu et al. 2021: about 0.1)."""
    hot_pixels: float = 0.0
    """Share of pixels that fire without cause."""
    hot_hz: float = 100.0
    """Events per second of a hot pixel."""

    def __post_init__(self) -> None:
        for name in ("threshold_on", "threshold_off", "log_eps"):
            if not getattr(self, name) > 0:
                raise SettingsError(
                    f"the setting '{name}' cannot be {getattr(self, name)}: it must be above 0"
                )
        for name in ("threshold_spread", "refractory_us", "noise_hz", "leak_hz", "hot_pixels", "hot_hz"):
            if not getattr(self, name) >= 0:
                raise SettingsError(
                    f"the setting '{name}' cannot be {getattr(self, name)}: it must be 0 or more"
                )
        if self.hot_pixels > 1:
            raise SettingsError(
                f"the setting 'hot_pixels' cannot be {self.hot_pixels}: it is a share, at most 1"
            )


PRESETS: dict[str, SensorSettings] = {
    "ideal": SensorSettings(log_eps=0.003, noise_hz=0.1),
    "weak": SensorSettings(
        log_eps=0.03, noise_hz=5.0, leak_hz=0.1, hot_pixels=0.0005, hot_hz=30.0, refractory_us=1000
    ),
    "from-8bit": SensorSettings(log_eps=0.02, noise_hz=0.1),
}
"""`city-v1`, frozen. ideal: sees far into the dark. weak: loses dark scenes and is noisy, as a real
sensor at night. from-8bit: for gamma-coded 8-bit frames, the paper's way (its frames come from a game)."""

MIN_THRESHOLD = 0.01
"""No pixel's threshold is drawn below this."""


class Simulator:
    """One sensor: takes frames in the order of time and gives the events between them."""

    def __init__(
        self, size: Size, settings: SensorSettings | None = None, seed: int = 0, drive: int = 0
    ) -> None:
        """For frames of `size` (width, height). `seed` draws what is the sensor's own, its thresholds and
        hot pixels; both draw the noise, which differs from one `drive` to the next.
        """
        self.size = size
        self.settings = settings or SensorSettings()
        own = np.random.default_rng([seed, 0])
        self._on, self._off = (self._thresholds(mean, own) for mean in _means(self.settings))
        self._hot = self._hot_pixels(own)
        self._rng = np.random.default_rng([seed, 1, drive])
        shape = (size[1], size[0])
        self._kind: np.dtype[Any] | None = None
        self._light = self._level = np.zeros(shape, np.float32)
        self._fired_us = np.full(shape, np.iinfo(np.int64).min // 2, np.int64)
        self._table = log_table(self.settings.log_eps)
        self._t_us = 0
        self._buffer = _Buffer(size[0] * size[1])

    def push(self, frame: Frame, t_us: int) -> Events:
        """The events after the last frame, up to this one, in the order of time; none for the first.

        `frame` is (H, W), uint8 or linear light. Raises InputError where its size or kind differs from the
        first's, or its time is not later.
        """
        self._check(frame, t_us)
        light = log_light(frame, self._table, self.settings.log_eps)
        if self._kind is None:
            self._kind, self._level = frame.dtype, light.copy()
            events = Events.empty(self.size)
        else:
            events = self._between(light, t_us)
        self._light, self._t_us = light, t_us
        return events

    def _between(self, new: LogLight, t_us: int) -> Events:
        leak = self.settings.leak_hz * self.settings.threshold_on * (t_us - self._t_us) * 1e-6
        count = self._cross(new, t_us, leak)
        if leak:
            self._level -= np.float32(leak)
        count += self._add_noise(new, count, t_us)
        return self._buffer.sorted(count, self._t_us, t_us, self.size)

    def _cross(self, new: LogLight, t_us: int, leak: float) -> int:
        """Collect the crossings of one interval; the buffer grows where it is too small."""
        at, count = 0, 0
        while True:
            at, count = _crossings(
                self._light,
                new,
                np.float32(leak),
                self._level,
                self._fired_us,
                self._on,
                self._off,
                self._t_us,
                t_us,
                self.settings.refractory_us,
                at,
                count,
                *self._buffer.arrays,
            )
            if at == new.size:
                return int(count)
            self._buffer.grow()

    def _add_noise(self, new: LogLight, count: int, t_us: int) -> int:
        """Events without cause, evenly in the interval; returns how many."""
        seconds = (t_us - self._t_us) * 1e-6
        pixels = self._level.size
        hot = len(self._hot)
        numbers = [self.settings.noise_hz * pixels * seconds, self.settings.hot_hz * hot * seconds]
        background, fired = (int(self._rng.poisson(mean)) if mean > 0 else 0 for mean in numbers)
        where = self._rng.integers(0, pixels, background)
        dark = self.settings.log_eps / np.exp(new.ravel()[where])
        where = where[self._rng.random(background) < dark]
        if fired:
            where = np.concatenate([where, self._hot[self._rng.integers(0, hot, fired)]])
        total = len(where)
        if not total:
            return 0
        self._buffer.put(
            count,
            self._rng.integers(1, t_us - self._t_us + 1, total),
            where % self.size[0],
            where // self.size[0],
            self._rng.integers(0, 2, total).astype(bool),
        )
        return total

    def _thresholds(self, mean: float, rng: np.random.Generator) -> NDArray[np.float32]:
        """(H, W) one threshold a pixel."""
        drawn = rng.normal(mean, self.settings.threshold_spread, (self.size[1], self.size[0]))
        return np.maximum(drawn, MIN_THRESHOLD).astype(np.float32)

    def _hot_pixels(self, rng: np.random.Generator) -> NDArray[np.int64]:
        pixels = self.size[0] * self.size[1]
        return rng.choice(pixels, round(self.settings.hot_pixels * pixels), replace=False)

    def _check(self, frame: Frame, t_us: int) -> None:
        if frame.ndim != 2 or (frame.shape[1], frame.shape[0]) != self.size:
            shape = "x".join(str(n) for n in frame.shape[1::-1] + frame.shape[2:])
            raise InputError(
                f"a frame of {shape} came to a sensor of {self.size[0]}x{self.size[1]}: "
                f"all frames must be grey and of one size"
            )
        if self._kind is None:
            return
        if frame.dtype != self._kind:
            raise InputError(f"a frame of {frame.dtype} came after one of {self._kind}: give one kind")
        if t_us <= self._t_us:
            raise InputError(
                f"a frame at {t_us} us came after one at {self._t_us} us: "
                f"times must increase, drop repeated frames"
            )


class _Buffer:
    """Where the events of one interval are collected: grows, and is used again."""

    def __init__(self, capacity: int) -> None:
        self._allocate(max(capacity, 4096))

    @property
    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.bool_]]:
        """Microseconds from the start of the interval, columns, rows, signs."""
        return self._dt, self._x, self._y, self._p

    def grow(self) -> None:
        """Twice the capacity; what is in it stays."""
        old = self.arrays
        self._allocate(2 * len(self._dt))
        self.put(0, *old)

    def put(
        self,
        at: int,
        dt: NDArray[np.int64],
        x: NDArray[np.integer],
        y: NDArray[np.integer],
        p: NDArray[np.bool_],
    ) -> None:
        """Write events from place `at` on."""
        while at + len(dt) > len(self._dt):
            self.grow()
        part = slice(at, at + len(dt))
        self._dt[part], self._x[part], self._y[part], self._p[part] = dt, x, y, p

    def sorted(self, count: int, start_us: int, end_us: int, size: Size) -> Events:
        """The first `count` events in the order of time; those of one microsecond stay in their order."""
        span = end_us - start_us
        if span < _BUCKETS:
            t_us, x, y, p = _counted(span, count, start_us, *self.arrays)
            return Events(t_us, x, y, p, size)
        order = np.argsort(self._dt[:count], kind="stable")
        t_us = start_us + self._dt[:count][order]
        return Events(t_us, self._x[order], self._y[order], self._p[order], size)

    def _allocate(self, capacity: int) -> None:
        self._dt = np.empty(capacity, np.int64)
        self._x, self._y = np.empty(capacity, np.uint16), np.empty(capacity, np.uint16)
        self._p = np.empty(capacity, np.bool_)


def simulate(
    frames: Iterable[tuple[int, Frame]],
    size: Size,
    settings: SensorSettings | None = None,
    seed: int = 0,
) -> Iterator[Events]:
    """The events of a film: one packet for each frame but the first.

    `frames` gives (t_us, frame), frames (H, W) as uint8 or as linear light. Warns once where the image
    moves by more than a pixel between frames. Raises InputError for fewer than two frames, frames of
    two sizes, and times that do not increase.
    """
    sensor = Simulator(size, settings, seed)
    speed = MotionCheck()
    count = 0
    for t_us, frame in frames:
        speed.see(frame)
        events = sensor.push(frame, t_us)
        if count:
            yield events
        count += 1
    if count < 2:
        raise InputError(f"events come from changes between frames: two are needed at least, {count} came")


def simulate_adaptive(
    render: Callable[[int], Frame],
    start_us: int,
    end_us: int,
    size: Size,
    settings: SensorSettings | None = None,
    seed: int = 0,
    pixels: float = 0.5,
    step_us: tuple[int, int] = (500, 20_000),
) -> Iterator[Events]:
    """The events between two times of a scene that can be rendered at any time (ESIM, section 3.2).

    After each frame the next one is asked for when the image will have moved by about `pixels`, as far as
    the last interval tells; never sooner than `step_us[0]` or later than `step_us[1]` microseconds.
    `render(t_us)` gives a frame (H, W). Raises InputError where `end_us` is not after `start_us`.
    """
    if end_us <= start_us:
        raise InputError(f"the end ({end_us} us) must lie after the start ({start_us} us)")
    sensor = Simulator(size, settings, seed)
    before, t_us, step = render(start_us), start_us, step_us[0]
    sensor.push(before, t_us)
    while t_us < end_us:
        later = min(t_us + step, end_us)
        frame = render(later)
        yield sensor.push(frame, later)
        speed = image_motion(before, frame) / (later - t_us)
        step = int(min(max(pixels / max(speed, 1e-12), step_us[0]), step_us[1]))
        before, t_us = frame, later


def log_table(eps: float) -> NDArray[np.float32]:
    """(256,) log(v / 255 + eps): the logarithm of each 8-bit value."""
    return np.log(np.arange(256) / 255.0 + eps).astype(np.float32)


def log_light(frame: Frame, table: NDArray[np.float32], eps: float) -> NDArray[np.float32]:
    """(H, W) logarithm of a frame, by table for 8 bits."""
    if frame.dtype == np.uint8:
        return np.asarray(_looked_up(frame, table))
    return np.asarray(np.log(frame.astype(np.float32) + np.float32(eps)))


def _means(settings: SensorSettings) -> tuple[float, float]:
    return settings.threshold_on, settings.threshold_off


@njit(cache=True)
def _looked_up(frame: NDArray[np.uint8], table: NDArray[np.float32]) -> LogLight:
    out = np.empty(frame.shape, np.float32)
    for y in range(frame.shape[0]):
        for x in range(frame.shape[1]):
            out[y, x] = table[frame[y, x]]
    return out


@njit(cache=True)
def _crossings(
    old: NDArray[np.float32],
    new: NDArray[np.float32],
    leak: np.float32,
    level: NDArray[np.float32],
    fired_us: NDArray[np.int64],
    on: NDArray[np.float32],
    off: NDArray[np.float32],
    start_us: int,
    end_us: int,
    refractory_us: int,
    first: int,
    count: int,
    dt: NDArray[np.int64],
    xs: NDArray[np.uint16],
    ys: NDArray[np.uint16],
    ps: NDArray[np.bool_],
) -> tuple[int, int]:
    """Crossings of all pixels from `first` on; stops before a pixel whose events may not fit.

    Returns the next pixel and the number of events. The leak lifts the signal in the interval; the caller
    lowers the level by as much afterwards, which is the same.
    """
    height, width = old.shape
    span = end_us - start_us
    for y in range(first // width, height):
        for x in range(first % width if y == first // width else 0, width):
            end = new[y, x] + leak
            base = level[y, x]
            move = end - base
            if -off[y, x] < move < on[y, x]:
                continue
            up = move > 0
            step = on[y, x] if up else -off[y, x]
            if count + int(move / step) + 2 > len(dt):
                return y * width + x, count
            start = float(old[y, x])
            pace = span / (float(end) - start) if end != old[y, x] else 0.0
            after = base + step
            while (after <= end) if up else (after >= end):
                late = int(min(max((float(after) - start) * pace, 1.0), span))
                base = after
                after = base + step
                if start_us + late - fired_us[y, x] >= refractory_us:
                    fired_us[y, x] = start_us + late
                    dt[count], xs[count], ys[count], ps[count] = late, x, y, up
                    count += 1
            level[y, x] = base
    return height * width, count


@njit(cache=True)
def _counted(
    span: int,
    count: int,
    start_us: int,
    dt: NDArray[np.int64],
    xs: NDArray[np.uint16],
    ys: NDArray[np.uint16],
    ps: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], NDArray[np.uint16], NDArray[np.uint16], NDArray[np.bool_]]:
    """The first `count` events sorted by counting their microseconds."""
    place = np.zeros(span + 2, np.int64)
    for i in range(count):
        place[dt[i] + 1] += 1
    for k in range(span + 1):
        place[k + 1] += place[k]
    t_us, x, y = np.empty(count, np.int64), np.empty(count, np.uint16), np.empty(count, np.uint16)
    p = np.empty(count, np.bool_)
    for i in range(count):
        j = place[dt[i]]
        place[dt[i]] += 1
        t_us[j], x[j], y[j], p[j] = start_us + dt[i], xs[i], ys[i], ps[i]
    return t_us, x, y, p
