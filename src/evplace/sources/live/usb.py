"""USB cameras through neuromorphic-drivers: EVK4, EVK3 HD, DAVIS346, DVXplorer and others."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from evplace.core.errors import MissingExtraError, RecordingError
from evplace.core.events import Size
from evplace.sources.live import WAIT_S, Item, Live
from evplace.sources.live._bytes import as_block


@dataclass(frozen=True)
class USB:
    """A camera that is plugged in."""

    where: str = ""
    """Its serial number; the first camera where there is none."""

    def open(self, size: Size | None) -> Live:
        """Begin; RecordingError where there is no such camera, MissingExtraError without the drivers."""
        drivers = _drivers()
        cameras = _listed(drivers)
        serials = ", ".join(str(camera.serial) for camera in cameras) or "none"
        if not cameras or (self.where and self.where not in serials.split(", ")):
            named = f"with the serial '{self.where}' " if self.where else ""
            raise RecordingError(
                f"no event camera {named}is plugged in: found are {serials}; on Linux "
                "`neuromorphic-drivers-install-udev-rules` lets everybody use one"
            )
        try:
            device = drivers.open(serial=self.where or None, iterator_timeout=WAIT_S)
        except RuntimeError as error:
            raise RecordingError(
                f"the camera cannot be opened: {error}: is another program using it?"
            ) from error
        return Filming(device)


class Filming:
    """A camera that is open."""

    pace = 1.0
    waits = False

    def __init__(self, device: Any) -> None:
        known = device.properties()
        self.size: Size | None = (int(known.width), int(known.height))
        self.lost = 0
        self.notes: list[str] = []
        self._device = device
        self._closed = threading.Event()

    def close(self) -> None:
        """End the filming."""
        self._closed.set()

    def blocks(self) -> Iterator[Item]:
        """What the camera sends; RecordingError where it was unplugged."""
        dropped = 0
        try:
            with self._device:
                for status, packet in self._device:
                    if self._closed.is_set():
                        return
                    now = 0 if status.ring is None else int(status.ring.dropped_packets)
                    self.lost, dropped = self.lost + max(0, now - dropped), now
                    yield None if packet is None else self._events(packet)
        except RuntimeError as error:
            raise RecordingError(f"the camera is gone: {error}") from error

    def _events(self, packet: Any) -> Item:
        """The events of a packet that may hold other things alone."""
        overflows = packet.polarity_events_overflow_indices
        self.lost += 0 if overflows is None else len(overflows)
        events = packet.polarity_events
        if events is None or not len(events):
            return None
        return as_block(events["t"], events["x"], events["y"], events["on"])


def _drivers() -> Any:
    try:
        import neuromorphic_drivers
    except ImportError as error:
        raise MissingExtraError("neuromorphic-drivers", "live", "a USB camera") from error
    return neuromorphic_drivers


def _listed(drivers: Any) -> list[Any]:
    """The cameras; RecordingError where this machine has no USB."""
    try:
        return list(drivers.list_devices())
    except RuntimeError as error:
        raise RecordingError(
            f"this machine shows no USB to programs ({error}): no camera can be read"
        ) from error
