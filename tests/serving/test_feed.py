"""What comes is checked, recorded and held; what is too much is dropped, the oldest first, and counted."""

from __future__ import annotations

import dataclasses
import os
import time
import tracemalloc
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_sources import Made, block

from conftest import HANG_S, make_drive
from evplace.core.errors import OutputError, RecordingError
from evplace.core.events import Events
from evplace.serving._clock import LEAP_US, Sieve
from evplace.serving._feed import PACKET, Feed, Packet
from evplace.serving._recorder import Recorder
from evplace.sources.live import ANEW
from evplace.sources.live._bytes import FORMATS, ByteStream
from evplace.sources.live.stdin import Piped
from evplace.sources.readers import Block, open_recording
from made_streams import as_bytes

SIZE = (80, 60)


@pytest.fixture(scope="module")
def drive() -> Events:
    return make_drive(windows=20).events


def taken(feed: Feed) -> list[Packet]:
    """All that a feed gives until its source has ended."""
    found = []
    while not (feed.ended and not feed.counters().backlog):
        packet = feed.take(HANG_S)
        if packet is not None:
            found.append(packet)
    return found


def ended(feed: Feed) -> None:
    until_s = time.monotonic() + HANG_S
    while not feed.ended:
        assert time.monotonic() < until_s
        time.sleep(0.001)


def events_of(packets: list[Packet]) -> Events:
    return Events.concatenate([packet.events for packet in packets])


def unchecked(t_us: Sequence[int], x: Sequence[int], y: Sequence[int]) -> Events:
    """Events as a source may send them, in any order and anywhere."""
    columns = np.array(t_us, np.int64), np.array(x, np.uint16), np.array(y, np.uint16)
    return Events(*columns, np.ones(len(t_us), np.bool_), SIZE)


def at(t_us: list[int]) -> Block:
    return block(unchecked(t_us, [1] * len(t_us), [1] * len(t_us)))


def sifted(sieve: Sieve, times: list[list[int]], pace: float = 1.0) -> tuple[list[int], int]:
    """The times that pass, of blocks that come at once, and how often the clock was taken to begin anew."""
    passed: list[int] = []
    anew = 0
    for t_us in times:
        found = sieve.push(at(t_us), 0.0, pace)
        anew += found.anew
        passed += [t for part in found.blocks for t in part.t_us.tolist()]
        if len(t_us) < 10:  # a pause, in which what was held back comes out
            passed += [t for part in sieve.flush().blocks for t in part.t_us.tolist()]
    passed += [t for part in sieve.flush().blocks for t in part.t_us.tolist()]
    return passed, anew


def test_good_events_pass_unchanged(drive: Events) -> None:
    source = Made()
    source.put(*(block(drive[start : start + 700]) for start in range(0, len(drive), 700)), None)
    source.end()
    feed = Feed(source, SIZE)
    feed.start()
    found = events_of(taken(feed))
    np.testing.assert_array_equal(found.t_us, drive.t_us)
    np.testing.assert_array_equal(found.x, drive.x)
    assert feed.counters().events == len(drive)
    assert feed.fault is None


def test_a_stream_that_says_late_that_it_is_of_another_sensor_is_ended(drive: Events) -> None:
    """A pipe's header comes with its events: none of them is taken for one of the map's sensor."""
    reading, writing = os.pipe()
    with os.fdopen(writing, "wb") as pipe:
        pipe.write(as_bytes("evt3", dataclasses.replace(drive[:500], size=(346, 260))))
    feed = Feed(Piped(reading, None, SIZE, 0.0), SIZE)
    feed.start()
    ended(feed)
    os.close(reading)
    assert feed.fault is not None
    assert "sensor of 80x60 pixels, this source has 346x260" in feed.fault
    assert feed.counters().events == 0


@pytest.mark.parametrize("format", FORMATS)
def test_garbage_without_end_is_held_in_bounded_memory_and_good_events_pass_after_it(
    format: str, drive: Events
) -> None:
    """Eight million bytes of anything, in the middle of a stream."""
    rng = np.random.default_rng(0)
    data = as_bytes(format, drive[:2000])
    after = as_bytes(format, drive[2000:4000]).partition(b"% end\n")[2] or as_bytes(format, drive[2000:4000])
    stream = ByteStream("packed" if format == "packed" else None)
    sieve = Sieve(SIZE)
    tracemalloc.start()
    passed = 0
    for part in (data, *(rng.bytes(65_520).replace(b"\n", b"?") for _ in range(128)), b"\n", after, after):
        for found in stream.push(part):
            passed += sum(len(one.t_us) for one in sieve.push(found, 0.0, 0.0).blocks)
        held = len(stream._held)
        assert held <= 1 << 16
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 20e6
    assert passed >= 2000
    assert sum(sieve.dropped.values()) + stream.lost > 0


def test_what_is_outside_the_sensor_or_runs_backwards_is_left_out_and_counted() -> None:
    source = Made()
    source.put(block(unchecked([1, 2, 3, 2, 4], [1, 99, 1, 1, 1], [1, 1, 1, 1, 77])))
    source.end()
    feed = Feed(source, SIZE)
    feed.start()
    assert events_of(taken(feed)).t_us.tolist() == [1, 3]
    assert feed.counters().rejected == {"out_of_range": 2, "backwards": 1}


def test_one_block_from_elsewhere_is_noise_and_two_are_a_new_clock() -> None:
    far = 50 * LEAP_US
    assert sifted(Sieve(SIZE), [[far, far + 1], [7], [far + 2]]) == ([far, far + 1, far + 2], 0)
    assert sifted(Sieve(SIZE), [[far, far + 1], [7], [8, 9]]) == ([far, far + 1, 7, 8, 9], 1)
    assert sifted(Sieve(SIZE), [[7], [far], [8]]) == ([7, 8], 0)
    assert sifted(Sieve(SIZE), [[7], [far], [far + 5]]) == ([7, far, far + 5], 1)
    assert sifted(Sieve(SIZE), [[7], [far], [9 * far], [far]], 1.0)[0] == [7]


def test_a_file_without_a_pace_may_have_gaps() -> None:
    far = 50 * LEAP_US
    assert sifted(Sieve(SIZE), [[7], [far], [far + 5]], 0.0) == ([7, far, far + 5], 0)


def test_one_wrong_time_in_a_block_costs_that_event_alone() -> None:
    times = list(range(0, 5000))
    times[2500] = 10**15
    passed, anew = sifted(Sieve(SIZE), [times, list(range(5000, 10_000))])
    assert anew == 0
    assert passed == [t for t in range(10_000) if t != 2500]


@given(st.lists(st.lists(st.integers(0, 2**62), min_size=1, max_size=20), max_size=20))
def test_whatever_times_come_what_passes_goes_forward_until_anew(times: list[list[int]]) -> None:
    sieve = Sieve(SIZE)
    last = -1
    for t_us in times:
        found = sieve.push(at(t_us), 0.0, 1.0)
        last = -1 if found.anew else last
        for part in found.blocks:
            assert (np.diff([last, *part.t_us.tolist()]) >= 0).all()
            last = int(part.t_us[-1])


def test_too_much_drops_the_oldest_and_counts_it(drive: Events) -> None:
    source = Made()
    source.put(*(block(drive[start : start + 1000]) for start in range(0, 10_000, 1000)))
    source.end()
    feed = Feed(source, SIZE, hold=3000)
    feed.start()
    ended(feed)
    counters = feed.counters()
    assert (counters.backlog, counters.skipped) == (3000, 7000)
    assert counters.overflows > 0
    np.testing.assert_array_equal(events_of(taken(feed)).t_us, drive.t_us[7000:10_000])


def test_a_source_that_waits_loses_nothing(drive: Events) -> None:
    source = Made(pace=0, waits=True)
    source.put(*(block(drive[start : start + 1000]) for start in range(0, 10_000, 1000)))
    source.end()
    feed = Feed(source, SIZE, hold=3000)
    feed.start()
    np.testing.assert_array_equal(events_of(taken(feed)).t_us, drive.t_us[:10_000])
    assert feed.counters().skipped == 0


def test_a_mark_is_not_lost_with_the_events_that_carried_it(drive: Events) -> None:
    source = Made()
    source.put(block(drive[:1000]), ANEW, block(drive[:1000]), block(drive[1000:2000]))
    source.end()
    feed = Feed(source, SIZE, hold=1000)
    feed.start()
    ended(feed)
    (packet,) = taken(feed)
    assert packet.anew


def test_large_blocks_are_handed_on_in_parts() -> None:
    count = 2 * PACKET + 5
    events = unchecked(range(count), [0] * count, [0] * count)
    source = Made()
    source.put(block(events))
    source.end()
    feed = Feed(source, SIZE)
    feed.start()
    assert [len(packet.events) for packet in taken(feed)] == [PACKET, PACKET, 5]


def test_a_source_that_fails_is_said_after_what_it_gave(drive: Events) -> None:
    for error, words in (
        (RecordingError("the camera is gone"), "the camera is gone"),
        (KeyError("of another package"), "the source failed: KeyError"),
    ):
        source = Made()
        source.put(block(drive[:1000]), error)
        feed = Feed(source, SIZE)
        feed.start()
        assert len(events_of(taken(feed))) == 1000
        assert feed.fault is not None
        assert words in feed.fault


# Recording


@pytest.mark.parametrize("name", ["came.raw", "came.aedat4", "came.h5"])
def test_what_comes_is_written(name: str, drive: Events, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / name, SIZE)
    for start in range(0, len(drive), 3000):
        recorder.take(drive[start : start + 3000], False)
    recorder.close(HANG_S)
    assert recorder.fault is None
    assert recorder.events == len(drive)
    found = Events.concatenate(list(open_recording(tmp_path / name).packets()))
    np.testing.assert_array_equal(found.t_us, drive.t_us)


def test_a_clock_that_begins_anew_begins_a_new_file(drive: Events, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "came.raw", SIZE)
    recorder.take(drive[:1000], True)  # the first events begin nothing anew
    recorder.take(drive[:500], True)
    recorder.close(HANG_S)
    assert [file.name for file in recorder.files] == ["came.raw", "came-2.raw"]
    counts = [sum(map(len, open_recording(file).packets())) for file in recorder.files]
    assert counts == [1000, 500]


def test_what_cannot_be_recorded_is_said_before(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="can only be written at the end"):
        Recorder(tmp_path / "came.npz", SIZE)
    (tmp_path / "came.raw").write_bytes(b"")
    with pytest.raises(OutputError, match="exists"):
        Recorder(tmp_path / "came.raw", SIZE)


def test_a_full_disk_ends_the_recording_and_nothing_else(
    drive: Events, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: Any, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("evplace.sources.writers.evt3._encode", full)
    source = Made()
    source.put(*(block(drive[start : start + 1000]) for start in range(0, 10_000, 1000)))
    source.end()
    recorder = Recorder(tmp_path / "came.raw", SIZE)
    feed = Feed(source, SIZE, recorder)
    feed.start()
    assert len(events_of(taken(feed))) == 10_000
    recorder.close(HANG_S)
    assert recorder.fault is not None
    assert "the disk is full" in recorder.fault
    assert list(tmp_path.iterdir()) == []
