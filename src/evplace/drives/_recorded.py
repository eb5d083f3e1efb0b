"""The event images of a recording: from its store, where there is one, else decoded."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from evplace.core.errors import DamagedRecordingError, InputError, SettingsError
from evplace.core.events import Events
from evplace.imaging import store as stores
from evplace.imaging.recipe import Recipe
from evplace.imaging.stream import EventImage, EventImages, images_of
from evplace.sources.cleaning import Mask, MaskSource, pixel_mask, read_mask
from evplace.sources.readers import Canvas, Recording
from evplace.sources.simulators.recording import SimulatedRecording

T = TypeVar("T")


class StorePlace(NamedTuple):
    """Where a recording's event store lies, or is to lie."""

    path: Path
    write: bool
    """Whether it is written where there is none that can be used."""
    reading: Mapping[str, Any]
    """How the recording was opened: what of that changes its events."""


class RecordedImages:
    """All images of a recording by a recipe, one after another; what was read is said after the last."""

    def __init__(
        self,
        recording: Recording | SimulatedRecording,
        recipe: Recipe,
        given: MaskSource | None,
        place: StorePlace | None,
    ) -> None:
        """`given` are pixels to leave out. SettingsError where a store is to be written that cannot be."""
        self.mask: Mask | None = None
        """(H, W) True at the pixels whose events were left out."""
        self.info: dict[str, Any] = {}
        """Events dropped and cleaned, by reason; notes; what broke off; the store that was used."""
        self._recording, self._recipe, self._given = recording, recipe, given
        self._notes: list[str] = []
        fitting = isinstance(recording, Recording) and stores.fits(recipe) and recording.path.is_file()
        if place is not None and place.write and not fitting:
            raise SettingsError(
                f"`store` keeps where events fell, for binary images of a recording's windows by time: "
                f"leave it out for {recording.path}"
            )
        self._place = place if fitting else None

    def __iter__(self) -> Iterator[EventImage]:
        """From the store, where there is one that fits."""
        yield from self._images()
        self.info = self.info | {"notes": [*self.info["notes"], *self._notes]}

    def _images(self) -> Iterator[EventImage]:
        store = self._found()
        if store is not None and self._place is not None:
            self.mask, self.info = store.mask, store.info | {"store": str(self._place.path)}
            yield from store.images(self._recipe)
            return
        self.mask = pixel_mask(
            self._recording.packets(), self._recording.size, self._recipe.cleaning, self._given
        )
        writes = self._place is not None and self._place.write
        yield from (
            self._stored()
            if writes
            else self._decoded(EventImages(self._recording.size, self._recipe, self.mask))
        )

    def _decoded(self, stream: EventImages) -> Iterator[EventImage]:
        packets = GoodPart(packets_onto(self._recording, stream.canvas))
        yield from images_of(packets, stream)
        self.info = {
            "dropped": self._recording.dropped,
            "cleaned": stream.cleaned,
            "notes": self._recording.notes,
            "fault": packets.fault,
            "store": None,
        }

    def _stored(self) -> Iterator[EventImage]:
        """The images, whose short windows are stored on the way."""
        assert self._place is not None
        size, short = self._recording.size, stores.short_of(self._recipe.windows.seconds)
        writer = stores.StoreWriter(self._place.path, self._identity(), size, short)
        joined = None
        try:
            for bits, window in self._decoded(stores.short_windows(size, self._recipe, self.mask)):
                if joined is None:
                    joined = stores.JoinedImages(size, self._recipe, short, stores.first_of(window, short))
                if window.events:
                    writer.add(window.n, window.events, bits)
                    yield from joined.push(window.n, window.events, bits)
            if joined is not None:
                yield from joined.finish()
                writer.close(joined.first_us, self.info, self.mask)
        finally:
            writer.discard()
        if writer.lost is not None:
            self._notes.append(f"no store was written: {writer.lost}")

    def _found(self) -> stores.Store | None:
        """The store, if it is there, whole, and of this recording and recipe; else a note says why not."""
        if self._place is None or not (self._place.path / stores.MARK).exists():
            return None
        try:
            return stores.Store(self._place.path, self._identity(), self._recipe.windows.seconds)
        except InputError as error:
            then = "it is made again" if self._place.write else "it is not used, `store` makes it again"
            self._notes = [f"{error}: {then}"]
            return None

    def _identity(self) -> dict[str, Any]:
        assert self._place is not None
        given = None if self._given is None else read_mask(self._given, self._recording.size)
        return stores.identity(self._recording.path, self._recipe, given, self._place.reading)


def packets_onto(recording: Recording | SimulatedRecording, canvas: Canvas | None) -> Iterator[Events]:
    """The packets of a recording, many of whose events its reader marks on the canvas, if it has one."""
    return recording.packets(canvas) if isinstance(recording, Recording) else recording.packets()


class GoodPart(Generic[T]):
    """Packets, or images, up to where they broke off; what broke them off is kept in `fault`."""

    def __init__(self, parts: Iterable[T]) -> None:
        self._parts = parts
        self.fault: str | None = None

    def __iter__(self) -> Iterator[T]:
        try:
            yield from self._parts
        except DamagedRecordingError as error:
            self.fault = str(error)
