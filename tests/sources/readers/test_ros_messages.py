"""Messages with events, as a second library writes them, in both kinds of bags."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made import encoded, libcaer_words, mono_words, ros1_bag, ros2_bag, some_events

from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.core.events import Events
from evplace.sources.readers import _ros_encodings, open_recording
from evplace.sources.readers._ros_encodings import ENCODINGS

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


def read(path: Path) -> Events:
    return Events.concatenate(list(open_recording(path).packets()))


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


def test_the_encoding_mono(tmp_path: Path) -> None:
    events = some_events(500, 900_000)
    words = mono_words(events)
    messages = [encoded("mono", 10**9, words[:250].tobytes()), encoded("mono", 10**9, words[250:].tobytes())]
    back = read(ros1_bag(tmp_path, "event_camera_msgs/EventPacket", messages))
    assert np.array_equal(back.t_us - 7_000_000, events.t_us - events.t_us[0])
    assert np.array_equal(back.x, events.x)
    assert np.array_equal(back.y, events.y)
    assert np.array_equal(back.p, events.p)


def test_the_encoding_libcaer_with_a_wrap_inside_a_packet(tmp_path: Path) -> None:
    events = some_events(500, 900_000)
    true_us = events.t_us + (1 << 31) - 400_000
    words = libcaer_words(dataclasses.replace(events, t_us=true_us)).tobytes()
    back = read(
        ros1_bag(tmp_path, "event_camera_msgs/EventPacket", [encoded("libcaer", 5_000_000_000, words)])
    )
    assert np.array_equal(back.t_us, true_us + 5_000_000)
    assert np.array_equal(back.x, events.x)
    assert np.array_equal(back.p, events.p)


WORDS = st.lists(st.tuples(st.integers(0, 5), st.integers(0, 0xFFF)), max_size=60)


def plain_cmp(words: list[tuple[int, int]], base_us: int) -> list[tuple[int, int, int, bool]]:
    """The plain twin of the decoder of `libcaer_cmp`: (t_us, x, y, p) of each event."""
    state, events = {"high": 0, "low": 0, "x": 0, "y": 0, "p": 0}, []
    for kind, value in words:
        time = base_us + (state["high"] | state["low"])
        if kind == 0:
            state["high"] = value * 4096
        elif kind == 1:
            state["low"] = value
        elif kind == 2:
            state["x"] = value % 2048
        elif kind == 3:
            events.append((time, state["x"], value % 2048, value >= 2048))
        elif kind == 4:
            state["y"], state["p"] = value % 2048, value // 2048
        else:
            rows = np.flatnonzero(np.unpackbits(np.uint8(value % 256), bitorder="little"))
            events += [(time, state["x"], state["y"] + int(row), state["p"] == 1) for row in rows]
            state["y"] += 8
    return events


@given(WORDS, st.integers(0, 1 << 60))
def test_the_encoding_libcaer_cmp_as_its_plain_twin(words: list[tuple[int, int]], base_ns: int) -> None:
    data = np.array([kind << 12 | value for kind, value in words], "<u2").tobytes()
    block = ENCODINGS["libcaer_cmp"]()(data, base_ns)
    found = list(zip(block.t_us.tolist(), block.x.tolist(), block.y.tolist(), block.p.tolist(), strict=True))
    assert found == plain_cmp(words, base_ns // 1000)


def test_the_encoding_libcaer_cmp_in_packets_of_their_own_time(tmp_path: Path) -> None:
    events = some_events(500, 900_000)
    messages = []
    for part in (events[:250], events[250:]):
        words, base_us = [], int(part.t_us[0])
        for t_us, x, y, p in zip(part.t_us - base_us, part.x, part.y, part.p, strict=True):
            words += [t_us >> 12, 0x1000 | t_us & 0xFFF, 0x2000 | x, 0x3000 | p << 11 | y]
        messages.append(
            encoded("libcaer_cmp", 5_000_000_000 + base_us * 1000, np.array(words, "<u2").tobytes())
        )
    back = read(ros1_bag(tmp_path, "event_camera_msgs/EventPacket", messages))
    assert np.array_equal(back.t_us, events.t_us + 5_000_000)
    for field in ("x", "y", "p"):
        assert np.array_equal(getattr(back, field), getattr(events, field))


def test_a_word_of_libcaer_cmp_that_is_not_known(tmp_path: Path) -> None:
    good, bad = np.array([0x2001, 0x3001], "<u2").tobytes(), np.array([0x2001, 0x7000], "<u2").tobytes()
    messages = [encoded("libcaer_cmp", 0, data) for data in (good, bad)]
    recording = open_recording(ros1_bag(tmp_path, "event_camera_msgs/EventPacket", messages))
    with pytest.raises(DamagedRecordingError, match="word 1 is of the unknown kind 7"):
        list(recording.packets())
    assert recording.events == 1


def test_an_unknown_encoding_is_an_error_that_names_the_known(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path, "event_camera_msgs/EventPacket", [encoded("evt9", 0, b"\0" * 8)])
    with pytest.raises(UnsupportedError, match=r"evt9.*known are evt3, mono, libcaer, libcaer_cmp"):
        open_recording(path)


def test_words_lie_as_loops_are_compiled_for() -> None:
    """Whatever byte of a bag a message begins at."""
    words = _ros_encodings._words(memoryview(b"\0\1\0\2\0")[1:], "<u2")
    assert words.tolist() == [1, 2]
    assert words.flags.aligned
