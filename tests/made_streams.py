"""Events as other programs and cameras send them."""

from __future__ import annotations

import tempfile
import types
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from evplace.core.events import Events, Size
from evplace.serving.ros import Cdr
from evplace.sources.live._bytes import PACKED
from evplace.sources.writers.evt3 import write as write_evt3

# Pipes and growing files


def as_bytes(format: str, events: Events) -> bytes:
    """A drive as a stream of one of the FORMATS holds it."""
    if format == "evt3":
        with tempfile.TemporaryDirectory() as folder:
            write_evt3(Path(folder) / "stream.raw", [events], events.size)
            return (Path(folder) / "stream.raw").read_bytes()
    if format == "evt2":
        return evt2(events)
    if format == "packed":
        return packed(events)
    return b"".join(b"%d %d %d %d\n" % row for row in rows(events))


def rows(events: Events) -> Iterator[tuple[int, int, int, int]]:
    """Time, x, y and polarity of one event after another."""
    columns = (events.t_us.tolist(), events.x.tolist(), events.y.tolist(), events.p.astype(int).tolist())
    return zip(*columns, strict=True)


def packed(events: Events) -> bytes:
    table = np.zeros(len(events), PACKED)
    table["t"], table["x"], table["y"], table["p"] = events.t_us, events.x, events.y, events.p
    return table.tobytes()


def evt2(events: Events) -> bytes:
    words: list[int] = []
    high = None
    for t, x, y, p in rows(events):
        if t >> 6 != high:
            high = t >> 6
            words.append(0x8 << 28 | high)
        words.append(p << 28 | (t & 0x3F) << 22 | x << 11 | y)
    head = f"% evt 2.0\n% geometry {events.size[0]}x{events.size[1]}\n% end\n"
    return head.encode() + np.array(words, "<u4").tobytes()


# UDP packets


def datagrams(layout: str, events: Events) -> list[bytes]:
    """The packets of one of the LAYOUTS."""
    parts = [events[at : at + 100] for at in range(0, len(events), 100)]
    if layout == "faery":
        return [packed(part) for part in parts]
    if layout == "faery-32":
        return [faery_32(part) for part in parts]
    return [spif(part, ">" if layout == "spif-be" else "<") for part in parts]


def faery_datagrams(events: Events) -> list[bytes]:
    return datagrams("faery", events)


def faery_32(events: Events) -> bytes:
    table = np.zeros(len(events), [("t", "<u4"), ("x", "<u2"), ("y", "<u2")])
    table["t"], table["x"], table["y"] = events.t_us & 0xFFFFFFFF, events.x, events.y << 1 | events.p
    return table.tobytes()


def spif(events: Events, order: str) -> bytes:
    words = np.zeros((len(events), 2), f"{order}u4")
    words[:, 0] = events.x.astype(np.uint32) << 16 | events.p.astype(np.uint32) << 15 | events.y
    words[:, 1] = events.t_us
    return words.tobytes()


# Messages of ROS 2


def ros_messages(encoding: str, events: Events) -> list[bytes]:
    """A drive as EventPackets of an encoding."""
    parts = [events[at : at + 1000] for at in range(0, len(events), 1000)]
    packets = {
        "evt3": lambda: evt3_packets(events),
        "mono": lambda: [mono(part) for part in parts],
        "libcaer": lambda: [libcaer(part) for part in parts],
        "libcaer_cmp": lambda: [libcaer_cmp(part) for part in parts],
    }[encoding]()
    first_ns = int(events.t_us[0]) * 1000
    return [message(encoding, packet, first_ns, 0, events.size) for packet in packets]


def message(encoding: str, events: bytes, stamp_ns: int, base_ns: int, size: Size = (80, 60)) -> bytes:
    """An EventPacket as ROS 2 serialises it."""
    cdr = Cdr().header(stamp_ns, "camera").put("I", size[1], size[0]).put("Q", 0, base_ns)
    cdr.text(encoding).put("B", 0).put("I", len(events))
    return cdr.message() + events


def evt3_packets(events: Events) -> list[bytes]:
    """The words of a drive, cut anywhere, as a camera's clock goes on from packet to packet."""
    words = as_bytes("evt3", events).partition(b"% end\n")[2]
    return [words[at : at + 5000] for at in range(0, len(words), 5000)]


def mono(events: Events) -> bytes:
    words = events.t_us.astype(np.uint64) * np.uint64(1000)
    words |= events.x.astype(np.uint64) << np.uint64(32) | events.y.astype(np.uint64) << np.uint64(48)
    return bytes((words | events.p.astype(np.uint64) << np.uint64(63)).astype("<u8").tobytes())


def libcaer(events: Events) -> bytes:
    words = np.zeros((len(events), 2), "<u4")
    words[:, 0] = events.x.astype(np.uint32) << 17 | events.y.astype(np.uint32) << 2 | events.p << 1 | 1
    words[:, 1] = events.t_us
    return words.tobytes()


def libcaer_cmp(events: Events) -> bytes:
    words: list[int] = []
    for t, x, y, p in rows(events):
        words += [0x0000 | t >> 12, 0x1000 | t & 0xFFF, 0x2000 | x, 0x3000 | p << 11 | y]
    return np.array(words, "<u2").tobytes()


# USB cameras: a stand-in for neuromorphic_drivers; no camera was at hand


def packet(t_us: list[int], overflows: list[int] | None = None) -> Any:
    """What a camera hands over at a time, at the pixel (0, 0)."""
    nothing = [0] * len(t_us)
    return camera_packet(Events.of(t_us, nothing, nothing, nothing, (80, 60)), overflows)


def camera_packet(events: Events, overflows: list[int] | None = None) -> Any:
    table = np.zeros(len(events), [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")])
    table["t"], table["x"], table["y"], table["on"] = events.t_us, events.x, events.y, events.p
    return SimpleNamespace(polarity_events=table, polarity_events_overflow_indices=overflows)


class Camera(types.ModuleType):
    """What we use of neuromorphic_drivers."""

    def __init__(self, cameras: list[str] | None, said: list[Any]) -> None:
        super().__init__("neuromorphic_drivers")
        self.cameras, self.said = cameras, said
        self.closed = False

    def list_devices(self) -> list[Any]:
        if self.cameras is None:
            raise RuntimeError("Other error")
        return [SimpleNamespace(serial=serial) for serial in self.cameras]

    def open(self, serial: str | None, iterator_timeout: float) -> Camera:
        assert iterator_timeout > 0
        if serial == "busy":
            raise RuntimeError("Access denied")
        return self

    def properties(self) -> Any:
        return SimpleNamespace(width=80, height=60)

    def __enter__(self) -> Camera:
        return self

    def __exit__(self, *_: object) -> None:
        self.closed = True

    def __iter__(self) -> Iterator[Any]:
        for dropped, said in self.said:
            if isinstance(said, Exception):
                raise said
            yield SimpleNamespace(ring=SimpleNamespace(dropped_packets=dropped)), said
