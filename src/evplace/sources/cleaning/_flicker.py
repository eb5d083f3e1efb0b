"""Lamps: where and how strongly they flicker, and a filter against it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import SettingsError
from evplace.core.events import Events, Size
from evplace.sources.cleaning._pixels import Counts, Mask, check_size, only

MAINS_HZ = (50, 60, 100, 120, 200, 240)
"""Where lamps flicker: mains of 50 and 60 Hz, twice that, and one harmonic."""

_STEP_US = 4
"""Time from one row of the flicker meter's table to the next: a thousandth of the shortest period."""
_HIGH = 127
"""The waves' height in that table, whose numbers have 8 bits."""
_SUMMED = 256
"""Events of a region whose waves are summed in 16 bits."""
_LANES = 32
"""The table's columns are a multiple of this, so that they are summed many at once."""

_MIN_PAIRS = 1000
"""Below this the flicker of a region is not known: chance alone gives 1 / sqrt(pairs)."""


class FlickerMeter:
    """How much of each region's events comes and goes with a lamp, for each of `frequencies_hz`.

    Within windows of `window_us`, events as +1 (brighter) and -1 (darker) are summed with the phase of the
    frequency. The squared sum, less what single events give, over the number of pairs is the mean agreement
    of two events: 0 for any times without order, 1 for a perfect beat. Short bursts, as of a passing edge,
    agree at all frequencies; a lamp only at its own. So the mean at two windows' steps beside the
    frequency, where a pure beat gives nothing, is taken off: a comb.
    """

    def __init__(
        self,
        size: Size,
        frequencies_hz: Sequence[int] = MAINS_HZ,
        region: int = 16,
        window_us: int = 250_000,
    ) -> None:
        beside = 2_000_000 // max(window_us, 1)
        if region < 1 or window_us < 1 or min(frequencies_hz, default=0) <= beside:
            raise SettingsError(
                f"regions of {region} pixels, windows of {window_us} us, frequencies {list(frequencies_hz)} "
                f"are impossible: frequencies are whole numbers above {beside} Hz for such a window"
            )
        self.size, self.region, self.window_us = size, region, window_us
        self._waves = _waves(
            [tooth for f in frequencies_hz for tooth in (f, f - beside, f + beside)], window_us
        )
        self._grid = (-(-size[1] // region), -(-size[0] // region))
        regions, teeth = self._grid[0] * self._grid[1], 3 * len(frequencies_hz)
        self._row = np.arange(size[1]) // region * self._grid[1]
        self._column = np.arange(size[0]) // region
        self._sums = np.zeros((regions, self._waves.shape[1]), np.int16)
        self._totals = np.zeros((regions, self._waves.shape[1]), np.int64)
        self._events = np.zeros(regions, np.int64)
        self._power = np.zeros((regions, teeth))
        self._pairs = np.zeros(regions)
        self._start_us = np.full(1, np.iinfo(np.int64).min)

    def push(self, events: Events) -> None:
        """Take the next packet."""
        check_size(events, self.size)
        if len(events) and self._start_us[0] == np.iinfo(np.int64).min:
            self._start_us[0] = events.t_us[0]
        _beat(
            events.t_us, events.x, events.y, events.p.view(np.uint8), self._row, self._column,
            self.window_us, self._waves, self._start_us, self._sums, self._totals, self._events,
            self._power, self._pairs,
        )  # fmt: skip

    def pairs(self) -> NDArray[np.float64]:
        """(region rows, region columns) pairs of events compared: chance alone gives 1 / sqrt(pairs)."""
        return self._pairs.reshape(self._grid).copy()

    def strengths(self) -> NDArray[np.float64]:
        """(region rows, region columns, frequencies) 0 to 1, over all complete windows.

        NaN where a region's events make under 1000 pairs.
        """
        pairs = np.where(self._pairs >= _MIN_PAIRS, self._pairs, np.nan)[:, None]
        agreement = (self._power / pairs).reshape(len(pairs), -1, 3)
        comb = agreement[:, :, 0] - agreement[:, :, 1:].mean(axis=2)
        return np.asarray(np.clip(comb, 0, 1).reshape(*self._grid, -1), np.float64)


class FlickerFilter:
    """Drops the events of pixels that brighten again and again with the period of a lamp.

    A cycle of a pixel begins with the first event brighter after one darker. After `cycles` cycles whose
    lengths are all within `tolerance` of the period, its events are dropped, until a cycle is shorter or
    longer, or fails to come. `where` (H, W) limits the filter to regions that the meter found to flicker.
    """

    def __init__(
        self,
        size: Size,
        frequency_hz: float,
        tolerance: float = 0.1,
        cycles: int = 3,
        where: Mask | None = None,
    ) -> None:
        if not (frequency_hz > 0 and 0 < tolerance < 1 and cycles >= 1):
            raise SettingsError(
                f"no filter for {frequency_hz} Hz, tolerance {tolerance}, {cycles} cycles: give a frequency "
                "above 0, a tolerance between 0 and 1, and at least 1 cycle"
            )
        shape = (size[1], size[0])
        if where is not None and where.shape != shape:
            raise SettingsError(f"where has the shape {where.shape}, the sensor {shape}")
        self.size, self.cycles = size, cycles
        self._where = np.ones(shape, np.bool_) if where is None else where
        self._bounds_us = (1e6 / frequency_hz * (1 - tolerance), 1e6 / frequency_hz * (1 + tolerance))
        self._rise_us = np.full(shape, np.iinfo(np.int64).min // 2)
        self._brighter = np.ones(shape, np.bool_)
        self._streak = np.zeros(shape, np.int32)

    def push(self, events: Events) -> Events:
        """The events that are kept, of the next packet."""
        check_size(events, self.size)
        keep = _aperiodic(
            events.t_us, events.x, events.y, events.p, self._where, *self._bounds_us, self.cycles,
            self._rise_us, self._brighter, self._streak,
        )  # fmt: skip
        return only(events, keep)


def _waves(teeth: Sequence[int], window_us: int) -> NDArray[np.int8]:
    """(steps of a window, columns) cosines of all teeth, then sines, then nothing."""
    turn = 1_000_000 // _STEP_US
    wave = np.rint(_HIGH * np.cos(2 * np.pi * np.arange(turn) / turn)).astype(np.int8)  # each value once
    at = np.outer(np.arange(-(-window_us // _STEP_US)), teeth) % turn
    waves = np.zeros((len(at), -(-2 * len(teeth) // _LANES) * _LANES), np.int8)
    waves[:, : len(teeth)] = wave[at]
    waves[:, len(teeth) : 2 * len(teeth)] = wave[at - turn // 4]
    return waves


@njit(cache=True)
def _beat(
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.uint8],
    row: Counts,
    column: Counts,
    window_us: int,
    waves: NDArray[np.int8],
    start_us: Counts,
    sums: NDArray[np.int16],
    totals: Counts,
    events: Counts,
    power: NDArray[np.float64],
    pairs: NDArray[np.float64],
) -> None:
    """Sum signed waves in the window from start_us[0]; a complete window goes to power and pairs.

    `row` + `column` is the region. Sums are whole numbers; before one can pass 16 bits, it goes to `totals`.
    `p` comes as numbers, from which a sign is computed: a branch would go wrong half the time.
    """
    # Unsigned, so that an index needs no look whether it counts from the end.
    columns, summed = np.uint64(waves.shape[1]), np.uint64(_SUMMED)
    start = start_us[0]
    for i in range(len(t_us)):
        if t_us[i] - start >= window_us:
            for each in range(len(events)):
                _close(sums[each], totals[each], events[each], power[each])
                pairs[each] += events[each] * (events[each] - 1.0)
            events[:] = 0
            start += (t_us[i] - start) // window_us * window_us
            start_us[0] = start
        place = np.uint64(row[y[i]] + column[x[i]])
        step = np.uint64(t_us[i] - start) // np.uint64(_STEP_US)
        sign = np.int16(2 * np.int16(p[i]) - 1)
        for k in range(columns):
            sums[place, k] += sign * np.int16(waves[step, k])
        events[place] += 1
        if np.uint64(events[place]) % summed == 0:
            for k in range(columns):
                totals[place, k] += sums[place, k]
                sums[place, k] = 0


@njit(cache=True)
def _close(sums: NDArray[np.int16], totals: Counts, events: int, power: NDArray[np.float64]) -> None:
    """What a region's window adds to its power, without what single events give; its sums begin anew."""
    teeth = len(power)
    for k in range(2 * teeth):
        totals[k] += sums[k]
    for k in range(teeth):
        power[k] += (float(totals[k]) ** 2 + float(totals[teeth + k]) ** 2) / _HIGH**2 - events
    totals[:] = 0
    sums[:] = 0


@njit(cache=True)
def _aperiodic(
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: Mask,
    where: Mask,
    shortest_us: float,
    longest_us: float,
    cycles: int,
    rise_us: Counts,
    brighter: Mask,
    streak: NDArray[np.int32],
) -> Mask:
    keep = np.empty(len(t_us), np.bool_)
    for i in range(len(t_us)):
        row, column = y[i], x[i]
        since = t_us[i] - rise_us[row, column]
        if since > longest_us:
            streak[row, column] = 0
        if p[i] and not brighter[row, column]:
            regular = shortest_us <= since <= longest_us
            streak[row, column] = streak[row, column] + 1 if regular else 0
            rise_us[row, column] = t_us[i]
        brighter[row, column] = p[i]
        keep[i] = streak[row, column] < cycles or not where[row, column]
    return keep
