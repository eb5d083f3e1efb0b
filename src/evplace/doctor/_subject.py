"""The recording under examination, and what several examinations need of it, measured once."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.events import Events, Size
from evplace.doctor._silences import Silences
from evplace.imaging.windows import WindowSettings
from evplace.sources.readers import Recording
from evplace.sources.tracks import Track

BIN_US = 100_000
"""Events are counted in each tenth of a second."""
_LONGEST = 1 << 23
"""Bins that are laid out at most, nine days: a clock that leaps a year ahead must not cost all memory."""
SOON_US = 1000
"""A pixel whose last event is less than so long ago repeats itself."""
STAMP_BITS = 21
"""A pixel is one number of 32 bits, its count above so many bits of its last time: what is far apart in
memory costs more than all else."""
COUNTED = 1 << 32 - STAMP_BITS
"""Events that no longer fit beside the time are counted elsewhere."""
AGO_US = 1 << 10
"""Times are known up to so long before stamps begin anew."""
STAMPS_US = (1 << STAMP_BITS - 1) - AGO_US
"""After so long stamps begin anew."""
BLOCK = 128
"""Events whose pixels are looked up together."""
REACH_US = 500_000
"""Activity is averaged over so long before and after."""

Kind = Literal["events", "frames"]


class Rates:
    """Events in each tenth of a second; one in which none came takes no memory."""

    def __init__(self) -> None:
        self._start_us = 0
        self._numbers: list[NDArray[np.int64]] = []
        self._counts: list[NDArray[np.int64]] = []

    def push(self, t_us: NDArray[np.int64]) -> None:
        """Count the next events, at times that never decrease."""
        if not len(t_us):
            return
        if not self._numbers:
            self._start_us = int(t_us[0])
        numbers, counts = _runs(t_us, self._start_us, BIN_US)
        self._numbers.append(numbers)
        self._counts.append(counts)

    def laid_out(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(n,) times of the bins' middles in microseconds and (n,) events, the empty ones among them."""
        if not self._numbers:
            return np.zeros(0, np.int64), np.zeros(0, np.int64)
        numbers, counts = np.concatenate(self._numbers), np.concatenate(self._counts)
        near = numbers < _LONGEST
        whole = np.zeros(int(numbers[near][-1]) + 1, np.int64)
        np.add.at(whole, numbers[near], counts[near])
        return self._start_us + np.arange(len(whole)) * BIN_US + BIN_US // 2, whole


@dataclass
class Subject:
    """A recording, or a film, while it passes by."""

    path: Path
    kind: Kind
    size: Size
    """(width, height) in pixels."""
    windows: WindowSettings
    """The windows whose share without events is asked."""
    track: Track | None = None
    """Each fix with a position."""
    recording: Recording | None = None
    """None for a film."""
    timed: bool = True
    """Whether the times were recorded, not made up from a rate."""
    fault: str | None = None
    """What broke the recording off."""
    cause: BaseException | None = None
    """The error behind it."""
    parts: int = 0
    """Events, or frames, so far."""
    t_first_us: int = 0
    t_last_us: int = 0
    rates: Rates = field(default_factory=Rates)
    silences: Silences = field(default_factory=Silences)
    twice: int = 0
    """Events that equal the one before them of their pixel."""
    soon: int = 0
    """Others that come within SOON_US of it."""
    motion: list[tuple[int, float]] = field(default_factory=list)
    """For a film: the time between two frames, and the image's motion in pixels a second."""

    def __post_init__(self) -> None:
        self._pixels = np.zeros(self.size[0] * self.size[1], np.uint32)
        self._more = np.zeros(len(self._pixels), np.int64)
        self._begin, self._block = np.full(1, -1 << 62), np.empty((2, BLOCK), np.uint64)

    @property
    def counts(self) -> NDArray[np.int64]:
        """(H, W) events of each pixel."""
        counts = self._more + (self._pixels >> STAMP_BITS)
        return counts.reshape(self.size[1], self.size[0])

    @property
    def span_s(self) -> float:
        """Seconds from the first event or frame to the last."""
        return (self.t_last_us - self.t_first_us) / 1e6

    def see_events(self, events: Events) -> None:
        """Measure the next packet."""
        self._tick(int(events.t_us[0]), int(events.t_us[-1]), len(events))
        self.rates.push(events.t_us)
        self.silences.push(events.t_us)
        found = np.zeros(2, np.int64)
        _see_pixels(
            events.t_us, events.x, events.y, events.p, self.size[0], self._pixels, self._more, self._begin,
            self._block, found,
        )  # fmt: skip
        self.twice, self.soon = self.twice + int(found[0]), self.soon + int(found[1])

    def see_frame(self, t_us: int) -> None:
        """Note the next frame."""
        self._tick(t_us, t_us, 1)

    def activity(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """(n,) times in microseconds and (n,) what goes with the speed: events or pixels a second.

        The last tenth of a second, which is not whole, is left out where there are others.
        """
        if self.kind == "events":
            t_us, counts = (bins[: max(len(bins) - 1, 1)] for bins in self.rates.laid_out())
            return t_us, counts.astype(np.float64) * (1e6 / BIN_US)
        return (
            np.array([t_us for t_us, _ in self.motion], np.int64),
            np.array([motion for _, motion in self.motion], np.float64),
        )

    def smooth_activity(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """The activity every tenth of a second, each the mean over a second; NaN within that of a gap."""
        t_us, activity = self.activity()
        if len(t_us) < 2:
            return t_us, activity
        if self.kind == "frames":
            grid = np.arange(t_us[0], min(t_us[-1], t_us[0] + _LONGEST * BIN_US), BIN_US)
            t_us, activity = grid, np.interp(grid, t_us, activity)
        smooth = mean_around(activity, REACH_US // BIN_US)
        for start, end in zip(*self.gaps(), strict=True):
            smooth[slice(*np.searchsorted(t_us, [start - REACH_US, end + REACH_US]))] = np.nan
        return t_us, smooth

    def gaps(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """(g,) starts and ends of the stretches in which events are missing, in microseconds."""
        return self.silences.gaps(self.t_first_us, BIN_US, self.rates.laid_out()[1])

    def seconds(self, t_us: NDArray[np.int64] | int) -> NDArray[np.float64]:
        """Seconds since the first event or frame."""
        return np.asarray((np.asarray(t_us) - self.t_first_us) / 1e6, np.float64)

    def _tick(self, first_us: int, last_us: int, parts: int) -> None:
        if not self.parts:
            self.t_first_us = first_us
        self.t_last_us = last_us
        self.parts += parts


class AtTheEnd:
    """An examination that asks its subject once all of it was seen."""

    def __init__(self, subject: Subject) -> None:
        self._subject = subject

    def see(self, part: object) -> None:
        """Nothing: the subject itself measures."""


def mean_around(values: NDArray[Any], reach: int) -> NDArray[np.float64]:
    """(n,) mean of each value and up to `reach` before and after it."""
    sums = np.concatenate([[0.0], np.cumsum(values, dtype=np.float64)])
    at = np.arange(len(values))
    first, past = np.maximum(at - reach, 0), np.minimum(at + reach + 1, len(values))
    return np.asarray((sums[past] - sums[first]) / (past - first), np.float64)


def stretches(where: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last index of each run of True in `where` (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]


@njit(cache=True)
def _runs(t_us: NDArray[np.int64], start_us: int, bin_us: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Numbers of the bins that hold events, and how many each holds."""
    bins = 1
    end_us = start_us + ((t_us[0] - start_us) // bin_us + 1) * bin_us
    for t in t_us:
        if t >= end_us:
            bins += 1
            end_us = start_us + ((t - start_us) // bin_us + 1) * bin_us
    numbers, counts = np.empty(bins, np.int64), np.zeros(bins, np.int64)
    at = -1
    end_us = t_us[0]
    for t in t_us:
        if t >= end_us:
            at += 1
            numbers[at] = (t - start_us) // bin_us
            end_us = start_us + (numbers[at] + 1) * bin_us
        counts[at] += 1
    return numbers, counts


@njit(cache=True)
def _see_pixels(
    t_us: NDArray[np.int64],
    x: NDArray[np.uint16],
    y: NDArray[np.uint16],
    p: NDArray[np.bool_],
    width: int,
    pixels: NDArray[np.uint32],
    more: NDArray[np.int64],
    begin: NDArray[np.int64],
    block: NDArray[np.uint64],
    found: NDArray[np.int64],
) -> None:
    """Count each pixel's events, and add to `found` those that come twice, and soon.

    A pixel's stamp is its last time since begin[0] - AGO_US, doubled, and one more where it became brighter;
    0 where that was earlier. Whole counts go to `more`. The pixels of a block of events are looked up before
    the first of them changes, so that the waits for memory overlap; `block` is room for that.
    """
    for first in range(0, len(t_us), BLOCK):
        many = min(BLOCK, len(t_us) - first)
        for k in range(many):
            block[0, k] = np.uint64(y[first + k]) * np.uint64(width) + np.uint64(x[first + k])
            block[1, k] = pixels[block[0, k]]
        for k in range(many):
            i, at = first + k, block[0, k]
            since = t_us[i] - begin[0]
            if since >= STAMPS_US:
                _stamp_anew(pixels, since)
                begin[0], since = t_us[i], 0
            now = since + AGO_US << 1 | np.int64(p[i])
            pixel = np.int64(pixels[at])
            before = pixel & (1 << STAMP_BITS) - 1
            after = pixel - before + (1 << STAMP_BITS) + now
            pixels[at] = np.uint32(after)
            if after >= 1 << 32:
                more[at] += COUNTED
            if now == before:
                found[0] += 1
            elif (now >> 1) - (before >> 1) < SOON_US:
                found[1] += 1


@njit(cache=True)
def _stamp_anew(pixels: NDArray[np.uint32], later_us: int) -> None:
    """Stamps count from so much later."""
    stamps, later = np.uint32((1 << STAMP_BITS) - 1), np.uint32(min(later_us << 1, 1 << STAMP_BITS))
    for at in range(len(pixels)):
        stamp = pixels[at] & stamps
        pixels[at] -= later if stamp > later | np.uint32(1) else stamp
