"""ROS 2's event_camera_msgs/EventPacket over zenoh, as rmw_zenoh sends it, without a ROS installation."""

from __future__ import annotations

import contextlib
import json
import queue
import struct
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from evplace.core.errors import MissingExtraError, RecordingError, SettingsError, UnsupportedError
from evplace.core.events import Size
from evplace.sources.live import ANEW, WAIT_S, Item, Live
from evplace.sources.readers._ros import FAULTS, Fields, Packets

TOPIC = "event_camera/events"
HELD = 256
"""Messages that are held at most until they are decoded; the oldest go first."""
GID = 16
"""Bytes that end a message's attachment and name who published it."""


@dataclass(frozen=True)
class Zenoh:
    """A topic of ROS 2 with `RMW_IMPLEMENTATION=rmw_zenoh_cpp`, or of a zenoh bridge in front of another."""

    where: str = TOPIC
    """The topic, such as /event_camera/events."""
    router: str = ""
    """Where to connect: tcp/192.168.1.5:7447; the router on this machine where it is empty."""
    domain: int = 0
    """ROS_DOMAIN_ID."""
    mode: str = "client"
    """client, as ROS nodes are, or peer."""

    def __post_init__(self) -> None:
        if self.mode not in ("client", "peer"):
            raise SettingsError(f"the setting 'mode' cannot be '{self.mode}': it is client or peer")

    def open(self, size: Size | None) -> Live:
        """Subscribe; RecordingError where nobody is there, MissingExtraError without eclipse-zenoh."""
        topic = self.where.strip("/") or TOPIC
        return Subscribed(session(self.router, self.mode), f"{self.domain}/{topic}/**", size)


class Subscribed:
    """A topic that is listened to."""

    pace = 1.0
    waits = False

    def __init__(self, session: Any, key: str, size: Size | None) -> None:
        self.size = size
        self.lost = 0
        self.notes: list[str] = []
        self._given = size
        self._publisher = b""
        self._decode = Packets(aligned=True)
        self._messages: queue.Queue[tuple[bytes, bytes]] = queue.Queue(HELD)
        self._closed = threading.Event()
        self._begun = False
        self._session = session
        self._subscriber = session.declare_subscriber(key, self._take)

    def close(self) -> None:
        """End the listening."""
        self._closed.set()
        if not self._begun:
            leave(self._session)

    def blocks(self) -> Iterator[Item]:
        """The events of the messages; one that cannot be decoded is counted as lost."""
        self._begun = True
        try:
            while not self._closed.is_set():
                try:
                    data, publisher = self._messages.get(timeout=WAIT_S)
                except queue.Empty:
                    yield None
                    continue
                if publisher != self._publisher:
                    if self._publisher:
                        yield ANEW
                    self._publisher, self._decode = publisher, Packets(aligned=True)
                yield self._events(data)
        finally:
            leave(self._session)

    def _events(self, data: bytes) -> Item:
        try:
            self._check_size(data)
            block = self._decode(data)
        except (*FAULTS, UnsupportedError) as error:
            self.lost += 1
            self.notes = [f"messages that cannot be read: {error}"]
            return None
        return block if len(block.t_us) else None

    def _check_size(self, data: bytes) -> None:
        """Take the sensor's size; ValueError where it is not the map's."""
        fields = Fields(data, aligned=True)
        fields.header()
        height, width = fields.take("I"), fields.take("I")
        if self._given is not None and (width, height) != self._given:
            raise ValueError(f"of a sensor of {width}x{height} pixels, not {self._given[0]}x{self._given[1]}")
        self.size = (width, height)

    def _take(self, sample: Any) -> None:
        """Called by zenoh, on a thread of its own."""
        attachment = bytes(sample.attachment) if sample.attachment is not None else b""
        with contextlib.suppress(queue.Empty):
            if self._messages.full():
                self._messages.get_nowait()
                self.lost += 1
        with contextlib.suppress(queue.Full):
            self._messages.put_nowait((bytes(sample.payload), attachment[-GID:]))


def session(router: str, mode: str, listen: str = "") -> Any:
    """An open zenoh session; RecordingError where there is nobody to connect to."""
    try:
        import zenoh
    except ImportError as error:
        raise MissingExtraError("eclipse-zenoh", "live", "ROS 2 over zenoh") from error
    config = zenoh.Config()
    config.insert_json5("mode", json.dumps(mode))
    config.insert_json5("scouting/multicast/enabled", "false")
    if router or mode == "client":
        config.insert_json5("connect/endpoints", json.dumps([router or "tcp/localhost:7447"]))
    config.insert_json5("listen/endpoints", json.dumps([listen] if listen else []))
    try:
        return zenoh.open(config)
    except zenoh.ZError as error:
        reason = str(error).partition(" at /")[0].rstrip(" !")  # the rest is a line of zenoh's source
        raise RecordingError(
            f"no zenoh router at {router or 'tcp/localhost:7447'}: start one (ros2 run rmw_zenoh_cpp "
            f"rmw_zenohd), or name another ({reason})"
        ) from error


def leave(session: Any) -> None:
    """Close a session; nobody waits for a peer that does not answer the farewell in time."""
    import zenoh

    with contextlib.suppress(zenoh.ZError):
        session.close()


def attachment(sequence: int, stamp_ns: int, publisher: bytes) -> bytes:
    """What rmw_zenoh sends beside a message: its number, its time, and who published it (GID bytes)."""
    return struct.pack("<qqB", sequence, stamp_ns, len(publisher)) + publisher
