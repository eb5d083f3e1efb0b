"""Packets of events in, event images out: the one path for files, live cameras and evaluation alike."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evplace.core.events import Events, Size
from evplace.imaging.images import Imager
from evplace.imaging.recipe import Recipe
from evplace.imaging.windows import TimeWindows, Window, open_windows
from evplace.sources.cleaning import Cleaner, Mask
from evplace.sources.readers import Canvas


class EventImage(NamedTuple):
    """One window as an image."""

    image: NDArray[np.uint8]
    """(h, w), or (h, w, C) where the representation has several channels."""
    window: Window
    """Number, time of its end and count of events."""


class EventImages:
    """Cleans a stream of events, cuts it into windows and makes images; packet sizes change nothing."""

    def __init__(self, size: Size, recipe: Recipe | None = None, mask: Mask | None = None) -> None:
        """For a sensor of `size` (width, height) in pixels; `mask` (H, W) is True at pixels to leave out."""
        recipe = recipe or Recipe()
        self._cleaner = Cleaner(size, recipe.cleaning, mask)
        self._windows = open_windows(recipe.windows)
        self._imager = Imager(size, recipe.images)
        self._last_us: int | None = None
        self.canvas = self._open_canvas(mask)
        """What `Recording.packets` may mark events on in place of handing them over, which is faster. None
        where images show more than where events fell, windows are cut by count, or not just a mask cleans."""

    @property
    def cleaned(self) -> dict[str, int]:
        """Reason -> events left out by the cleaning so far."""
        return self._cleaner.dropped

    def push(self, events: Events) -> Iterator[EventImage]:
        """The images of all windows that `events` bring to their end.

        InputError where they are no packet, or come before those pushed already.
        """
        events.check(self._last_us)
        self._last_us = int(events.t_us[-1]) if len(events) else self._last_us
        self._take_marked()
        for piece, window in self._windows.push(self._cleaner.push(events)):
            self._imager.add(piece)
            if window is not None:
                yield EventImage(self._imager.image(window.t_us), window)
        if self.canvas is not None and isinstance(self._windows, TimeWindows):
            self.canvas.end_us = self._windows.end_us

    def tick(self, t_us: int) -> Iterator[EventImage]:
        """The images of all windows that are over once no event up to `t_us` will come any more."""
        for window in self._windows.tick(t_us):
            yield EventImage(self._imager.image(window.t_us), window)

    def finish(self) -> Iterator[EventImage]:
        """The image of the last window, when the stream is over."""
        self._take_marked()
        window = self._windows.finish()
        if window is not None:
            yield EventImage(self._imager.image(window.t_us), window)

    def _open_canvas(self, mask: Mask | None) -> Canvas | None:
        marks = isinstance(self._windows, TimeWindows) and self._cleaner.masks_alone
        return Canvas(self._imager.grid, mask) if marks and self._imager.grid is not None else None

    def _take_marked(self) -> None:
        """Count what was marked since, which lies in the open window."""
        if self.canvas is not None and isinstance(self._windows, TimeWindows):
            marked, masked = self.canvas.taken()
            self._windows.add(marked)
            if masked:
                self._cleaner.count("masked", masked)


def event_images(packets: Iterable[Events], size: Size, recipe: Recipe | None = None) -> Iterator[EventImage]:
    """The images of a whole recording, one after another, in bounded memory."""
    yield from images_of(packets, EventImages(size, recipe))


def images_of(packets: Iterable[Events], stream: EventImages) -> Iterator[EventImage]:
    """The images that `stream` makes of all `packets`."""
    for events in packets:
        yield from stream.push(events)
    yield from stream.finish()
