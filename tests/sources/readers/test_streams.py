"""Files that hold several cameras: which is read is said, and which is read can be chosen."""

from __future__ import annotations

import contextlib
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made import SIZE, mcap_topics, packet_messages, ros1_topics, ros2_topics, some_events

from evplace.cli import main
from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Events
from evplace.sources.readers import open_recording
from evplace.sources.writers import aedat4

LEFT, RIGHT = some_events(3000, seed=1), some_events(2000, seed=2)
KIND = "event_camera_msgs/EventPacket"


def topics(aligned: bool) -> dict[str, list[bytes]]:
    return {
        "/left/events": packet_messages(LEFT, aligned),
        "/right/events": packet_messages(RIGHT, aligned),
        "/idle/events": [],
    }


def bag(folder: Path) -> Path:
    return ros1_topics(folder, KIND, topics(aligned=False))


def cut_bag(folder: Path) -> Path:
    return ros1_topics(folder, KIND, topics(aligned=False), index=False)


def db3(folder: Path) -> Path:
    return ros2_topics(folder, "event_camera_msgs/msg/EventPacket", topics(aligned=True))


def mcap(folder: Path) -> Path:
    return mcap_topics(folder, topics(aligned=True))


def cut_mcap(folder: Path) -> Path:
    path = mcap(folder)
    path.write_bytes(path.read_bytes()[:-20])
    return path


def aedat4_of(folder: Path, cameras: tuple[str, str]) -> Path:
    """Two streams of events and one of frames before them; the streams are numbered 2 and 5."""
    node = '<node name="{}"><attr key="typeIdentifier">{}</attr><node name="info"><attr key="sizeX">{}</attr>'
    node += '<attr key="sizeY">{}</attr><attr key="source">{}</attr></node></node>'
    nodes = node.format(0, "FRME", *SIZE, cameras[0])
    nodes += node.format(2, "EVTS", *SIZE, cameras[0]) + node.format(5, "EVTS", *SIZE, cameras[1])
    text = f'<dv><node name="outInfo">{nodes}</node></dv>'.encode()
    table = struct.pack("<HHHHH6xiiqI", 10, 20, 4, 8, 16, 16, 0, -1, 4)
    data = struct.pack("<I4s", 24, b"IOHE") + table + struct.pack("<I", len(text)) + text
    packets = [struct.pack("<ii", 0, 5) + b"frame"]
    for number, events in ((2, LEFT), (5, RIGHT)):
        packet = aedat4._event_packet(events)
        packets.append(struct.pack("<ii", number, len(packet)) + packet)
    path = folder / "two.aedat4"
    path.write_bytes(b"#!AER-DAT4.0\r\n" + struct.pack("<I", len(data)) + data + b"".join(packets))
    return path


def aedat4_named(folder: Path) -> Path:
    return aedat4_of(folder, ("DVX_left", "DVX_right"))


def aedat4_alike(folder: Path) -> Path:
    return aedat4_of(folder, ("DVX", "DVX"))


def aedat3(folder: Path) -> Path:
    data = b"#!AER-DAT3.1\r\n#Format: RAW\r\n#Source 1: DAVIS240C\r\n#Source 2: DAVIS240B\r\n#!END-HEADER\r\n"
    for number, events in ((1, LEFT), (2, RIGHT)):
        pixel = events.x.astype("<u4") << 17 | events.y.astype("<u4") << 2 | events.p.astype("<u4") << 1 | 1
        words = np.stack([pixel, events.t_us.astype("<u4")], 1).tobytes()
        count = len(events)
        data += struct.pack("<hhiiiiii", 1, number, 8, 4, 0, count, count, count) + words
    path = folder / "two.aedat"
    path.write_bytes(data)
    return path


STEREO: dict[str, tuple[Callable[[Path], Path], str, str]] = {
    "bag": (bag, "/left/events", "/right/events"),
    "cut bag": (cut_bag, "/left/events", "/right/events"),
    "db3": (db3, "/left/events", "/right/events"),
    "mcap": (mcap, "/left/events", "/right/events"),
    "cut mcap": (cut_mcap, "/left/events", "/right/events"),
    "aedat4, cameras": (aedat4_named, "DVX_left", "DVX_right"),
    "aedat4, numbers": (aedat4_alike, "2", "5"),
    "aedat3": (aedat3, "DAVIS240C", "DAVIS240B"),
}
"""Name -> maker of a file of LEFT and RIGHT, and the names of the two streams."""
stereo = pytest.mark.parametrize("name", STEREO)


def same(path: Path, stream: str | None, expected: Events) -> bool:
    """Whether the events of a stream are the expected ones; the good part of a cut file is all of them."""
    packets = []
    with contextlib.suppress(DamagedRecordingError):
        for packet in open_recording(path, stream=stream).packets():
            packets.append(packet)
    x = np.concatenate([packet.x for packet in packets])
    return np.array_equal(x, expected.x)


@stereo
def test_the_first_is_read_and_the_others_are_named(name: str, tmp_path: Path) -> None:
    maker, left, right = STEREO[name]
    path = maker(tmp_path)
    recording = open_recording(path)
    assert recording.streams == [left, right]
    assert (
        recording.notes[0]
        == f"events are read from {left}; there are also {right}: choose with `stream=NAME`"
    )
    assert same(path, None, LEFT)


@stereo
def test_a_stream_is_chosen_by_its_name(name: str, tmp_path: Path) -> None:
    maker, left, right = STEREO[name]
    path = maker(tmp_path)
    assert open_recording(path, stream=right).streams == [right, left]
    assert same(path, right, RIGHT)
    assert same(path, left, LEFT)


@stereo
def test_a_part_of_one_name_is_enough_and_an_unknown_one_lists_all(name: str, tmp_path: Path) -> None:
    maker, left, right = STEREO[name]
    path = maker(tmp_path)
    if "right" in right:
        assert same(path, "right", RIGHT)
    for unknown in ("nose", "", "D" if "D" in left else "events" if "e" in left else "25"):
        with pytest.raises(RecordingError, match=f"no stream '{unknown}': it has {left}, {right}"):
            open_recording(path, stream=unknown)


def test_cameras_may_be_chosen_by_number(tmp_path: Path) -> None:
    assert same(aedat4_named(tmp_path), "5", RIGHT)
    assert same(aedat3(tmp_path), "2", RIGHT)


def test_a_format_of_one_stream_takes_no_name(tmp_path: Path) -> None:
    path = tmp_path / "one.dat"
    path.write_bytes(b"% Version 2\n% Width 640\n% Height 480\n\x0c\x08" + bytes(80))
    with pytest.raises(
        RecordingError, match=r"DAT file\) has one stream, without a name: leave out `stream`"
    ):
        open_recording(path, stream="left")
    with pytest.raises(RecordingError, match=r"DAT file\) has no columns"):
        open_recording(path, columns="t,x,y,p")


@pytest.mark.parametrize("command", ["info", "doctor", "convert", "images"])
def test_every_command_takes_a_stream(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = bag(tmp_path)
    out = {"convert": [f"{tmp_path}/right.npz"], "images": ["-o", f"{tmp_path}/right"]}.get(command, [])
    assert main([command, str(path), *out, "--stream", "right"]) == 0
    told = capsys.readouterr()
    assert "read from /right/events; there are also /left/events: choose with --stream NAME" in " ".join(
        (told.out + told.err).split()
    )
    assert main([command, str(path), *out, "--stream", "nose"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
