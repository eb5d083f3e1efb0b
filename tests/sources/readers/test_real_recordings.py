"""Every real recording: count and span as documented, and the same events as a second reader."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from evplace.core.events import Events
from evplace.sources.readers import open_recording

FACTS = [
    ("dvxplorer_lite_320x240.aedat4", "aedat4", (320, 240), 111_954, 0.590),
    ("davis346.aedat4", "aedat4", (346, 260), 78_830, 2.360),
    ("evt2_640x480.raw", "evt2", (640, 480), 521_252, 0.096),
    ("gen4_1280x720.dat", "dat", (1280, 720), 1_218_618, 10.768),
    ("dvs_320x240.es", "es", (320, 240), 473_225, 0.999),
    ("davis240c_translBoxes.aedat", "aedat2", (240, 180), 162_771, 2.07),
    ("evt3_packets_640x480.bag", "ros1", (640, 480), 343_474, 2.08),
    ("evt3_packets_640x480_ros2", "ros2_db3", (640, 480), 343_474, 2.08),
    ("libcaer_cmp_346x260_ros2", "ros2_mcap", (346, 260), 571_266, 0.999),
    ("evt3_packets_640x480_ros2/test_events_1.db3", "ros2_db3", (640, 480), 343_474, 2.08),
]


@pytest.mark.parametrize(("name", "form", "size", "events", "span_s"), FACTS, ids=[fact[0] for fact in FACTS])
def test_count_and_span(
    data: Path, name: str, form: str, size: tuple[int, int], events: int, span_s: float
) -> None:
    recording = open_recording(data / "events" / name)
    total = sum(len(packet) for packet in recording.packets())
    assert (recording.format, recording.size, total) == (form, size, events)
    assert recording.t_first_us is not None
    assert recording.t_last_us is not None
    assert (recording.t_last_us - recording.t_first_us) / 1e6 == pytest.approx(
        span_s, abs=6e-3 if span_s == 2.07 else 2e-3
    )
    assert sum(recording.dropped.values()) == 0


def test_polarities_of_the_camera_of_inivation(data: Path) -> None:
    packets = open_recording(data / "events" / "libcaer_cmp_346x260_ros2").packets()
    assert sum(int(np.count_nonzero(packet.p)) for packet in packets) == 211_043


def test_a_guessed_size_is_noted(data: Path) -> None:
    assert "640x480 inferred" in open_recording(data / "events" / "evt2_640x480.raw").notes[0]


def test_both_bags_hold_the_same_events(data: Path) -> None:
    first, second = (
        Events.concatenate(list(open_recording(data / "events" / f"evt3_packets_640x480{end}").packets()))
        for end in (".bag", "_ros2")
    )
    for field in ("t_us", "x", "y", "p"):
        assert np.array_equal(getattr(first, field), getattr(second, field))


@pytest.mark.parametrize("name", [fact[0] for fact in FACTS[:5]])
def test_same_events_as_faery(data: Path, name: str) -> None:
    faery = pytest.importorskip("faery")
    path = data / "events" / name
    ours = Events.concatenate(list(open_recording(path).packets()))
    theirs = np.concatenate(list(faery.events_stream_from_file(path)))
    for field, name_there in (("t_us", "t"), ("x", "x"), ("y", "y"), ("p", "p")):
        assert np.array_equal(getattr(ours, field), theirs[name_there].astype(getattr(ours, field).dtype))


def test_same_events_as_eventcv(data: Path) -> None:
    """Of AEDAT 2, whose columns run from the right in the file: jAER and we turn them, eventcv does not."""
    eventcv = pytest.importorskip("eventcv", reason="eventcv, of the extra 'bench', is not installed")
    path = data / "events" / "davis240c_translBoxes.aedat"
    ours = Events.concatenate(list(open_recording(path).packets()))
    theirs = eventcv.load(str(path)).numpy().astype(np.int64)  # (N, 4): x, y, t, p
    assert np.array_equal(np.stack([239 - ours.x, ours.y, ours.t_us, ours.p], axis=1), theirs)


@pytest.mark.parametrize("name", ["evt3_packets_640x480.bag", "evt3_packets_640x480_ros2"])
def test_same_events_as_rosbags_and_faery(data: Path, name: str, tmp_path: Path) -> None:
    """The bag by rosbags; the camera's own words in its messages, as a raw file, by faery."""
    faery, rosbags = pytest.importorskip("faery"), pytest.importorskip("rosbags.highlevel")
    types = pytest.importorskip("rosbags.typesys")
    path, raw = data / "events" / name, tmp_path / "words.raw"
    words = []
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    with rosbags.AnyReader([path], default_typestore=store) as bag:
        for connection, _, message in bag.messages():
            if connection.msgtype.startswith("event_camera"):
                words.append(bytes(bag.deserialize(message, connection.msgtype).events))
    raw.write_bytes(b"% evt 3.0\n% format EVT3;height=480;width=640\n% end\n" + b"".join(words))
    theirs = np.concatenate(list(faery.events_stream_from_file(raw)))
    ours = Events.concatenate(list(open_recording(path).packets()))
    for field, name_there in (("x", "x"), ("y", "y"), ("p", "p")):
        assert np.array_equal(getattr(ours, field), theirs[name_there].astype(getattr(ours, field).dtype))
    assert np.array_equal(np.diff(ours.t_us), np.diff(theirs["t"].astype(np.int64)))
