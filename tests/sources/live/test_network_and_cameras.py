"""Streams of dv-processing and of ROS 2 over zenoh, from senders of our own; cameras by a stand-in."""

from __future__ import annotations

import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

from conftest import HANG_S, make_drive
from evplace.core.errors import MissingExtraError, RecordingError
from evplace.core.events import Events
from evplace.sources.live import ANEW, Facts, Item, Live, open_live
from evplace.sources.live.zenoh import GID, Subscribed, attachment, leave, session
from evplace.sources.readers import Block
from made_streams import Camera, libcaer, message, mono, packet, ros_messages

SIZE = (80, 60)


@pytest.fixture(scope="module")
def drive() -> Events:
    return make_drive(windows=20).events


def joined(items: list[Item]) -> Events:
    blocks = [item for item in items if isinstance(item, Block)]
    return Events.concatenate([Events(block.t_us, block.x, block.y, block.p, SIZE) for block in blocks])


def until(items: Iterator[Item], done: Callable[[list[Item]], bool]) -> list[Item]:
    """What comes until enough has."""
    found: list[Item] = []
    until_s = time.monotonic() + HANG_S
    while not done(found):
        assert time.monotonic() < until_s, "it does not come"
        item = next(items)
        found += [] if item is None else [item]
    return found


def free_port() -> int:
    with socket.socket() as any_one:
        any_one.bind(("127.0.0.1", 0))
        port: int = any_one.getsockname()[1]
        return port


# dv-processing

SENDER = """
import sys, time
import dv_processing as dv
stream = dv.io.Stream.EventStream(0, "events", "made", (80, 60))
writer = dv.io.NetworkWriter("127.0.0.1", int(sys.argv[1]), stream)
print("ready", flush=True)
while not writer.getClientCount():
    time.sleep(0.01)
for part in range(20):
    store = dv.EventStore()
    for n in range(50):
        store.push_back(int(sys.argv[2]) + 1000 * part + n, n, part, bool(n % 2))
    writer.writeEvents(store)
sys.stdin.read()
"""
needs_dv = pytest.mark.skipif(
    find_spec("dv_processing") is None, reason="dv-processing is not installed: pip install 'evplace[live]'"
)


def dv_sender(port: int, start_us: int) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-c", SENDER, str(port), str(start_us)]
    sender = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert sender.stdout is not None
    assert sender.stdout.readline() == b"ready\n"
    return sender


@needs_dv
def test_a_stream_of_dv_comes_and_comes_again_after_its_sender_was_killed() -> None:
    port = free_port()
    live = open_live(f"dv:127.0.0.1:{port}")
    items = live.blocks()
    assert next(items) is None  # nobody is there yet
    first = dv_sender(port, 1_000)
    found = joined(until(items, lambda items: sum(len(item.t_us) for item in items) == 1000))
    assert Facts.of(live).size == SIZE
    np.testing.assert_array_equal(found.t_us, 1_000 + np.add.outer(1000 * np.arange(20), range(50)).ravel())
    np.testing.assert_array_equal(found.x, np.tile(np.arange(50), 20))
    first.kill()
    first.communicate()
    until(items, lambda items: ANEW in items)
    second = dv_sender(port, 5_000)
    found = joined(until(items, lambda items: sum(len(item.t_us) for item in items) == 1000))
    assert found.t_us[0] == 5_000
    assert Facts.of(live).lost == 1
    live.close()
    assert not any(isinstance(item, Block) for item in items)
    second.kill()
    second.communicate()


def test_without_dv_processing_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evplace.sources.live.dv.find_spec", lambda _: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'evplace\[live\]'"):
        open_live("dv:127.0.0.1:7777")


# ROS 2 over zenoh

needs_zenoh = pytest.mark.skipif(
    find_spec("zenoh") is None, reason="eclipse-zenoh is not installed: pip install 'evplace[live]'"
)
KEY = "0/event_camera/events/event_camera_msgs::msg::dds_::EventPacket_/RIHS01_made"


@pytest.fixture
def network() -> Iterator[tuple[Live, Callable[[bytes, bytes], None]]]:
    """A source that is subscribed, and what publishes a message for it as a publisher of that name."""
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed: pip install 'evplace[live]'")
    from zenoh import CongestionControl

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    camera = session("", "peer", endpoint)
    live = Subscribed(session(endpoint, "peer"), "0/event_camera/events/**", SIZE)
    publisher = camera.declare_publisher(KEY, congestion_control=CongestionControl.BLOCK)
    until_s = time.monotonic() + HANG_S
    while not publisher.matching_status.matching:
        assert time.monotonic() < until_s
        time.sleep(0.01)

    def publish(data: bytes, name: bytes) -> None:
        publisher.put(data, attachment=attachment(1, 0, name))

    yield live, publish
    live.close()
    leave(camera)


@needs_zenoh
@pytest.mark.parametrize("encoding", ["evt3", "mono", "libcaer", "libcaer_cmp"])
def test_packets_of_each_encoding_come_over_zenoh(encoding: str, drive: Events, network: Any) -> None:
    live, publish = network
    for data in ros_messages(encoding, drive):
        publish(data, b"a" * GID)
    items = live.blocks()
    found = joined(until(items, lambda items: sum(len(item.t_us) for item in items) >= len(drive)))
    for name in ("t_us", "x", "y", "p"):
        np.testing.assert_array_equal(getattr(found, name), getattr(drive, name))


@needs_zenoh
def test_a_damaged_message_and_another_sensor_are_counted_and_said(drive: Events, network: Any) -> None:
    live, publish = network
    good = message("libcaer", libcaer(drive[:100]), 0, 0)
    publish(b"\0\1\0\0garbage", b"a" * GID)
    publish(message("libcaer", libcaer(drive[:100]), 0, 0, (640, 480)), b"a" * GID)
    publish(message("of nobody", b"", 0, 0), b"a" * GID)
    publish(good, b"a" * GID)
    items = live.blocks()
    until(items, lambda items: len(items) == 1)
    assert Facts.of(live).lost == 3
    assert "of the encoding 'of nobody' are not read" in Facts.of(live).notes[0]


@needs_zenoh
def test_a_publisher_that_is_started_again_begins_anew(drive: Events, network: Any) -> None:
    live, publish = network
    data = message("mono", mono(drive[:100]), 0, 0)
    publish(data, b"a" * GID)
    publish(data, b"b" * GID)
    items = live.blocks()
    first, mark, second = until(items, lambda items: len(items) == 3)
    assert mark is ANEW
    np.testing.assert_array_equal(first.t_us, second.t_us)


@needs_zenoh
def test_no_router_is_one_line() -> None:
    with pytest.raises(RecordingError, match=r"no zenoh router at tcp/127\.0\.0\.1"):
        open_live("zenoh:events", router=f"tcp/127.0.0.1:{free_port()}")


def test_a_peer_that_does_not_answer_is_left_all_the_same() -> None:
    zenoh = pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed: pip install 'evplace[live]'")

    class Deaf:
        def close(self) -> None:
            raise zenoh.ZError("close operation timed out!")

    leave(Deaf())


def test_the_attachment_is_that_of_rmw_zenoh() -> None:
    data = attachment(7, 9, b"x" * GID)
    assert struct.unpack("<qqB16s", data) == (7, 9, 16, b"x" * 16)


# USB cameras: a stand-in for neuromorphic_drivers; no camera was at hand


Plug = Callable[..., Camera]


@pytest.fixture
def plug(monkeypatch: pytest.MonkeyPatch) -> Plug:
    def plugged(cameras: list[str] | None, said: list[Any] | None = None) -> Camera:
        made = Camera(cameras, said or [])
        monkeypatch.setitem(sys.modules, "neuromorphic_drivers", made)
        return made

    return plugged


def test_a_camera_gives_events_and_counts_what_it_lost(plug: Plug) -> None:
    camera = plug(["A1", "B2"], [(0, packet([1, 2])), (0, None), (3, packet([3], [0])), (3, packet([]))])
    live = open_live("usb:B2")
    items = list(live.blocks())
    assert [item if item is None else item.t_us.tolist() for item in items] == [[1, 2], None, [3], None]
    assert Facts.of(live) == Facts(SIZE, 1.0, False, 4, [])
    assert camera.closed


@pytest.mark.parametrize(
    ("cameras", "where", "words"),
    [
        (None, "usb:", r"shows no USB to programs \(Other error\)"),
        ([], "usb:", "no event camera is plugged in: found are none"),
        (["A1"], "usb:A2", "no event camera with the serial 'A2' is plugged in: found are A1"),
        (["busy"], "usb:busy", r"cannot be opened: Access denied"),
    ],
)
def test_what_is_wrong_with_a_camera_is_one_line(
    plug: Plug, cameras: list[str] | None, where: str, words: str
) -> None:
    plug(cameras)
    with pytest.raises(RecordingError, match=words):
        open_live(where)


def test_a_camera_that_is_unplugged_is_said_after_what_came(plug: Plug) -> None:
    plug(["A1"], [(0, packet([1])), (0, RuntimeError("disconnected"))])
    items = open_live("usb:").blocks()
    assert isinstance(next(items), Block)
    with pytest.raises(RecordingError, match="the camera is gone: disconnected"):
        next(items)


def test_the_drivers_themselves_say_that_there_is_no_camera() -> None:
    pytest.importorskip("neuromorphic_drivers", reason="neuromorphic-drivers is not installed")
    with pytest.raises(RecordingError, match=r"no USB|no event camera with the serial"):
        open_live("usb:none-has-this")
