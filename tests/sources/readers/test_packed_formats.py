"""What single formats promise beyond the events: wraps counted by packets, checksums, units of columns."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import MAKERS, SIZE, aedat3, good_part, packet_messages, ros1_bag, ros2_mcap, some_events

from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.core.events import Events
from evplace.sources.readers import open_recording
from evplace.sources.readers._unpack import UnpackError, unpack

SOME = some_events(3000, 100_000)


def test_aedat3_packets_count_the_wraps(tmp_path: Path) -> None:
    # Packets may not hold a wrap: the writer starts a new one there, here by the choice of times.
    long = Events.of(np.repeat(np.arange(30) << 29, 100) + 7, SOME.x, SOME.y, SOME.p, SIZE)
    back = good_part(open_recording(aedat3(tmp_path, long)))
    assert np.array_equal(back.t_us, long.t_us)


def test_aedat3_leaves_out_invalid_events_and_other_codings(tmp_path: Path) -> None:
    path = aedat3(tmp_path, SOME)
    data = path.read_bytes()
    start = data.index(b"#!END-HEADER\r\n") + 14 + 28
    path.write_bytes(data[:start] + bytes([data[start] & 0xFE]) + data[start + 1 :])
    assert sum(map(len, open_recording(path).packets())) == len(SOME) - 1
    path.write_bytes(data.replace(b"Format: RAW", b"Format: PNG"))
    with pytest.raises(RecordingError, match="packed as PNG"):
        open_recording(path)


def test_an_mcap_checksum_that_is_wrong_ends_the_reading(tmp_path: Path) -> None:
    path = ros2_mcap(tmp_path, SOME)
    data = bytearray(path.read_bytes())
    chunk = data.index(b"\x04\x00\x00\x00zstd", len(data) // 3)
    data[chunk - 1] ^= 1  # the last byte of the checksum stands before the method
    path.write_bytes(data)
    recording = open_recording(path)
    with pytest.raises(DamagedRecordingError, match="checksum"):
        list(recording.packets())
    assert 0 < (recording.events or 0) < len(SOME)


def test_a_folder_of_mcap_files_is_one_recording(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for number, start in enumerate((0, 1000, 2000)):
        ros2_mcap(tmp_path, SOME[start : start + 1000]).rename(folder / f"bag_{number}.mcap")
    assert sum(map(len, open_recording(folder).packets())) == len(SOME)


def test_parquet_times_in_a_type_of_their_own(tmp_path: Path) -> None:
    pyarrow: Any = pytest.importorskip("pyarrow")
    files: Any = pytest.importorskip("pyarrow.parquet")
    times = pyarrow.array(SOME.t_us * 1000, pyarrow.timestamp("ns"))
    files.write_table(pyarrow.table({"t": times, "x": SOME.x, "y": SOME.y, "p": SOME.p}), tmp_path / "b")
    back = Events.concatenate(list(open_recording(tmp_path / "b", SIZE).packets()))
    assert np.array_equal(back.t_us, SOME.t_us)
    assert np.array_equal(back.p, SOME.p)
    files.write_table(pyarrow.table({"lat": [1.0]}), tmp_path / "c")
    with pytest.raises(RecordingError, match="it holds lat"):
        open_recording(tmp_path / "c")


def test_a_header_that_states_no_size_or_an_impossible_one(tmp_path: Path) -> None:
    path = MAKERS["evt2"](tmp_path, SOME)
    lines = path.read_bytes().replace(b"% format EVT2;width=240;height=180\n", b"")
    path.write_bytes(lines.replace(b"% geometry 240x180\n", b""))
    recording = open_recording(path)
    assert (recording.size, recording.notes[0][-32:]) == (SIZE, "240x180 inferred from its events")
    path.write_bytes(lines.replace(b"240x180", b"0x180"))
    with pytest.raises(RecordingError, match="0x180"):
        open_recording(path)
    given = open_recording(MAKERS["evt2"](tmp_path, SOME), (100, 100))
    assert len(good_part(given)) == np.count_nonzero((SOME.x < 100) & (SOME.y < 100))
    assert given.notes == ["size 100x100 as given; the file says 240x180"]
    assert given.dropped["out_of_range"] == len(SOME) - (given.events or 0)


def test_packed_data_that_unpacks_to_too_much() -> None:
    bz2, lz4_frame, zstandard = (pytest.importorskip(name) for name in ("bz2", "lz4.frame", "zstandard"))
    zeros = bytes(10_000_000)
    packed = {
        "bz2": bz2.compress(zeros),
        "lz4": lz4_frame.compress(zeros),
        "zstd": zstandard.ZstdCompressor().compress(zeros),
    }
    for method, data in packed.items():
        assert unpack(data, method) == zeros
        for bad, limit in ((data, 1_000_000), (data[: len(data) // 2], 1 << 28)):
            with pytest.raises(UnpackError, match=method):
                unpack(bad, method, limit)
    with pytest.raises(UnsupportedError, match="'rar' is not read: known are lz4, zstd, bz2"):
        unpack(b"", "rar")


def test_a_bag_without_messages_says_so(tmp_path: Path) -> None:
    path = ros1_bag(tmp_path, "event_camera_msgs/EventPacket", [])
    with pytest.raises(RecordingError, match="no message at all"):
        open_recording(path)


def test_a_parquet_file_whose_writer_was_killed(tmp_path: Path) -> None:
    files = pytest.importorskip("pyarrow.parquet")
    pyarrow = pytest.importorskip("pyarrow")
    table = pyarrow.table({"t_us": SOME.t_us, "x": SOME.x, "y": SOME.y, "p": SOME.p})
    writer = files.ParquetWriter(tmp_path / "whole.parquet", table.schema)
    writer.write_table(table)
    (tmp_path / "killed.parquet").write_bytes((tmp_path / "whole.parquet").read_bytes())
    writer.close()
    assert (tmp_path / "killed.parquet").read_bytes().startswith(b"PAR1")
    with pytest.raises(RecordingError, match="damaged Parquet file"):
        open_recording(tmp_path / "killed.parquet")


def test_an_mcap_file_without_chunks(tmp_path: Path) -> None:
    writer = pytest.importorskip("mcap.writer")
    with (tmp_path / "plain.mcap").open("wb") as file:
        out = writer.Writer(file, use_chunking=False)
        out.start("ros2", "test")
        schema = out.register_schema("event_camera_msgs/msg/EventPacket", "ros2msg", b"")
        channel = out.register_channel("/events", "cdr", schema)
        for message in packet_messages(SOME, aligned=True):
            out.add_message(channel, log_time=0, publish_time=0, data=message)
        out.finish()
    assert sum(map(len, open_recording(tmp_path / "plain.mcap").packets())) == len(SOME)
