"""Live sources give what was sent, whoever sends it, and end when they are told to."""

from __future__ import annotations

import io
import itertools
import os
import socket
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conftest import HANG_S, make_drive
from evplace.core import families
from evplace.core.errors import DamagedRecordingError, RecordingError, SettingsError
from evplace.core.events import Events
from evplace.sources.live import ANEW, Facts, Item, Live, address, open_live, source_of
from evplace.sources.live._bytes import ByteStream
from evplace.sources.live.replay import Replay, Replaying
from evplace.sources.live.stdin import Piped
from evplace.sources.live.tail import Tail
from evplace.sources.live.udp import UDP, Listening
from evplace.sources.readers import Block, open_recording
from evplace.sources.writers import write_recording
from evplace.testing import check_live
from made_streams import as_bytes, datagrams, packed

SIZE = (80, 60)


@pytest.fixture(scope="module")
def drive() -> Events:
    return make_drive(windows=20).events


def joined(items: list[Item]) -> Events:
    blocks = [item for item in items if isinstance(item, Block)]
    return Events.concatenate([Events(block.t_us, block.x, block.y, block.p, SIZE) for block in blocks])


def same(found: Events, wanted: Events) -> None:
    for name in ("t_us", "x", "y", "p"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))


def until(live: Live, events: int) -> list[Item]:
    """What a source gives, until that many events have come; then it is closed."""
    found: list[Item] = []
    count = 0
    for item in live.blocks():
        found.append(item)
        count += len(item.t_us) if isinstance(item, Block) else 0
        if count >= events:
            break
    live.close()
    return found


def test_addresses_say_the_kind() -> None:
    assert address("-") == ("stdin", "")
    assert address("udp:0.0.0.0:3333") == address("udp://0.0.0.0:3333") == ("udp", "0.0.0.0:3333")
    assert address("night.aedat4") == ("replay", "night.aedat4")
    assert address("C:night.aedat4") == ("replay", "C:night.aedat4")
    with pytest.raises(SettingsError, match="'tcp' of tcp://a:1 is no kind"):
        address("tcp://a:1")
    with pytest.raises(SettingsError, match="unknown setting 'sped'"):
        source_of("night.aedat4", {"sped": 1})


@pytest.mark.parametrize("kind", families.names("live"))
def test_each_kind_is_a_dataclass_with_defaults_and_says_what_it_is(kind: str) -> None:
    made = families.load("live", kind)()
    assert made.where is not None
    assert families.name_of("live", made) == kind
    assert families.entries("live")[families.names("live").index(kind)].about


@pytest.mark.parametrize("name", ["drive.aedat4", "drive.raw", "drive.npz"])
def test_a_replay_as_fast_as_it_goes_is_the_recording(name: str, drive: Events, tmp_path: Path) -> None:
    write_recording(tmp_path / name, [drive], SIZE)
    live = open_live(str(tmp_path / name), speed=0)
    same(joined(list(live.blocks())), drive)
    assert Facts.of(live).waits
    assert Facts.of(live).pace == 0


def test_a_replay_at_a_pace_gives_short_pieces_of_the_same(drive: Events, tmp_path: Path) -> None:
    write_recording(tmp_path / "drive.raw", [drive], SIZE)
    live = open_live(str(tmp_path / "drive.raw"), speed=50.0)
    items = list(live.blocks())
    same(joined(items), drive)
    spans = [int(item.t_us[-1] - item.t_us[0]) for item in items if isinstance(item, Block)]
    assert max(spans) <= 10_000


def test_loops_begin_anew(drive: Events, tmp_path: Path) -> None:
    write_recording(tmp_path / "drive.raw", [drive], SIZE)
    items = list(open_live(str(tmp_path / "drive.raw"), speed=0, loops=3).blocks())
    assert items.count(ANEW) == 2
    same(joined(items), Events.concatenate([drive] * 3))


def test_a_replay_is_paused_and_wound(drive: Events, tmp_path: Path) -> None:
    write_recording(tmp_path / "drive.raw", [drive], SIZE)
    replay = Replay(str(tmp_path / "drive.raw"), speed=1000.0).open(None)
    assert isinstance(replay, Replaying)
    replay.change(paused=True)
    assert replay.pace == 0
    items = replay.blocks()
    assert [next(items) for _ in range(3)] == [None] * 3
    replay.change(paused=False, by_s=0.4)
    rest = [item for item in items if item is not None]
    assert rest[0] is ANEW
    found = joined(rest)
    same(found, drive[int(np.searchsorted(drive.t_us, drive.t_us[0] + 400_000)) :])
    with pytest.raises(SettingsError, match="speed of this replay cannot become -1"):
        replay.change(speed=-1.0)


def test_a_damaged_recording_gives_its_good_part(drive: Events, tmp_path: Path) -> None:
    whole = tmp_path / "drive.aedat4"
    write_recording(whole, [drive[at : at + 2000] for at in range(0, len(drive), 2000)], SIZE)
    cut = tmp_path / "cut.aedat4"
    cut.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    offline: list[Events] = []
    with pytest.raises(DamagedRecordingError) as fault:
        offline.extend(open_recording(cut).packets())
    items: list[Item] = []
    with pytest.raises(DamagedRecordingError, match=str(fault.value)):
        items.extend(open_live(str(cut), speed=0).blocks())
    live = open_live(str(cut), speed=0)
    found: list[Item] = []
    with pytest.raises(DamagedRecordingError):
        for item in live.blocks():
            found.append(item)
    same(joined(found), Events.concatenate(offline))


FORMATS: dict[str, bytes] = {}


@pytest.mark.parametrize("format", ["evt3", "evt2", "packed", "text"])
@settings(max_examples=10)
@given(cuts=st.lists(st.integers(0, 100_000), max_size=20))
def test_bytes_in_parts_of_any_length_are_the_same_events(
    format: str, cuts: list[int], drive: Events, tmp_path_factory: pytest.TempPathFactory
) -> None:
    data = FORMATS.setdefault(format, as_bytes(format, drive))
    stream = ByteStream("packed" if format == "packed" else None)
    edges = [0, *sorted(min(cut, len(data)) for cut in cuts), len(data)]
    found: list[Item] = []
    for start, stop in itertools.pairwise(edges):
        found.extend(stream.push(data[start:stop]))
    same(joined(found), drive)


def test_garbage_that_is_no_stream_is_one_line() -> None:
    with pytest.raises(RecordingError, match="of no format that tells itself: it starts with"):
        list(ByteStream().push(os.urandom(5000).replace(b"\n", b"?").replace(b"%", b"?")))


def test_lines_that_are_no_events_are_counted() -> None:
    stream = ByteStream()
    (block,) = stream.push(b"10 1 2 1\nnonsense\n11 3 4 0\n")
    assert block.t_us.tolist() == [10, 11]
    assert block.p.tolist() == [True, False]
    assert stream.lost == 1


def test_a_pipe_is_read_to_its_end(drive: Events, tmp_path: Path) -> None:
    reading, writing = os.pipe()

    def write() -> None:
        with io.FileIO(writing, "w") as pipe:
            data = as_bytes("evt3", drive)
            while data:
                data = data[pipe.write(data) :]

    threading.Thread(target=write, daemon=True).start()
    piped = Piped(reading, None, None, 0.0)
    same(joined(list(piped.blocks())), drive)
    assert piped.size == SIZE
    os.close(reading)


def test_a_file_is_read_as_it_grows_and_anew_when_replaced(drive: Events, tmp_path: Path) -> None:
    path = tmp_path / "grows.raw"
    data = as_bytes("evt3", drive)
    live = open_live(f"tail:{path}")
    assert "is waited for" in Facts.of(live).notes[0]
    items = live.blocks()
    assert next(items) is None
    path.write_bytes(data[:20_001])
    found = [item for item in (next(items) for _ in range(3)) if item]
    with path.open("ab") as file:
        file.write(data[20_001:])
    while len(joined(found)) < len(drive):
        found.append(next(items))
    same(joined(found), drive)
    other = tmp_path / "other.raw"
    other.write_bytes(data)
    other.replace(path)
    again: list[Item] = []
    while ANEW not in again:
        again.append(next(items))
    again = []
    while not again or len(joined(again)) < len(drive):
        again.append(next(items))
        again = [item for item in again if item]
    same(joined(again), drive)
    live.close()


def sent(live: Live, datagrams: list[bytes]) -> None:
    assert isinstance(live, Listening)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for data in datagrams:
            sender.sendto(data, ("127.0.0.1", live.port))


@pytest.mark.parametrize("layout", ["faery", "faery-32", "spif", "spif-be"])
def test_packets_of_each_layout_are_the_events(layout: str, drive: Events) -> None:
    events = drive[:3000]
    live = open_live("udp:0", SIZE, layout=layout)
    sent(live, datagrams(layout, events))
    same(joined(until(live, len(events))), events)


def test_packets_without_times_have_that_of_their_arrival() -> None:
    live = open_live("udp:0", SIZE, layout="spif")
    sent(live, [struct.pack("<2I", 1 << 31 | 5 << 16 | 1 << 15 | 7, 1 << 31 | 6 << 16 | 8)])
    found = joined(until(live, 2))
    assert (found.x.tolist(), found.y.tolist(), found.p.tolist()) == ([5, 6], [7, 8], [True, False])
    assert found.t_us[0] == found.t_us[1] > 0


def test_packets_that_are_none_are_counted() -> None:
    live = open_live("udp:0", SIZE)
    sent(live, [b"garbage!", b"", packed(make_drive(windows=1).events[:10])])
    assert len(joined(until(live, 10))) == 10
    assert Facts.of(live).lost == 2


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # it leaves its socket open
def test_faery_itself_sends_what_we_receive(drive: Events) -> None:
    faery = pytest.importorskip("faery", reason="faery is not installed: its own packets are not tried")
    live = open_live("udp:0", SIZE)
    assert isinstance(live, Listening)
    table = np.zeros(len(drive), faery.EVENTS_DTYPE)
    table["t"], table["x"], table["y"], table["on"] = drive.t_us, drive.x, drive.y, drive.p
    faery.events_stream_from_array(table, dimensions=SIZE).to_udp(("127.0.0.1", live.port))
    same(joined(until(live, len(drive))), drive)


def test_eventcv_itself_sends_what_we_receive(drive: Events) -> None:
    eventcv = pytest.importorskip("eventcv", reason="eventcv is not installed: its own packets are not tried")
    events = drive[:3000]
    table = np.stack([events.x, events.y, events.t_us, events.p], axis=1)
    stream = eventcv.from_numpy(table, sensor_size=SIZE, time_unit="us")
    for order, layout in ((True, "spif"), (False, "spif-be")):
        live = open_live("udp:0", SIZE, layout=layout)
        assert isinstance(live, Listening)
        eventcv.UdpSender(f"127.0.0.1:{live.port}", timestamps=True, host_endian=order).send(stream)
        same(joined(until(live, len(events))), events)


def test_wrong_addresses_are_one_line() -> None:
    with pytest.raises(RecordingError, match="'nowhere' is no address"):
        open_live("udp:nowhere", SIZE)
    first = UDP("127.0.0.1:0").open(SIZE)
    assert isinstance(first, Listening)
    with pytest.raises(RecordingError, match="cannot listen at UDP"):
        UDP(f"127.0.0.1:{first.port}").open(SIZE)
    first.close()


def test_every_source_ends_when_it_is_told_to(tmp_path: Path) -> None:
    for text in ("udp:0", f"tail:{tmp_path / 'never'}"):
        live = open_live(text, SIZE)
        items: Iterator[Any] = live.blocks()
        assert next(items) is None
        ended = threading.Event()

        def run(items: Iterator[Any] = items, ended: threading.Event = ended) -> None:
            list(items)
            ended.set()

        threading.Thread(target=run, daemon=True).start()
        live.close()
        assert ended.wait(HANG_S)


class Broken:
    """What an opened source may break, one at a time."""

    def __init__(self, *items: object) -> None:
        self._items = items

    def blocks(self) -> Iterator[Any]:
        yield from self._items

    def close(self) -> None:
        pass


def test_ours_keep_what_the_family_promises(drive: Events, tmp_path: Path) -> None:
    write_recording(tmp_path / "drive.raw", [drive], SIZE)
    check_live(Replay(str(tmp_path / "drive.raw"), speed=100.0))
    check_live(Tail(str(tmp_path / "drive.raw")))


@pytest.mark.parametrize(
    ("opened", "words"),
    [
        (Broken(), "must give something"),
        (Broken(None), "must give events here"),
        (Broken("events"), "must give events here"),
        (Broken(Block(*[np.zeros(1)] * 4)), "must be t_us int64"),  # type: ignore[arg-type]
        (object(), r"must have blocks\(\)"),
    ],
)
def test_what_breaks_it_is_said(opened: object, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Replay, "open", lambda self, size: opened)
    with pytest.raises(AssertionError, match=words):
        check_live(Replay("made"))
