"""ROS 2 bags as rosbag2 packs them: each message, each file, or both; folders and single files."""

from __future__ import annotations

import gc
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from made import mcap_topics, packet_messages, ros2_bag, some_events

from evplace.core.errors import DamagedRecordingError, RecordingError
from evplace.core.events import Events
from evplace.sources.readers import is_recording, open_recording

zstandard = pytest.importorskip("zstandard")
SOME = some_events(6000)
KIND = "event_camera_msgs/msg/EventPacket"
Maker = Callable[[Path, list[bytes]], Path]
MAKERS: dict[str, Maker] = {
    "db3": lambda folder, messages: ros2_bag(folder, KIND, messages),
    "mcap": lambda folder, messages: mcap_topics(folder, {"/events": messages}),
}
forms = pytest.mark.parametrize("form", MAKERS)


def packed(data: bytes) -> bytes:
    return zstandard.ZstdCompressor().compress(data)  # type: ignore[no-any-return]


def messages(packs_messages: bool, events: Events = SOME) -> list[bytes]:
    plain = packet_messages(events, aligned=True)
    return [packed(message) for message in plain] if packs_messages else plain


def pack(path: Path) -> Path:
    """The file packed, beside it, which then is gone."""
    other = path.with_name(f"{path.name}.zstd")
    other.write_bytes(packed(path.read_bytes()))
    path.unlink()
    return other


def same(path: Path, form: str) -> bool:
    recording = open_recording(path)
    back = Events.concatenate(list(recording.packets()))
    assert recording.format == f"ros2_{form}"
    assert np.array_equal(np.diff(back.t_us), np.diff(SOME.t_us))
    return all(np.array_equal(getattr(back, name), getattr(SOME, name)) for name in ("x", "y", "p"))


@forms
@pytest.mark.parametrize("packs_messages", [False, True])
@pytest.mark.parametrize("packs_files", [False, True])
def test_folders_and_single_files(form: str, packs_messages: bool, packs_files: bool, tmp_path: Path) -> None:
    path = MAKERS[form](tmp_path, messages(packs_messages))
    path = pack(path) if packs_files else path
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    assert same(path, form)
    assert same(tmp_path, form)
    assert same(path.rename(tmp_path / "any.name"), form)


@forms
def test_packed_files_in_the_order_of_their_numbers(form: str, tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for number, start in ((2, 0), (10, 2000), (11, 4000)):
        made = MAKERS[form](tmp_path, messages(False, SOME[start : start + 2000]))
        pack(made).rename(folder / f"bag_{number}.{form}.zstd")
    assert same(folder, form)
    zstd = folder / f"bag_10.{form}.zstd"
    zstd.with_suffix("").write_bytes(zstandard.decompress(zstd.read_bytes()))
    assert same(folder, form), "a file is read once, though it lies there plain and packed"


@forms
def test_a_packed_file_that_is_cut_gives_its_good_part(form: str, tmp_path: Path) -> None:
    path = pack(MAKERS[form](tmp_path, messages(False, some_events(60_000))))
    path.write_bytes(path.read_bytes()[: path.stat().st_size * 3 // 4])
    recording = open_recording(path)
    with pytest.raises(DamagedRecordingError, match="breaks off"):
        list(recording.packets())
    assert (recording.events or 0) > 20_000


@forms
def test_a_packed_message_that_is_damaged(form: str, tmp_path: Path) -> None:
    made = messages(True)
    made[20] = made[20][:-9] + b"\0" * 9
    recording = open_recording(MAKERS[form](tmp_path, made))
    with pytest.raises(DamagedRecordingError, match="message 20 is damaged: zstd"):
        list(recording.packets())
    assert recording.events == 4000


@forms
def test_a_packed_file_that_unpacks_to_too_much(form: str, tmp_path: Path) -> None:
    """A record, or a database, of zeros without end."""
    start = MAKERS[form](tmp_path, messages(False)).read_bytes()
    path = tmp_path / f"bomb.{form}.zstd"
    with path.open("wb") as file, zstandard.ZstdCompressor().stream_writer(file) as out:
        out.write(start if form == "db3" else start[:8] + b"\x09" + (1 << 40).to_bytes(8, "little"))
        for _ in range(600):
            out.write(bytes(1 << 20))
    if form == "db3":
        assert same(path, form), "what follows a database is none of it"
        return
    with pytest.raises(RecordingError, match="claims"):
        open_recording(path)


def test_nothing_stays_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, temporary = pack(MAKERS["db3"](tmp_path, messages(False))), tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    recording = open_recording(path)
    for _ in range(2):
        assert sum(map(len, recording.packets())) == len(SOME)
    assert len(list(temporary.iterdir())) == 1
    del recording
    gc.collect()
    assert list(temporary.iterdir()) == []


def test_other_things_packed_with_zstd_are_no_bags(tmp_path: Path) -> None:
    (tmp_path / "letter.zst").write_bytes(packed(b"Dear reader, this is no recording.\n" * 20))
    assert not is_recording(tmp_path / "letter.zst")
