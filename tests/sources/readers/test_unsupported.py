"""What is whole but not read is named, and not called damaged; what decodes to nonsense is no recording."""

from __future__ import annotations

import lzma
import pickle
import struct
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import MAKERS, packet_messages, ros1_bag, ros2_bag, some_events

from evplace.cli import main
from evplace.core.errors import DamagedRecordingError, DoubtfulRecordingError, UnsupportedError
from evplace.core.events import Events
from evplace.doctor import examine
from evplace.sources.readers import is_recording, open_recording

Capture = pytest.CaptureFixture[str]
SOME = some_events(3000)
KIND = "event_camera_msgs/EventPacket"


def patched(form: str, old: bytes, new: bytes, count: int = 1) -> Callable[[Path], Path]:
    def made(folder: Path) -> Path:
        path = MAKERS[form](folder, SOME)
        data = path.read_bytes()
        assert old in data
        path.write_bytes(data.replace(old, new, count))
        return path

    return made


def holding(data: bytes) -> Callable[[Path], Path]:
    def made(folder: Path) -> Path:
        (folder / "made").write_bytes(data)
        return folder / "made"

    return made


def evt(version: str) -> Callable[[Path], Path]:
    return holding(f"% evt {version}\n% geometry 240x180\n% end\n".encode() + bytes(4000))


def es(at: int, value: int) -> Callable[[Path], Path]:
    def made(folder: Path) -> Path:
        path = MAKERS["es"](folder, SOME)
        data = bytearray(path.read_bytes())
        data[at] = value
        path.write_bytes(data)
        return path

    return made


def locked_zip(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w") as archive:
        archive.writestr("events.txt", "1 2 3 1\n")
    data = bytearray((folder / "a.zip").read_bytes())
    data[6] |= 1
    data[data.index(b"PK\1\2") + 8] |= 1
    (folder / "a.zip").write_bytes(data)
    return folder / "a.zip"


def odd_zip(folder: Path) -> Path:
    path = MAKERS["npz"](folder, SOME)
    data = bytearray(path.read_bytes())
    at = 0
    while (at := data.find(b"PK\1\2", at + 1)) >= 0:
        data[at + 10] = 9
    path.write_bytes(data)
    return path


def objects(folder: Path) -> Path:
    np.save(folder / "a.npy", np.array([None, 1], object))
    return folder / "a.npy"


def packed_bag(folder: Path) -> Path:
    (folder / "bag_0.db3.lz4").write_bytes(b"\4\x22\x4d\x18")
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  compression_format: lz4\n  storage_identifier: sqlite3\n"
    )
    return folder


def encoding(name: bytes) -> Callable[[Path], Path]:
    packets = [message.replace(b"evt3", name) for message in packet_messages(SOME, aligned=False)]
    return lambda folder: ros1_bag(folder, KIND, packets)


def big_endian(folder: Path) -> Path:
    packets = [b"\0\0" + message[2:] for message in packet_messages(SOME, aligned=True)]
    return ros2_bag(folder, "event_camera_msgs/msg/EventPacket", packets)


def only_frames(folder: Path) -> Path:
    text = (
        b'<dv><node name="outInfo"><node name="0"><attr key="typeIdentifier">FRME</attr></node></node></dv>'
    )
    table = struct.pack("<HHHHH6xiiqI", 10, 20, 4, 8, 16, 16, 0, -1, 4)
    data = struct.pack("<I4s", 24, b"IOHE") + table + struct.pack("<I", len(text)) + text
    (folder / "a").write_bytes(b"#!AER-DAT4.0\r\n" + struct.pack("<I", len(data)) + data)
    return folder / "a"


def aedat4_method(folder: Path) -> Path:
    path = only_frames(folder)
    path.write_bytes(
        path.read_bytes()
        .replace(b"FRME", b"EVTS")
        .replace(struct.pack("<iiqI", 16, 0, -1, 4), struct.pack("<iiqI", 16, 9, -1, 4))
    )
    return path


NOT_READ: dict[str, tuple[Callable[[Path], Path], str]] = {
    "evt 4": (evt("4.0"), "EVT 4.0: 2.0, 2.1 and 3.0 are read"),
    "evt 1": (evt("1"), "EVT 1: 2.0"),
    "evt 3.1": (evt("3.1"), "EVT 3.1: 2.0"),
    "aedat 1": (holding(b"#!AER-DAT1.0\r\n" + bytes(600)), "an AEDAT file of version 1.0"),
    "aedat 3.2": (holding(b"#!AER-DAT3.2\r\n#!END-HEADER\r\n"), "an AEDAT file of version 3.2"),
    "aedat 3, packed": (patched("aedat3", b"Format: RAW", b"Format: PNG"), "packed as PNG"),
    "aedat 4 of frames": (only_frames, "without a stream of events .EVTS.: it holds FRME"),
    "aedat 4, another method": (aedat4_method, "packed by method 9"),
    "event stream 3": (es(12, 3), "Event Stream of version 3"),
    "event stream of colours": (es(15, 4), "Event Stream of kind 4"),
    "dat 9": (patched("dat", b"Version 2", b"Version 9"), "version '9'"),
    "ros bag 1.2": (holding(b"#ROSBAG V1.2\n" + bytes(99)), "a ROS bag of version 1.2: 2.0 is read"),
    "ros bag, chunks": (patched("ros1", b"compression=none", b"compression=brot", 99), "compression 'brot'"),
    "ros encoding": (
        encoding(b"evt9"),
        "made.bag: messages of the encoding 'evt9' are not read",
    ),
    "ros 2 high byte first": (big_endian, "serialised as 0000"),
    "ros 2 bag packed": (packed_bag, "storage sqlite3, compression lz4"),
    "mcap chunks": (patched("ros2_mcap", b"\4\0\0\0zstd", b"\4\0\0\0brot", 99), "compression 'brot'"),
    "locked zip": (locked_zip, "password"),
    "zip method": (odd_zip, "method 9 of zip"),
    "objects": (objects, "Python objects"),
    "pickle": (holding(pickle.dumps({"t": SOME.t_us})), "a Python pickle, which is not read: write"),
    "xz": (holding(lzma.compress(b"1 2 3 1\n" * 99)), "packed with xz, which is not read: unpack"),
    "MATLAB": (holding(b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(99)), "MATLAB file of version 5"),
}


@pytest.mark.parametrize("name", NOT_READ)
def test_what_is_not_read_is_named(name: str, tmp_path: Path, capsys: Capture) -> None:
    maker, told = NOT_READ[name]
    path = maker(tmp_path)
    with pytest.raises(UnsupportedError, match=told):
        open_recording(path)
    for command in ("info", "doctor"):
        assert main([command, str(path)]) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        assert "damaged" not in line
        assert "breaks off" not in line


def test_an_encoding_that_is_not_read_further_on(tmp_path: Path, capsys: Capture) -> None:
    packets = packet_messages(SOME, aligned=False)
    packets[10:] = [message.replace(b"evt3", b"evt9") for message in packets[10:]]
    path = ros1_bag(tmp_path, KIND, packets)
    recording = open_recording(path)
    with pytest.raises(DamagedRecordingError, match="read up to here: messages of the encoding 'evt9'"):
        list(recording.packets())
    assert recording.events == 2000
    assert main(["info", str(path)]) == 3
    assert examine(path).named("reading").advice.startswith("record it in one encoding")


def noise(seed: int, count: int) -> bytes:
    return np.random.default_rng(seed).bytes(count)


def slow(folder: Path) -> Path:
    np.savez(folder / "a.npz", t_us=SOME.t_us * 10**6, x=SOME.x, y=SOME.y, p=SOME.p)
    return folder / "a.npz"


def fast(folder: Path) -> Path:
    np.savez(folder / "a.npz", t_us=np.arange(3000) // 1500, x=SOME.x, y=SOME.y, p=SOME.p)
    return folder / "a.npz"


def shuffled(folder: Path) -> Path:
    order = np.random.default_rng(1).permutation(3000)
    np.savez(folder / "a.npz", t_us=SOME.t_us[order], x=SOME.x, y=SOME.y, p=SOME.p)
    return folder / "a.npz"


def large(folder: Path) -> Path:
    np.savez(folder / "a.npz", t_us=SOME.t_us, x=SOME.x + 900, y=SOME.y, p=SOME.p)
    return folder / "a.npz"


NONSENSE: dict[str, tuple[Callable[[Path], Path], str]] = {
    "noise as evt2": (holding(b"% evt 2.0\n% geometry 240x180\n% end\n" + noise(1, 100_000)), "left out"),
    "noise as evt3": (
        holding(b"% evt 3.0\n% geometry 240x180\n% end\n" + noise(2, 100_000)),
        "left|fewer",
    ),
    "noise as aedat2": (
        holding(b"#!AER-DAT2.0\r\n# AEChip: a.DAVIS240C\r\n" + noise(3, 100_000)),
        "left|fewer",
    ),
    "noise as dat": (
        holding(b"% Version 2\n% Width 240\n% Height 180\n\x0c\x08" + noise(4, 80_000)),
        "left out",
    ),
    "too slow": (slow, "3,000 events in 99,9.* s are fewer than a camera sends: give `time_unit=UNIT`"),
    "too fast": (fast, "3,000 events in 1e-06 s are more than a camera sends: give `time_unit=UNIT`"),
    "in no order": (shuffled, "most of which are earlier than one before them: sort it"),
    "beyond the sensor": (
        large,
        "lie outside the sensor of 240x180 pixels: give `size` if",
    ),
}


@pytest.mark.parametrize("name", NONSENSE)
def test_nonsense_is_no_recording(name: str, tmp_path: Path, capsys: Capture) -> None:
    maker, told = NONSENSE[name]
    path = maker(tmp_path)
    with pytest.raises(DoubtfulRecordingError, match=told):
        list(open_recording(path, (240, 180)).packets())
    assert main(["info", str(path), "--size", "240", "180"]) == 3
    assert "recording of this format" in capsys.readouterr().err
    found = examine(path, size=(240, 180)).named("reading")
    assert found.state == "bad"
    assert "can hardly be a recording" in found.sentence
    assert "copy it" not in found.advice


def test_no_good_recording_is_doubted(tmp_path: Path) -> None:
    one = Events.of([5], [1], [1], [True], (240, 180))
    for form in ("evt2", "text", "npz"):
        for events in (SOME, SOME[:2], one)[: 2 if form == "text" else 3]:
            recording = open_recording(
                MAKERS[form](tmp_path, events), (240, 180), time_unit="s" if form == "text" else None
            )
            assert sum(map(len, recording.packets())) == len(events)


def test_other_content_stays_unknown(tmp_path: Path) -> None:
    for data in (b"GIF89a", b"% a percent sign\n", b"PK", b"#!/bin/sh\n", b"\x80"):
        (tmp_path / "a").write_bytes(data)
        assert not is_recording(tmp_path / "a")


def test_wrong_units_are_told_by_the_rate(tmp_path: Path) -> None:
    arrays: dict[str, Any] = {"t": SOME.t_us, "x": SOME.x, "y": SOME.y, "p": SOME.p}
    np.savez(tmp_path / "a.npz", **arrays)
    assert sum(map(len, open_recording(tmp_path / "a.npz").packets())) == len(SOME)
    for unit, told in (("s", "fewer than a camera sends"), ("ns", None)):
        recording = open_recording(tmp_path / "a.npz", time_unit=unit)
        if told is None:
            assert sum(map(len, recording.packets())) == len(SOME)
            continue
        with pytest.raises(DoubtfulRecordingError, match=told):
            list(recording.packets())
