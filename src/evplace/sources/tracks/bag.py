"""ROS bags (ROS 1, ROS 2 as db3 or mcap): fixes of NavSatFix, or poses of PoseStamped and Odometry messages.

Fixes are taken before poses, and the first topic of its kind before others, unless `topic` names one. Poses
are a local track with z up, as REP 103 says.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evplace.core.errors import DamagedRecordingError, TrackError
from evplace.sources.readers import ros1, ros2_db3, ros2_mcap
from evplace.sources.readers._ros import Fields, Message
from evplace.sources.readers._ros_encodings import Bytes
from evplace.sources.tracks._fixes import Fixes, Losses, shown
from evplace.sources.tracks.poses import on_ground

_BAGS = (ros1, ros2_db3, ros2_mcap)
FIXES = ("sensor_msgs/NavSatFix",)
POSES = ("geometry_msgs/PoseStamped", "geometry_msgs/PoseWithCovarianceStamped", "nav_msgs/Odometry")
_NO_FIX = -1


@dataclass(frozen=True, slots=True)
class Settings:
    """Which messages are read."""

    topic: str = ""
    """The topic of the positions; empty: the first that has fixes, else the first that has poses."""


PRESETS: dict[str, Settings] = {}


class Topic:
    """The positions of one topic, as they come."""

    def __init__(self, first: Message) -> None:
        self.name, self.kind = first.topic, first.kind
        self.lines: list[int] = []
        self.t_us: list[int] = []
        self.values: list[tuple[float, float, float]] = []
        """Latitude, longitude and altitude, or x, y and z."""
        self.losses = Losses()
        self._messages = 0

    def show(self, line: int) -> str:
        """What a message is called."""
        return f"message {line} of {shown(self.name)}"

    def see(self, data: Bytes, aligned: bool) -> None:
        """Keep the position of the next message, or count why it has none."""
        self._messages += 1
        try:
            t_ns, valid, values = _position(self.kind, Fields(data, aligned))
        except (struct.error, ValueError):
            self.losses.add("damaged message", self.show(self._messages))
            return
        if not valid or not t_ns:
            reason = "no fix" if not valid else "no time stamp"
            self.losses.add(reason, self.show(self._messages))
            return
        self.lines.append(self._messages)
        self.t_us.append(t_ns // 1000)
        self.values.append(values)


def recognises(head: bytes) -> bool:
    """Whether a file starts as a bag does."""
    return any(bag.matches(Path("bag"), head) for bag in _BAGS)


def recognises_folder(path: Path) -> bool:
    """Whether a folder is a ROS 2 bag."""
    return any(bag.matches(path, b"") for bag in _BAGS)


def read(path: Path, settings: Settings) -> Fixes:
    """The positions of one topic; messages without a fix or a stamp, and damaged ones, are counted.

    Raises TrackError where no topic has any.
    """
    head = _head(path)
    bag = next(bag for bag in _BAGS if bag.matches(path, head))
    topics: dict[tuple[str, str], Topic | None] = {}
    fault = None
    try:
        for message in bag.messages(path):
            key = message.topic, message.kind
            if key not in topics:
                topics[key] = Topic(message) if message.kind in FIXES + POSES else None
            topic = topics[key]
            if topic is not None:
                topic.see(message.data, bag is not ros1)
    except DamagedRecordingError as error:
        fault = str(error)
    return _fixes(_chosen(topics, settings.topic, fault), fault)


def _head(path: Path) -> bytes:
    if path.is_dir():
        return b""
    with path.open("rb") as file:
        return file.read(64)


def _chosen(
    topics: dict[tuple[str, str], Topic | None], name: str, fault: str | None
) -> tuple[Topic, list[str]]:
    """The topic that is asked for, or the first that has positions; and the names of the others."""
    known = [topic for topic in topics.values() if topic is not None]
    asked = [topic for topic in known if topic.name == name] if name else known
    asked.sort(key=lambda topic: topic.kind not in FIXES)
    if asked:
        return asked[0], [topic.name for topic in known if topic is not asked[0]]
    wanted = f"its topic {shown(name)} has no positions" if name else "the bag has no positions"
    holds = ", ".join(f"{topic} ({kind})" for topic, kind in topics) or "no message at all"
    broken = f"; {fault}" if fault else ""
    raise TrackError(f"{wanted} ({', '.join(FIXES + POSES)}): it holds {shown(holds)}{broken}")


def _fixes(chosen: tuple[Topic, list[str]], fault: str | None) -> Fixes:
    topic, others = chosen
    note = f"the positions are those of {shown(topic.name)}"
    if others:
        note += f", not of {shown(', '.join(others))}: the setting topic chooses"
    values = np.array(topic.values, np.float64).reshape(-1, 3)
    metric = topic.kind in POSES
    xy, ground = on_ground(values, "xy") if metric else (None, "")
    nowhere = np.full(len(values), np.nan)
    return Fixes(
        np.array(topic.t_us, np.int64),
        nowhere if metric else values[:, 0],
        nowhere if metric else values[:, 1],
        nowhere,
        xy=xy,
        line=np.array(topic.lines, np.int64),
        show=topic.show,
        losses=topic.losses,
        notes=[note, *([ground] if metric else [])],
        fault=fault,
    )


def _position(kind: str, fields: Fields) -> tuple[int, bool, tuple[float, float, float]]:
    """The stamp in nanoseconds, whether there is a fix, and the position of a message."""
    t_ns = fields.header()
    valid = True
    if kind in FIXES:
        valid = fields.take("b") > _NO_FIX
        fields.take("H")
    elif kind == "nav_msgs/Odometry":
        fields.raw()  # the name of the moving frame
    east, north, up = (float(fields.take("d")) for _ in range(3))
    return t_ns, valid, (east, north, up)
