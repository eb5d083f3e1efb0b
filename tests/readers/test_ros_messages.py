"""Messages with events, as a second library writes them, in both kinds of bags."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import ros1_bag, ros2_bag, some_events

from evplace.errors import RecordingError
from evplace.events import Events
from evplace.readers import open_recording

DEFINITION = """std_msgs/Header header
uint32 height
uint32 width
dvs_msgs/Event[] events
================================================================================
MSG: dvs_msgs/Event
uint16 x
uint16 y
{time} ts
bool polarity
"""


def serialised(events: Events, frame_id: str, ros1: bool) -> list[bytes]:
    """The events as dvs_msgs/EventArray, ten a message."""
    typesys: Any = pytest.importorskip("rosbags.typesys")
    store = typesys.get_typestore(typesys.Stores.ROS1_NOETIC if ros1 else typesys.Stores.ROS2_HUMBLE)
    text = DEFINITION.format(time="time" if ros1 else "builtin_interfaces/Time")
    store.register(typesys.get_types_from_msg(text, "dvs_msgs/msg/EventArray"))
    one, many = store.types["dvs_msgs/msg/Event"], store.types["dvs_msgs/msg/EventArray"]
    stamp, header = store.types["builtin_interfaces/msg/Time"], store.types["std_msgs/msg/Header"]
    zero = stamp(sec=0, nanosec=0)
    top = header(seq=0, stamp=zero, frame_id=frame_id) if ros1 else header(stamp=zero, frame_id=frame_id)
    rows = [
        one(
            x=int(x), y=int(y), ts=stamp(sec=int(t // 10**6), nanosec=int(t % 10**6 * 1000)), polarity=bool(p)
        )
        for t, x, y, p in zip(events.t_us, events.x, events.y, events.p, strict=True)
    ]
    write = store.serialize_ros1 if ros1 else store.serialize_cdr
    messages = [
        many(header=top, height=180, width=240, events=rows[start : start + 10])
        for start in range(0, len(rows), 10)
    ]
    return [bytes(write(message, "dvs_msgs/msg/EventArray")) for message in messages]


@pytest.mark.parametrize("frame_id", ["", "a", "ab", "abc", "abcd"])
@pytest.mark.parametrize("ros1", [True, False])
def test_event_arrays(ros1: bool, frame_id: str, tmp_path: Path) -> None:
    events = some_events(95, 3_000_000)
    messages = serialised(events, frame_id, ros1)
    path = (
        ros1_bag(tmp_path, "dvs_msgs/EventArray", messages)
        if ros1
        else ros2_bag(tmp_path, "dvs_msgs/msg/EventArray", messages)
    )
    recording = open_recording(path)
    back = Events.concatenate(list(recording.packets()))
    assert (recording.size, recording.notes) == ((240, 180), [])
    for field in ("t_us", "x", "y", "p"):
        assert np.array_equal(getattr(back, field), getattr(events, field))


def test_a_bag_without_events_says_what_it_holds(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no event messages.*sensor_msgs/Image"):
        open_recording(ros1_bag(tmp_path, "sensor_msgs/Image", [b"\0" * 20]))


def test_the_bags_of_the_second_library(tmp_path: Path) -> None:
    """Chunks packed with lz4 and bz2, and single messages packed with zstd."""
    rosbag1: Any = pytest.importorskip("rosbags.rosbag1")
    rosbag2: Any = pytest.importorskip("rosbags.rosbag2")
    events = some_events(100, 1_000_000)
    for form in rosbag1.Writer.CompressionFormat:
        writer = rosbag1.Writer(tmp_path / f"{form.name}.bag")
        writer.set_compression(form)
        with writer:
            line = writer.add_connection("/e", "dvs_msgs/msg/EventArray", msgdef=DEFINITION, md5sum="0" * 32)
            for message in serialised(events, "cam", ros1=True):
                writer.write(line, 0, message)
        assert sum(map(len, open_recording(tmp_path / f"{form.name}.bag").packets())) == 100
    writer = rosbag2.Writer(tmp_path / "packed", version=8)
    writer.set_compression(rosbag2.CompressionMode.MESSAGE, rosbag2.CompressionFormat.ZSTD)
    with writer:
        line = writer.add_connection("/e", "dvs_msgs/msg/EventArray", msgdef=DEFINITION, rihs01="0")
        for message in serialised(events, "cam", ros1=False):
            writer.write(line, 0, message)
    assert sum(map(len, open_recording(tmp_path / "packed").packets())) == 100
