"""Files made to hurt: one clear line, little memory and time, and nothing else of the machine is touched."""

from __future__ import annotations

import resource
import sqlite3
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made import aedat3, mcap_topics, packet_messages, ros1_topics, ros2_bag, some_events

from evplace.cli import main
from evplace.core.errors import DamagedRecordingError, RecordingError
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
