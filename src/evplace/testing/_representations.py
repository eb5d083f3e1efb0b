"""What holds for every representation."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from evplace.core.errors import RecordingError
from evplace.core.events import Events
from evplace.imaging.images import ImageSettings
from evplace.imaging.representations import Channels
from evplace.testing._require import refusing, require

SIZE = (37, 23)
"""Width and height: unequal, so that rows and columns cannot be confused."""
END_US = 30_000


def check_representation(kind: type[Any]) -> None:
    """AssertionError where a class breaks what `evplace.imaging.representations.Representation` promises.

    Its `used` names settings of images; channels are (C, H, W) int8 of 0 and -1, or float32 from 0 to 1; any
    cutting of the events gives the same, a window without events too; an event outside the sensor is refused.
    """
    who = f"the representation {kind.__name__}"
    used = getattr(kind, "used", None)
    require(isinstance(used, tuple), f"{who} must name the settings that it takes in a tuple, 'used'")
    names = {field.name for field in dataclasses.fields(ImageSettings)}
    require(set(used or ()) <= names, f"{who} takes {used}, of which not all are settings of images")
    events = _events()
    whole, empty = _channels(kind, [events]), _channels(kind, [])
    _check_channels(whole, who)
    _check_channels(empty, who)
    require(empty.shape == whole.shape, f"{who} has other channels for a window without events")
    require(not np.array_equal(whole, empty), f"{who} does not show the events of a window")
    pieces = [events[start : start + 7] for start in range(0, len(events), 7)]
    require(np.array_equal(whole, _channels(kind, [events[:0], *pieces])), f"{who} depends on the packets")
    _check_windows(kind, events, who)
    for x, y in ((SIZE[0], 0), (0, SIZE[1])):
        outside = Events.of([0], [x], [y], [True], SIZE)
        with refusing(RecordingError, f"{who} must refuse an event outside the sensor with RecordingError"):
            _opened(kind).add(outside)


def _check_windows(kind: type[Any], events: Events, who: str) -> None:
    """That `clear` begins a window, and that equal drives leave equal windows."""
    first, second = _opened(kind), _opened(kind)
    for one in (first, second):
        one.add(events)
        one.clear()
    later = Events(events.t_us + END_US, events.y % SIZE[0], events.x % SIZE[1], events.p, SIZE)
    before = later.t_us.copy(), later.x.copy()
    for one in (first, second):
        one.add(later)
    channels = first.channels(2 * END_US)
    _check_channels(channels, who)
    require(np.array_equal(channels, second.channels(2 * END_US)), f"{who} sees a window anew each time")
    require(
        np.array_equal(before[0], later.t_us) and np.array_equal(before[1], later.x), f"{who} changes events"
    )


def _check_channels(channels: Channels, who: str) -> None:
    require(
        channels.ndim == 3 and channels.shape[1:] == SIZE[::-1],
        f"{who} must give (C, {SIZE[1]}, {SIZE[0]}) channels , it gave {channels.shape}",
    )
    if channels.dtype == np.int8:
        require(np.isin(channels, (0, -1)).all(), f"{who} gives int8 channels that are not 0 or -1 (set)")
    else:
        require(channels.dtype == np.float32, f"{who} must give int8 or float32, it gave {channels.dtype}")
        within = np.isfinite(channels).all() and channels.min() >= 0 and channels.max() <= 1
        require(within, f"{who} gives float32 channels beyond 0 to 1")


def _channels(kind: type[Any], packets: list[Events]) -> Channels:
    opened = _opened(kind)
    for events in packets:
        opened.add(events)
    return np.array(opened.channels(END_US))


def _opened(kind: type[Any]) -> Any:
    defaults = ImageSettings()
    return kind(SIZE, **{name: getattr(defaults, name) for name in kind.used})


def _events() -> Events:
    """Two thousand events, some of them at one pixel."""
    rng = np.random.default_rng(0)
    x, y = rng.integers(0, SIZE[0], 2000), rng.integers(0, SIZE[1], 2000)
    return Events.of(np.sort(rng.integers(1, END_US, 2000)), x, y, rng.random(2000) < 0.5, SIZE)
