"""Hot pixels, static regions, the refractory period."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from evplace.core.compiled import njit
from evplace.core.errors import RecordingError, SettingsError
from evplace.core.events import Events, Size

Counts = NDArray[np.int64]
Mask = NDArray[np.bool_]


def count_pixels(packets: Iterable[Events], size: Size, before: Counts | None = None) -> Counts:
    """(H, W) events of each pixel over all packets of a sensor of `size` (width, height).

    They are added to the counts `before`, in place, where these are given.
    """
    counts = np.zeros((size[1], size[0]), np.int64) if before is None else before
    for events in packets:
        check_size(events, size)
        _count(events.x, events.y, counts)
    return counts


def hot_pixels(counts: Counts, ratio: float = 3.0, min_events: int = 20) -> Mask:
    """(H, W) True where a pixel fires by itself.

    Its count is at least `min_events` and more than `ratio` times both the sensor's median count and the
    third largest of its 24 neighbours (5x5). The third, not the largest, so that hot pairs and
    triples are found; not the median, so that an edge that stays in view (a bonnet's rim, the horizon),
    where at least three neighbours fire as much, is not taken for a fault.
    """
    if not ratio > 1:
        raise SettingsError(f"ratio={ratio} would mask every pixel: give a number above 1")
    bound = max(float(np.median(counts)) * ratio, float(min_events))
    much = counts >= bound
    return np.asarray(much & (counts > ratio * _third_neighbour(counts, much)), np.bool_)


def static_pixels(counts: Counts, share: float = 0.1, block: int = 16) -> Mask:
    """(H, W) True in blocks of `block` x `block` pixels that hardly ever see a change.

    Their median count is below `share` of the median over all blocks: the car's bonnet, a vignette.
    """
    lines = range(0, counts.shape[0], block)
    medians = np.array([_medians(counts[start : start + block], block) for start in lines])
    quiet = medians < share * np.median(medians)
    whole = np.repeat(np.repeat(quiet, block, axis=0), block, axis=1)
    return np.asarray(whole[: counts.shape[0], : counts.shape[1]], np.bool_)


def _medians(line: Counts, block: int) -> NDArray[np.float64]:
    """(columns of blocks,) medians of the blocks of one line of them; the last may be narrower."""
    whole = line.shape[1] // block * block
    blocks = line[:, :whole].reshape(len(line), -1, block).swapaxes(0, 1).reshape(whole // block, -1)
    rest = [np.median(line[:, whole:])] if whole < line.shape[1] else []
    return np.concatenate([np.median(blocks, axis=1) if whole else [], rest])


def without(events: Events, mask: Mask) -> Events:
    """The events of those pixels where `mask` (H, W) is False."""
    check_size(events, (mask.shape[1], mask.shape[0]))
    return only(events, _outside(events.x, events.y, mask))


class Refractory:
    """Drops events that follow a kept one of the same pixel by less than `period_us`, whatever their sign."""

    def __init__(self, size: Size, period_us: int) -> None:
        if period_us < 0:
            raise SettingsError(f"a refractory period of {period_us} us is impossible: give 0 or more")
        self.size, self.period_us = size, period_us
        self._last_us = np.full((size[1], size[0]), np.iinfo(np.int64).min // 2)

    def push(self, events: Events) -> Events:
        """The events that are kept, of the next packet."""
        check_size(events, self.size)
        return only(events, _rested(events.t_us, events.x, events.y, self._last_us, self.period_us))


def only(events: Events, keep: Mask) -> Events:
    """The events where `keep` (N,) is True."""
    return Events(events.t_us[keep], events.x[keep], events.y[keep], events.p[keep], events.size)


def check_size(events: Events, size: Size) -> None:
    """RecordingError where the events are of another sensor."""
    if tuple(events.size) != tuple(size):
        raise RecordingError(
            f"events of a {events.size[0]}x{events.size[1]} sensor do not fit what was made for "
            f"{size[0]}x{size[1]}: measure this recording itself"
        )


@njit(cache=True)
def _count(x: NDArray[np.uint16], y: NDArray[np.uint16], counts: Counts) -> None:
    for i in range(len(x)):
        counts[y[i], x[i]] += 1


@njit(cache=True)
def _third_neighbour(counts: Counts, where: Mask) -> Counts:
    """(H, W) third largest count of the others in the 5x5 block, which moves inwards at the border.

    0 at the pixels where `where` is False.
    """
    height, width = counts.shape
    third = np.zeros_like(counts)
    for row in range(height):
        top = max(0, min(row - 2, height - 5))
        for column in range(width):
            if not where[row, column]:
                continue
            left = max(0, min(column - 2, width - 5))
            first, second, last = 0, 0, 0
            for r in range(top, min(height, top + 5)):
                for c in range(left, min(width, left + 5)):
                    if r == row and c == column:
                        continue
                    count = counts[r, c]
                    if count > first:
                        first, second, last = count, first, second
                    elif count > second:
                        second, last = count, second
                    elif count > last:
                        last = count
            third[row, column] = last
    return third


@njit(cache=True)
def _outside(x: NDArray[np.uint16], y: NDArray[np.uint16], mask: Mask) -> Mask:
    keep = np.empty(len(x), np.bool_)
    for i in range(len(x)):
        keep[i] = not mask[y[i], x[i]]
    return keep


@njit(cache=True)
def _rested(
    t_us: NDArray[np.int64], x: NDArray[np.uint16], y: NDArray[np.uint16], last_us: Counts, period_us: int
) -> Mask:
    keep = np.empty(len(t_us), np.bool_)
    for i in range(len(t_us)):
        keep[i] = t_us[i] - last_us[y[i], x[i]] >= period_us
        if keep[i]:
            last_us[y[i], x[i]] = t_us[i]
    return keep
