"""Files made to hurt: one clear line, little memory and time, and nothing else of the machine is touched."""

from __future__ import annotations

import resource
import sqlite3
import struct
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import MAKERS, aedat3, mcap_topics, packet_messages, ros1_topics, ros2_bag, some_events

from evplace.cli import main
from evplace.core.errors import DamagedRecordingError, RecordingError, UnsupportedError
from evplace.core.events import Events
from evplace.sources.readers import open_recording, ros2_db3
from evplace.sources.readers._unpack import LIMIT, UnpackError, unpack

Capture = pytest.CaptureFixture[str]
SOME = some_events(3000)
KIND = "event_camera_msgs/EventPacket"


@pytest.mark.parametrize("method", ["lz4", "zstd", "zstd without a size", "bz2"])
def test_a_packet_that_unpacks_to_256_mib(method: str) -> None:
    bz2, lz4_frame, zstandard = (pytest.importorskip(name) for name in ("bz2", "lz4.frame", "zstandard"))
    part, parts = bytes(1 << 20), 4 * LIMIT >> 20
    packer = {
        "lz4": lz4_frame.LZ4FrameCompressor(),
        "zstd": zstandard.ZstdCompressor().compressobj(size=parts << 20),
        "zstd without a size": zstandard.ZstdCompressor().compressobj(),
        "bz2": bz2.BZ2Compressor(1),
    }[method]
    begun = packer.begin() if method == "lz4" else b""
    data = begun + b"".join(packer.compress(part) for _ in range(parts)) + packer.flush()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(UnpackError, match="more than 64 MiB"):
        unpack(data, method.split()[0])
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 3 * LIMIT // 1024


def parquet(folder: Path, **columns: Any) -> Path:
    pyarrow, files = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    arrays = {"t_us": SOME.t_us, "x": SOME.x, "y": SOME.y, "p": SOME.p} | columns
    files.write_table(pyarrow.table(arrays), folder / "a.parquet")
    return folder / "a.parquet"


@pytest.mark.parametrize("name", ["t_us", "x", "y", "p", "all"])
def test_nulls_are_no_pixels(name: str, tmp_path: Path) -> None:
    """They are left out and counted, and make no sensor of 65,536 columns."""
    pyarrow = pytest.importorskip("pyarrow")
    holes = np.arange(len(SOME)) % 100 == 7
    given = {"t_us": SOME.t_us, "x": SOME.x, "y": SOME.y, "p": SOME.p.astype(int)}
    names = list(given) if name == "all" else [name]
    path = parquet(tmp_path, **{n: pyarrow.array(given[n], mask=holes) for n in names})
    recording = open_recording(path)
    events = sum(map(len, recording.packets()))
    assert recording.size == (240, 180)
    left_out = {"t_us": "untimed", "all": "untimed", "p": None}.get(name, "out_of_range")
    assert events == len(SOME) - (0 if left_out is None else holes.sum())
    assert left_out is None or recording.dropped[left_out] == holes.sum()


def test_nulls_in_truth_values(tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    holes = np.arange(len(SOME)) % 100 == 7
    back = Events.concatenate(
        list(open_recording(parquet(tmp_path, p=pyarrow.array(SOME.p, mask=holes))).packets())
    )
    assert np.array_equal(back.p, SOME.p & ~holes)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("t_us", "date32"),
        ("t_us", "date64"),
        ("x", "timestamp"),
        ("y", "date32"),
        ("x", "text"),
        ("p", "duration"),
    ],
)
def test_dates_and_texts_are_no_numbers(name: str, kind: str, tmp_path: Path) -> None:
    pyarrow = pytest.importorskip("pyarrow")
    whole = np.arange(len(SOME))
    values = {
        "date32": lambda: pyarrow.array(whole.astype("i4"), pyarrow.date32()),
        "date64": lambda: pyarrow.array(whole * 86_400_000, pyarrow.date64()),
        "timestamp": lambda: pyarrow.array(whole, pyarrow.timestamp("us")),
        "duration": lambda: pyarrow.array(whole, pyarrow.duration("us")),
        "text": lambda: pyarrow.array(whole.astype(str)),
    }[kind]()
    with pytest.raises(RecordingError, match="must be numbers, not"):
        list(open_recording(parquet(tmp_path, **{name: values}), (240, 180)).packets())


def test_a_group_of_rows_is_not_read_whole(tmp_path: Path) -> None:
    """Ten million events in one group: the decoder may take 512 MiB, and takes less."""
    pyarrow, files = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    n, rng = 10_000_000, np.random.default_rng(0)
    columns = {name: rng.integers(0, 100, n).astype("u2") for name in "xy"} | {"p": np.arange(n) % 2}
    columns["t_us"] = np.cumsum(rng.integers(0, 3, n))
    table = pyarrow.table(columns)
    how = {"row_group_size": n, "use_dictionary": False, "compression": None}
    files.write_table(table, tmp_path / "a.parquet", **how)
    code = (
        "import resource, sys; from pathlib import Path; from evplace.sources.readers import _parquet\n"
        "from evplace.sources.readers._source import Hints\n"
        "first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "source = _parquet.open_here(Path(sys.argv[1]), Hints((100, 100)))\n"
        "events = sum(len(block.t_us) for block in source.blocks())\n"
        "print(events, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - first) >> 10)"
    )
    answer = subprocess.run(
        [sys.executable, "-c", code, tmp_path / "a.parquet"], capture_output=True, check=True
    )
    events, megabytes = map(int, answer.stdout.split())
    assert events == n
    assert megabytes < 60


@pytest.mark.parametrize("digits", [10, 5000])
@pytest.mark.parametrize(
    ("name", "head"),
    [
        ("a.dat", "% Version 2\n% Width {}\n% Height 480\n\x0c\x08"),
        ("a.raw", "% evt 2.0\n% geometry {}x480\n"),
        ("a.raw", "% evt 3.0\n% geometry 640x{}\n"),
        ("a.raw", "% format EVT3;height={};width=640\n% end\n"),
        ("a.raw", "% evt 2.1\n% format EVT21;height={};width=640\n% end\n"),
        ("a.aedat", "#!AER-DAT3.1\r\n#Format: RAW\r\n#Source {}: DAVIS240C\r\n#!END-HEADER\r\n"),
    ],
)
def test_numbers_of_any_length_in_headers(name: str, head: str, digits: int, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(head.format("9" * digits).encode("latin-1") + bytes(range(256)) * 9)
    with pytest.raises(RecordingError) as caught:
        list(open_recording(tmp_path / name).packets())
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("encoding", ["klingon", "utf-16", "shift_jis", "idna", "undefined"])
def test_encodings_of_a_header_in_xml(encoding: str, tmp_path: Path) -> None:
    """AEDAT 4 describes its streams in XML, which may name any encoding."""
    path = MAKERS["aedat4"](tmp_path, SOME)
    data = path.read_bytes()
    old, new = b'<dv version="2.0">', f'<?xml version="1.0" encoding="{encoding}"?>'.encode()
    assert old in data
    text_at = data.index(old)
    filled = data[text_at : data.index(b"</dv>")].replace(b"  ", b"", len(new))
    path.write_bytes(data.replace(old, (new + old)[: len(filled)], 1))
    with pytest.raises(RecordingError):
        list(open_recording(path).packets())


def test_columns_of_one_name_are_asked_about(tmp_path: Path) -> None:
    pyarrow, files = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    columns = [SOME.t_us, SOME.x, SOME.x + 1, SOME.y, SOME.p.astype(int)]
    rows = "\n".join(",".join(map(str, row)) for row in zip(*columns, strict=True))
    (tmp_path / "a.csv").write_text(f"t,x,x,y,p\n{rows}\n")
    files.write_table(pyarrow.table(list(map(pyarrow.array, columns)), list("txxyp")), tmp_path / "a.parquet")
    for name in ("a.csv", "a.parquet"):
        with pytest.raises(RecordingError, match="several columns are called 'x'"):
            open_recording(tmp_path / name, time_unit="us")
    found = list(open_recording(tmp_path / "a.csv", time_unit="us", columns="t,-,x,y,p").packets())
    assert np.array_equal(Events.concatenate(found).x, SOME.x + 1)


def test_a_line_without_end_is_no_table(tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    (tmp_path / "a.txt").write_bytes(b"1 " * 20_000_000)
    with pytest.raises(RecordingError, match="of no known recording format"):
        open_recording(tmp_path / "a.txt")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200 << 10


WIDE = np.dtype([("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "?"), ("more", "V4000")])


def test_wide_rows_are_read_in_slices_of_bytes(tmp_path: Path) -> None:
    rows = np.zeros(20_000, WIDE)
    rows["t"], rows["x"], rows["y"] = 100 * np.arange(len(rows)), 3, 4
    np.savez(tmp_path / "a.npz", events=rows)
    code = (
        "import resource, sys; from evplace.sources.readers import open_recording\n"
        "recording = open_recording(sys.argv[1], (240, 180), time_unit='us')\n"
        "first = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "print(sum(map(len, recording.packets())))\n"
        "print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - first) >> 10)"
    )
    answer = subprocess.run([sys.executable, "-c", code, tmp_path / "a.npz"], capture_output=True, check=True)
    events, megabytes = map(int, answer.stdout.split())
    assert events == len(rows)
    assert megabytes < 100
    wider = np.dtype([*WIDE.descr[:-1], ("more", "V1000000")])
    np.savez(tmp_path / "b.npz", events=np.zeros(20, wider))
    with pytest.raises(RecordingError, match="rows of 1,000,013 bytes are no events"):
        open_recording(tmp_path / "b.npz", (240, 180))


@pytest.mark.parametrize("name", ["x", "t", "all"])
@pytest.mark.parametrize("kind", ["chunked", "contiguous", "huge", "partly"])
def test_rows_that_were_never_written(name: str, kind: str, tmp_path: Path) -> None:
    """They read as zeros, and are claimed in any number."""
    h5py = pytest.importorskip("h5py")
    rows = {"t": SOME.t_us, "x": SOME.x, "y": SOME.y, "p": SOME.p.astype("u1")}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for field, values in rows.items():
            if name not in (field, "all"):
                file[f"events/{field}"] = values
                continue
            length = 10**12 if kind == "huge" and name == "all" else len(SOME)
            chunks = None if kind == "contiguous" else (1000,)
            column = file.create_dataset(f"events/{field}", (length,), values.dtype, chunks=chunks)
            if kind == "partly":
                column[:1000] = values[:1000]
                column[2000:3000] = values[2000:3000]
    read = []
    with pytest.raises(RecordingError, match=r"were never written|holds no event") as caught:
        for packet in open_recording(tmp_path / "a.h5", (240, 180), time_unit="us").packets():
            read.append(len(packet))
    assert sum(read) == (1000 if kind == "partly" else 0)
    assert not read or "from 1,001 on" in str(caught.value)


def test_pieces_that_fill_the_memory_are_not_unpacked(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for field in "txyp":
            column = file.create_dataset(
                f"events/{field}", (10**8,), "i8", chunks=(10**8,), compression="gzip"
            )
            column[:10] = 1
    with pytest.raises(UnsupportedError, match="packed in pieces of over 64 MiB"):
        list(open_recording(tmp_path / "a.h5", (240, 180), time_unit="us").packets())


def test_arrays_of_more_axes_are_no_rows(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **dict.fromkeys("txyp", np.zeros((3, 3, 3), int)))
    with pytest.raises(RecordingError, match="must be rows of numbers of one length"):
        open_recording(tmp_path / "a.npz", time_unit="us")


def test_more_topics_than_any_robot_has(tmp_path: Path) -> None:
    path = ros2_bag(tmp_path, KIND, packet_messages(SOME, aligned=True))
    base = sqlite3.connect(path)
    base.executemany(
        "INSERT INTO topics(id, name, type) VALUES (?, 't', 'x')", [(n,) for n in range(9, 20_000)]
    )
    base.commit()
    base.close()
    with pytest.raises(RecordingError, match="more than 10,000 topics"):
        open_recording(path)


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i AS id, {} FROM n"


@pytest.mark.parametrize("view", ["messages", "topics"])
def test_views_are_no_tables(view: str, tmp_path: Path) -> None:
    path = ros2_bag(tmp_path, KIND, packet_messages(SOME, aligned=True))
    base = sqlite3.connect(path)
    base.execute(f"DROP TABLE {view}")
    columns = "1 AS topic_id, x'00' AS data" if view == "messages" else "'/e' AS name, 'a/b' AS type"
    base.execute(f"CREATE VIEW {view} AS {ENDLESS.format(columns)}")
    base.commit()
    base.close()
    with pytest.raises(RecordingError, match=f"is no ROS 2 bag: it has no table {view}"):
        open_recording(path)


def test_a_query_without_end_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros2_db3, "MOST_STEPS", 3)
    base = sqlite3.connect(":memory:")
    with pytest.raises(sqlite3.OperationalError, match="interrupted"):
        list(ros2_db3._rows(base, f"SELECT count(*) FROM ({ENDLESS.format('1')})"))


def test_another_sqlite_file(tmp_path: Path) -> None:
    base = sqlite3.connect(tmp_path / "a.db3")
    base.execute("CREATE TABLE places(id INTEGER)")
    base.commit()
    base.close()
    with pytest.raises(RecordingError, match="is no ROS 2 bag: it has no table messages"):
        open_recording(tmp_path / "a.db3")


EVIL = "/left\n\x1b[2J\x07events"


@pytest.mark.parametrize("form", ["bag", "db3", "mcap"])
@pytest.mark.parametrize("command", ["info", "doctor"])
def test_names_do_not_reach_the_terminal_raw(
    form: str, command: str, tmp_path: Path, capsys: Capture
) -> None:
    messages = packet_messages(SOME, aligned=form != "bag")
    topics = {EVIL: messages, "/right": messages}
    if form == "bag":
        path = ros1_topics(tmp_path, KIND, topics)
    elif form == "mcap":
        path = mcap_topics(tmp_path, topics)
    else:
        path = ros2_bag(tmp_path, KIND, messages)
        base = sqlite3.connect(path)
        base.execute("UPDATE topics SET name = ?", (EVIL,))
        base.commit()
        base.close()
    recording = open_recording(path)
    assert recording.streams[0] == "/left\\n\\x1b[2J\\x07events"
    assert main([command, str(path)]) == 0
    assert main([command, str(path), "--stream", "nose"]) == 2
    told = capsys.readouterr()
    assert "\x1b" not in told.out + told.err
    assert "\x07" not in told.out + told.err
    assert told.err.count("\n") == 1


def test_a_packet_that_claims_256_mib(tmp_path: Path) -> None:
    path = aedat3(tmp_path, SOME)
    size = path.stat().st_size
    with path.open("ab") as file:
        file.write(struct.pack("<hhiiiiii", 1, 1, 8, 4, 0, 1 << 25, 1 << 25, 1 << 25))
        file.truncate(size + 28 + (1 << 28))
    recording = open_recording(path)
    with pytest.raises(DamagedRecordingError, match=f"the packet at byte {size}"):
        list(recording.packets())
    assert recording.events == len(SOME)


def test_a_page_that_is_cut_off_is_no_page_of_zeros(tmp_path: Path) -> None:
    """SQLite would give its messages with zeros for what is missing."""
    path = ros2_bag(tmp_path, KIND, packet_messages(some_events(300), aligned=True))
    whole = Events.concatenate(list(open_recording(path, (240, 180)).packets()))
    data = path.read_bytes()
    for at in range(len(data) - 4095, len(data), 97):
        path.write_bytes(data[:at])
        times: list[int] = []
        with pytest.raises(RecordingError):
            for packet in open_recording(path, (240, 180)).packets():
                times += packet.t_us.tolist()
        assert times == whole.t_us[: len(times)].tolist()


def test_a_message_about_names_of_any_length_is_short(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **{"x" * 30_000: [1]})
    with pytest.raises(RecordingError) as caught:
        open_recording(tmp_path / "a.npz")
    assert len(str(caught.value)) < 700
