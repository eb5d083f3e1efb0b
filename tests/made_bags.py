"""Bags with positions, written byte by byte: ROS 1, db3 and mcap."""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from made_logs import Log

Topics = dict[tuple[str, str], list[bytes]]
"""Topic and type -> serialised messages."""


def header(t_s: float, aligned: bool, frame: bytes = b"gps") -> bytes:
    """A std_msgs/Header."""
    stamp = struct.pack("<II", int(t_s), round(t_s % 1 * 1e9))
    if aligned:
        return stamp + struct.pack("<I", len(frame) + 1) + frame + b"\0"
    return struct.pack("<I", 0) + stamp + struct.pack("<I", len(frame)) + frame


def doubles(head: bytes, values: Sequence[float], aligned: bool) -> bytes:
    """`head` and doubles after it, each at a multiple of eight in ROS 2."""
    pad = b"\0" * (-len(head) % 8) if aligned else b""
    return (b"\0\1\0\0" if aligned else b"") + head + pad + struct.pack(f"<{len(values)}d", *values)


def nav_sat_fix(t_s: float, latitude: float, longitude: float, aligned: bool, status: int = 0) -> bytes:
    """A sensor_msgs/NavSatFix."""
    head = header(t_s, aligned) + struct.pack("<b", status)
    head += (b"\0" * (-len(head) % 2) if aligned else b"") + struct.pack("<H", 1)
    return doubles(head, [latitude, longitude, 30.0, *[0.0] * 9], aligned) + b"\0"


def pose(t_s: float, x: float, y: float, aligned: bool, child: bytes = b"") -> bytes:
    """A geometry_msgs/PoseStamped; with a child frame the start of a nav_msgs/Odometry."""
    head = header(t_s, aligned, b"odom")
    if child:
        head += b"\0" * (-len(head) % 4) if aligned else b""
        head += struct.pack("<I", len(child) + aligned) + child + b"\0" * aligned
    return doubles(head, [x, y, 0.0, 0.0, 0.0, 0.0, 1.0], aligned)


def ros1(folder: Path, topics: Topics) -> Path:
    """A bag of one chunk, or as many as topics."""

    def record(fields: dict[str, bytes], data: bytes) -> bytes:
        head = b"".join(
            struct.pack("<I", len(n) + 1 + len(v)) + n.encode() + b"=" + v for n, v in fields.items()
        )
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    body = b""
    for number, ((topic, kind), messages) in enumerate(topics.items()):
        conn = struct.pack("<I", number)
        about = b"".join(
            struct.pack("<I", len(text)) + text
            for text in (b"topic=" + topic.encode(), b"type=" + kind.encode(), b"md5sum=*")
        )
        chunk = record({"op": b"\7", "conn": conn, "topic": topic.encode()}, about)
        chunk += b"".join(record({"op": b"\2", "conn": conn, "time": b"\0" * 8}, one) for one in messages)
        body += record({"op": b"\5", "compression": b"none", "size": struct.pack("<I", len(chunk))}, chunk)
    start = b"#ROSBAG V2.0\n"
    fields = {
        "op": b"\3",
        "index_pos": struct.pack("<Q", len(start) + 4096 + len(body)),
        "conn_count": b"\1\0\0\0",
    }
    top = record(fields, b" " * (4096 - len(record(fields, b""))))
    path = folder / "made.bag"
    path.write_bytes(start + top + body + record({"op": b"\4", "ver": b"\1\0\0\0"}, b""))
    return path


def db3(folder: Path, topics: Topics) -> Path:
    """A folder with one SQLite file."""
    place = folder / "made_db3"
    place.mkdir(exist_ok=True)
    (place / "made_0.db3").unlink(missing_ok=True)
    base = sqlite3.connect(place / "made_0.db3")
    base.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL)")
    base.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    )
    for number, ((topic, kind), messages) in enumerate(topics.items(), 1):
        base.execute("INSERT INTO topics VALUES (?, ?, ?)", (number, topic, kind.replace("/", "/msg/")))
        rows = [(number, message) for message in messages]
        base.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, 0, ?)", rows)
    base.commit()
    base.close()
    return place


def mcap(folder: Path, topics: Topics) -> Path:
    """One file, by mcap's own writer."""
    writer: Any = pytest.importorskip("mcap.writer")
    path = folder / "made.mcap"
    with path.open("wb") as file:
        out = writer.Writer(file, chunk_size=4000, compression=writer.CompressionType.ZSTD)
        out.start("ros2", "test")
        for (topic, kind), messages in topics.items():
            schema = out.register_schema(kind.replace("/", "/msg/"), "ros2msg", b"")
            channel = out.register_channel(topic, "cdr", schema)
            for message in messages:
                out.add_message(channel, log_time=0, publish_time=0, data=message)
        out.finish()
    return path


def nav_sat_fix_bag(folder: Path, log: Log) -> Path:
    """A ROS 1 bag of the drive."""
    messages = [nav_sat_fix(t, lat, lon, False) for t, lat, lon, _, _ in log.rows()]
    return ros1(folder, {("/fix", "sensor_msgs/NavSatFix"): messages})
