"""Service: a map, a source and a drive together, and all that may be asked about them."""

from __future__ import annotations

import asyncio
import io
import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evplace.core.errors import EvplaceError, RecordingError
from evplace.core.events import Events
from evplace.core.storage import sha256
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.placemap._files import SUMS
from evplace.serving._drive import Drive
from evplace.serving._feed import Feed, check_size
from evplace.serving._hub import Hub, grey
from evplace.serving._recorder import Recorder
from evplace.serving._report import Describer, Report, counted, epsg
from evplace.sources.live import Facts, Live
from evplace.sources.live.replay import Replaying

SILENT_S = 0.5
"""Seconds without an event after which the source counts as silent."""

Publish = Callable[[Report], None]


@dataclass
class Service:
    """What is served. `start` begins the drive, `close` ends it."""

    where: Localizer
    source: Live
    path: Path
    """Where the map lies."""
    name: str
    """How the source is called."""
    record: Path | None = None
    overwrite: bool = False
    outputs: list[Publish] = field(default_factory=list)
    """Where reports go beside the hub."""

    def __post_init__(self) -> None:
        self.map: PlaceMap = self.where.map
        self.sha256 = sha256(self.path / SUMS)
        self.describer = Describer(self.map, self.sha256)
        size = sensor_of(self.map, self.source)
        self.recorder = None if self.record is None else Recorder(self.record, size, self.overwrite)
        self.feed = Feed(self.source, size, self.recorder)
        self.drive = Drive(self.where, self.feed, self._publish)
        self.hub: Hub | None = None
        self._begun_s = time.monotonic()

    def start(self, loop: asyncio.AbstractEventLoop | None = None) -> None:
        """Begin; with a loop, everybody who listens there hears of it."""
        self.hub = None if loop is None else Hub(self.describer, loop)
        warm(self.where, self.feed.size)
        self.drive.start()

    def close(self) -> None:
        """End the drive and complete the recording, within about a second."""
        self.drive.close(0.6)
        if self.recorder is not None:
            self.recorder.close(30.0)

    def _publish(self, report: Report) -> None:
        for output in self.outputs:
            output(report)
        if self.hub is not None:
            self.hub.publish(report, self.where.image)

    def state(self) -> dict[str, Any]:
        """All that is known now, as JSON has it."""
        latest = None if self.hub is None else self.hub.latest
        return {
            "match": latest,
            "map": {"name": self.path.name, "sha256": self.sha256, "replaced": self._is_replaced()},
            "matcher": self.where.settings["name"],
            "source": self.source_state(),
            "counters": self._counters(),
            "recording": self._recording(),
            "clients": 0 if self.hub is None else self.hub.listeners,
            "up_s": round(time.monotonic() - self._begun_s, 1),
        }

    def source_state(self) -> dict[str, Any]:
        """What the source is doing: live, silent, paused or ended; and how far a replay has come."""
        silent_s = time.monotonic() - self.feed.last_s
        replay = self.source if isinstance(self.source, Replaying) else None
        state = "silent" if silent_s > SILENT_S else "live"
        if replay is not None and replay.paused:
            state = "paused"
        if self.drive.ended.is_set():
            state = "ended"
        return {
            "name": self.name,
            "state": state,
            "silent_s": round(silent_s, 2),
            "fault": self.drive.fault or self.feed.fault,
            "notes": list(Facts.of(self.source).notes),
            "replay": None if replay is None else _played(replay),
        }

    def healthy(self) -> bool:
        """Whether the drive goes on, or has ended well."""
        return self.drive.fault is None

    def change_replay(self, paused: bool | None, speed: float | None, by_s: float) -> None:
        """Pause, change or wind a replay; RecordingError where the source is none."""
        if not isinstance(self.source, Replaying) or self.source.waits:
            raise RecordingError("this source is no replay at a pace: there is nothing to pause or to wind")
        self.source.change(paused, speed, by_s)

    def route(self) -> dict[str, Any]:
        """The map as the page draws it: positions of its items, and of the drive that it was learned from."""
        items, drive = self.map.items, self.map.drive
        return {
            "name": self.path.name,
            "sha256": self.sha256,
            "epsg": epsg(self.map),
            "items": _rounded(items.position),
            "places": items.place.tolist(),
            "drive": _rounded(drive[:, :2]),
            "image_shape": list(self.map.image_shape[:2]),
            "has_images": _has_images(self.map),
        }

    def reference(self, item: int) -> bytes | None:
        """A reference image as PNG; None where the map has none for that item."""
        if not _has_images(self.map) or not 0 <= item < len(self.map.items):
            return None
        image = self.map.images_of([item])
        assert image is not None
        from PIL import Image

        file = io.BytesIO()
        Image.fromarray(grey(image[0])).save(file, "PNG")
        return file.getvalue()

    def _counters(self) -> dict[str, Any]:
        counters = self.feed.counters()
        left_out = 0 if self.recorder is None else self.recorder.left_out
        more = {"rejected": counters.rejected, "not_recorded": left_out}
        return {"events": counters.events, **counted(counters), **more}

    def _recording(self) -> dict[str, Any] | None:
        if self.recorder is None:
            return None
        return {"file": str(self.recorder.path), "fault": self.recorder.fault}

    def _is_replaced(self) -> bool:
        """Whether another map lies there by now: this service goes on with the one that it has loaded."""
        try:
            return sha256(self.path / SUMS) != self.sha256
        except (OSError, EvplaceError):
            return True


def warm(where: Localizer, size: tuple[int, int]) -> None:
    """Have all that is compiled or loaded at first use ready, without a trace in the drive."""
    events = Events.of([0, 1, 40_000], [0, 1, 2], [0, 1, 2], [True, False, True], size)
    for _ in itertools.chain(where.push(events), where.tick(80_000), where.finish()):
        pass
    where.reset()


def sensor_of(place_map: PlaceMap, source: Live) -> tuple[int, int]:
    """The sensor's size; RecordingError where map and source have two, or neither says it."""
    recipe = place_map.recipe
    wanted = None if recipe is None else recipe.size
    given = Facts.of(source).size
    try:
        check_size(wanted, given)
    except RecordingError:
        source.close()
        raise
    size = wanted or given
    if size is None:
        source.close()
        raise RecordingError("neither the map nor the source says the sensor's size: give the `size`")
    return (int(size[0]), int(size[1]))


def _played(replay: Replaying) -> dict[str, Any]:
    return {
        "at_s": round(replay.at_us / 1e6, 2),
        "loop": replay.loop,
        "speed": replay.speed,
        "paused": replay.paused,
        "can_change": not replay.waits,
    }


def _has_images(place_map: PlaceMap) -> bool:
    images = place_map.images_of([0])
    return images is not None and images.dtype == np.uint8 and images.ndim in (3, 4)


def _rounded(positions: np.ndarray[Any, Any]) -> list[list[float] | None]:
    """Positions to centimetres; None where one is unknown."""
    return [None if np.isnan(at).any() else [round(float(value), 2) for value in at] for at in positions]
