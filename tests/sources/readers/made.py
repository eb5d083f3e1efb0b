"""Small recordings of every format, made by code or by a second library."""

from __future__ import annotations

import contextlib
import itertools
import sqlite3
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evplace.core.errors import DamagedRecordingError
from evplace.core.events import Events
from evplace.sources.readers import Recording
from evplace.testing._readers import SIZE, some_events

__all__ = ["MAKERS", "SIZE", "some_events"]


def good_part(recording: Recording) -> Events:
    """What was delivered before the recording broke off or proved doubtful."""
    packets = []
    with contextlib.suppress(DamagedRecordingError):
        for packet in recording.packets():
            packets.append(packet)
    return Events.concatenate(packets)


def _by_faery(name: str, **options: Any) -> Callable[[Path, Events], Path]:
    def write(folder: Path, events: Events) -> Path:
        faery = pytest.importorskip("faery")
        array = np.zeros(len(events), faery.events_stream.EVENTS_DTYPE)
        array["t"], array["x"], array["y"], array["p"] = events.t_us, events.x, events.y, events.p
        packets = [array[start : start + 100] for start in range(0, len(array), 100)]
        faery.file_encoder.events_to_file(packets, folder / name, events.size, zero_t0=False, **options)
        return folder / name

    return write


def aedat2(folder: Path, events: Events) -> Path:
    address = (
        (179 - events.y.astype(np.uint32)) << 22
        | (239 - events.x.astype(np.uint32)) << 12
        | events.p.astype(np.uint32) << 11
    )
    words = np.stack([address, events.t_us.astype(np.uint32)], 1).astype(">u4").tobytes()
    path = folder / "made.aedat"
    path.write_bytes(b"#!AER-DAT2.0\r\n# AEChip: eu.seebetter.ini.chips.davis.DAVIS240C\r\n" + words)
    return path


def evt21(folder: Path, events: Events) -> Path:
    path = folder / "made.raw"
    path.write_bytes(b"% evt 2.1\n% geometry 240x180\n% end\n" + evt21_words(events).tobytes())
    return path


def evt21_words(events: Events) -> np.ndarray:
    """One word an event, and one with the high bits of the time before each."""
    t, x, y, p = (field.astype(np.uint64) for field in (events.t_us, events.x, events.y, events.p))
    high = np.uint64(8) << np.uint64(60) | t >> np.uint64(6) << np.uint64(32)
    event = p << np.uint64(60) | (t & np.uint64(63)) << np.uint64(54) | (x & ~np.uint64(31)) << np.uint64(43)
    event |= y << np.uint64(32) | np.uint64(1) << (x & np.uint64(31))
    return np.stack([high, event], 1).astype("<u8").reshape(-1)


def npz(folder: Path, events: Events) -> Path:
    path = folder / "made.npz"
    names = {"t_us": events.t_us, "x": events.x, "y": events.y, "p": events.p}
    np.savez_compressed(path, **names, width=events.size[0], height=events.size[1])
    return path


def npy(folder: Path, events: Events) -> Path:
    rows = np.zeros(len(events), [("x", "<u2"), ("y", "<u2"), ("t_us", "<i8"), ("p", "?")])
    rows["t_us"], rows["x"], rows["y"], rows["p"] = events.t_us, events.x, events.y, events.p
    np.save(folder / "made.npy", rows)
    return folder / "made.npy"


def hdf5(folder: Path, events: Events) -> Path:
    """The layout of DSEC, in chunks."""
    h5py: Any = pytest.importorskip("h5py")
    path = folder / "made.h5"
    with h5py.File(path, "w") as file:
        file["t_offset"] = 0
        file["ms_to_idx"] = np.searchsorted(events.t_us, np.arange(0, 100_000, 1000))
        group = file.create_group("events")
        group.attrs["width"], group.attrs["height"] = events.size
        for name, rows in (
            ("t", events.t_us),
            ("x", events.x),
            ("y", events.y),
            ("p", events.p.astype("u1")),
        ):
            group.create_dataset(name, data=rows, chunks=(min(1024, len(rows)),), compression="gzip")
    return path


def aedat3(folder: Path, events: Events) -> Path:
    """Packets of 100 events, and one of another kind between any two."""
    data = b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS240C\r\n#!END-HEADER\r\n"
    pixel = events.x.astype("<u4") << 17 | events.y.astype("<u4") << 2 | events.p.astype("<u4") << 1 | 1
    words = np.stack([pixel, (events.t_us & 0x7FFFFFFF).astype("<u4")], 1)
    for start in range(0, len(events), 100):
        part, wraps = words[start : start + 100], int(events.t_us[start] >> 31)
        data += struct.pack("<hhiiiiii", 1, 1, 8, 4, wraps, len(part), len(part), len(part)) + part.tobytes()
        data += struct.pack("<hhiiiiii", 3, 1, 36, 4, wraps, 1, 1, 1) + bytes(36)
    path = folder / "made3.aedat"
    path.write_bytes(data)
    return path


def ros2_mcap(folder: Path, events: Events) -> Path:
    return mcap_topics(folder, {"/events": packet_messages(events, aligned=True)})


def mcap_topics(folder: Path, topics: dict[str, list[bytes]]) -> Path:
    """Event packets of several topics, in turn."""
    writer: Any = pytest.importorskip("mcap.writer")
    path = folder / "made.mcap"
    with path.open("wb") as file:
        out = writer.Writer(file, chunk_size=4000, compression=writer.CompressionType.ZSTD)
        out.start("ros2", "test")
        schema = out.register_schema("event_camera_msgs/msg/EventPacket", "ros2msg", b"")
        channels = [out.register_channel(topic, "cdr", schema) for topic in topics]
        for turn in itertools.zip_longest(*topics.values()):
            for channel, message in zip(channels, turn, strict=True):
                if message is not None:
                    out.add_message(channel, log_time=0, publish_time=0, data=message)
        out.finish()
    return path


def parquet(folder: Path, events: Events) -> Path:
    pyarrow: Any = pytest.importorskip("pyarrow")
    files: Any = pytest.importorskip("pyarrow.parquet")
    columns = {"t_ns": events.t_us * 1000, "x": events.x, "y": events.y, "p": events.p.astype("u1")}
    files.write_table(pyarrow.table(columns), folder / "made.parquet", row_group_size=500)
    return folder / "made.parquet"


def text(folder: Path, events: Events) -> Path:
    """Seconds, as rpg's data sets write them."""
    rows = zip(events.t_us.tolist(), events.x.tolist(), events.y.tolist(), events.p.tolist(), strict=True)
    path = folder / "made.txt"
    path.write_text("240 180\n" + "".join(f"{t / 1e6:.6f} {x} {y} {p:d}\n" for t, x, y, p in rows))
    return path


def evt3_words(events: Events) -> np.ndarray:
    """Events one by one, each with its row and time."""
    words = np.empty((len(events), 4), np.uint16)
    words[:, 0] = 0x8000 | (events.t_us >> 12 & 0xFFF)
    words[:, 1] = 0x6000 | (events.t_us & 0xFFF)
    words[:, 2] = events.y
    words[:, 3] = 0x2000 | events.p.astype(np.uint16) << 11 | events.x
    return words.reshape(-1)


def mono_words(events: Events) -> np.ndarray:
    """As the encoding mono of event_camera_msgs: 64 bits an event, times in ns."""
    t_ns = events.t_us.astype("<u8") * np.uint64(1000)
    x, y, p = (field.astype("<u8") for field in (events.x, events.y, events.p))
    return p << np.uint64(63) | y << np.uint64(48) | x << np.uint64(32) | t_ns


def libcaer_words(events: Events) -> np.ndarray:
    """As the encoding libcaer: two words an event, whose times wrap."""
    pixel = events.x.astype("<u4") << 17 | events.y.astype("<u4") << 2 | events.p.astype("<u4") << 1 | 1
    return np.stack([pixel, (events.t_us & 0x7FFFFFFF).astype("<u4")], 1)


def encoded(encoding: str, base_ns: int, payload: bytes) -> bytes:
    """A serialised event_camera_msgs/EventPacket of ROS 1, stamped 7 s."""
    head = struct.pack("<IIII3sIIQQ", 0, 7, 0, 3, b"cam", 180, 240, 0, base_ns)
    name = encoding.encode()
    return head + struct.pack("<I", len(name)) + name + b"\0" + struct.pack("<I", len(payload)) + payload


def packet_messages(events: Events, aligned: bool, each: int = 200) -> list[bytes]:
    """The events as serialised event_camera_msgs/EventPacket."""
    messages = []
    for start in range(0, len(events), each):
        words = evt3_words(events[start : start + each]).tobytes()
        stamp = struct.pack("<II", 0, 0)
        if aligned:
            head = stamp + struct.pack("<I4sII", 4, b"cam\0", events.size[1], events.size[0])
            head += b"\0" * (-len(head) % 8) + struct.pack("<QQI5sB", start, 0, 5, b"evt3\0", 0)
            head = b"\0\1\0\0" + head + b"\0" * (-len(head) % 4)
        else:
            head = (
                struct.pack("<I", start)
                + stamp
                + struct.pack("<I3sII", 3, b"cam", events.size[1], events.size[0])
            )
            head += struct.pack("<QQI4sB", start, 0, 4, b"evt3", 0)
        messages.append(head + struct.pack("<I", len(words)) + words)
    return messages


def ros1(folder: Path, events: Events) -> Path:
    return ros1_bag(folder, "event_camera_msgs/EventPacket", packet_messages(events, aligned=False))


def ros1_bag(folder: Path, kind: str, messages: list[bytes]) -> Path:
    return ros1_topics(folder, kind, {"/events": messages})


def ros1_topics(folder: Path, kind: str, topics: dict[str, list[bytes]], index: bool = True) -> Path:
    """A bag of several topics of one type, their messages in turn; without an index as if cut off."""

    def record(fields: dict[str, bytes], data: bytes) -> bytes:
        head = b"".join(
            struct.pack("<I", len(n) + 1 + len(v)) + n.encode() + b"=" + v for n, v in fields.items()
        )
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    def connection(number: int, topic: str) -> bytes:
        texts = (f"topic={topic}", f"type={kind}", "md5sum=*")
        data = b"".join(struct.pack("<I", len(text)) + text.encode() for text in texts)
        return record({"op": b"\7", "conn": struct.pack("<I", number), "topic": topic.encode()}, data)

    used = [(number, topic) for number, topic in enumerate(topics) if topics[topic] or len(topics) == 1]
    connections = [connection(number, topic) for number, topic in used]
    chunks = list(connections)
    for turn in itertools.zip_longest(*topics.values()):
        for number, message in enumerate(turn):
            if message is not None:
                fields = {"op": b"\2", "conn": struct.pack("<I", number), "time": b"\0" * 8}
                chunks.append(record(fields, message))
    body = b""
    for chunk in chunks:
        size = struct.pack("<I", len(chunk))
        body += record({"op": b"\5", "compression": b"none", "size": size}, chunk)
    start = b"#ROSBAG V2.0\n"
    place = struct.pack("<Q", (len(start) + 4096 + len(body)) * index)
    top = record({"op": b"\3", "index_pos": place, "conn_count": b"\1\0\0\0"}, b"")
    top = record({"op": b"\3", "index_pos": place, "conn_count": b"\1\0\0\0"}, b" " * (4096 - len(top)))
    path = folder / "made.bag"
    path.write_bytes(start + top + body + b"".join(connections) * index)
    return path


def ros2_db3(folder: Path, events: Events) -> Path:
    return ros2_bag(folder, "event_camera_msgs/msg/EventPacket", packet_messages(events, aligned=True))


def ros2_bag(folder: Path, kind: str, messages: list[bytes]) -> Path:
    return ros2_topics(folder, kind, {"/events": messages})


def ros2_topics(folder: Path, kind: str, topics: dict[str, list[bytes]]) -> Path:
    """A bag of several topics of one type, their messages in turn."""
    path = folder / "made_0.db3"
    base = sqlite3.connect(path)
    base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL)")
    base.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    )
    base.executemany("INSERT INTO topics(name, type) VALUES (?, ?)", [(topic, kind) for topic in topics])
    for turn in itertools.zip_longest(*topics.values()):
        rows = [(number, message) for number, message in enumerate(turn, 1) if message is not None]
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, 0, ?)", rows)
    base.commit()
    base.close()
    return path


MAKERS: dict[str, Callable[[Path, Events], Path]] = {
    "aedat2": aedat2,
    "aedat3": aedat3,
    "aedat4": _by_faery("made.aedat4"),
    "dat": _by_faery("made.dat", version="dat2"),
    "es": _by_faery("made.es"),
    "evt2": _by_faery("made.raw", version="evt2"),
    "evt21": evt21,
    "evt3": _by_faery("made.raw", version="evt3"),
    "hdf5": hdf5,
    "npy": npy,
    "npz": npz,
    "parquet": parquet,
    "ros1": ros1,
    "ros2_db3": ros2_db3,
    "ros2_mcap": ros2_mcap,
    "text": text,
}
"""By the name of the format: writes events into a folder and returns the file."""
