"""The matches of a drive are those of `evplace localize`, byte for byte, whichever source it comes by."""

from __future__ import annotations

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from conftest import HANG_S, Drive
from evplace.cli import main
from evplace.core import families
from evplace.core.events import Events
from evplace.exports import json as json_lines
from evplace.exports import located
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.serving._drive import Drive as LiveDrive
from evplace.serving._feed import Feed
from evplace.serving._report import Report
from evplace.sources.live import Facts, Item, Live, open_live
from evplace.sources.live._bytes import FORMATS
from evplace.sources.live.stdin import Piped
from evplace.sources.live.udp import LAYOUTS, Listening
from evplace.sources.live.zenoh import GID, Subscribed, attachment, leave, session
from evplace.sources.readers import Block
from evplace.sources.writers import write_recording
from made_streams import Camera, as_bytes, camera_packet, datagrams, ros_messages

SIZE = (80, 60)
Sent = contextlib.AbstractContextManager[Live]
"""A source, and whoever sends what it gives."""


class UntilAll:
    """A source that ends once a number of events have come, whatever the clock says meanwhile."""

    pace = 0.0

    def __init__(self, live: Live, events: int) -> None:
        self._live, self._events = live, events
        self.waits = Facts.of(live).waits
        self.came = 0

    def close(self) -> None:
        self._live.close()

    def blocks(self) -> Iterator[Item]:
        for item in self._live.blocks():
            self.came += len(item.t_us) if isinstance(item, Block) else 0
            yield item
            if self.came >= self._events:
                self._live.close()


@contextlib.contextmanager
def replay(events: Events, folder: Path, speed: str) -> Iterator[Live]:
    yield open_live(str(folder / "drive.raw"), speed=float(speed))


@contextlib.contextmanager
def stdin(events: Events, folder: Path, format: str) -> Iterator[Live]:
    reading, writing = os.pipe()

    def write() -> None:
        with os.fdopen(writing, "wb") as pipe:
            pipe.write(as_bytes(format, events))

    threading.Thread(target=write, daemon=True).start()
    live = Piped(reading, format if format == "packed" else None, SIZE, 0.0)
    yield UntilAll(live, len(events))
    os.close(reading)


@contextlib.contextmanager
def tail(events: Events, folder: Path, format: str) -> Iterator[Live]:
    """The file is not there at first, and grows by odd numbers of bytes."""
    path, data = folder / "grows", as_bytes(format, events)

    def write() -> None:
        with path.open("wb", buffering=0) as file:
            for start in range(0, len(data), 7_777):
                file.write(data[start : start + 7_777])

    live = open_live(f"tail:{path}", SIZE, **({"format": "packed"} if format == "packed" else {}))
    threading.Thread(target=write, daemon=True).start()
    yield UntilAll(live, len(events))


@contextlib.contextmanager
def udp(events: Events, folder: Path, layout: str) -> Iterator[Live]:
    live = open_live("udp:0", SIZE, layout=layout)
    assert isinstance(live, Listening)
    counting, port = UntilAll(live, len(events)), live.port

    def send() -> None:
        """No faster than they are read: what the system holds for us is not always much."""
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
            for number, data in enumerate(datagrams(layout, events)):
                while 100 * number > counting.came + 5000:
                    time.sleep(0.001)
                sender.sendto(data, ("127.0.0.1", port))

    threading.Thread(target=send, daemon=True).start()
    yield counting


DV_SENDER = """
import sys, time
import dv_processing as dv
import numpy as np
stream = dv.io.Stream.EventStream(0, "events", "made", (80, 60))
writer = dv.io.NetworkWriter("127.0.0.1", int(sys.argv[1]), stream)
while not writer.getClientCount():
    time.sleep(0.01)
table = np.load(sys.argv[2]).tolist()
for start in range(0, len(table), 1000):
    store = dv.EventStore()
    for t, x, y, p in table[start : start + 1000]:
        store.push_back(t, x, y, bool(p))
    writer.writeEvents(store)
sys.stdin.read()
"""


@contextlib.contextmanager
def dv(events: Events, folder: Path, _: str) -> Iterator[Live]:
    pytest.importorskip("dv_processing", reason="dv-processing is not installed: pip install 'evplace[live]'")
    np.save(folder / "table.npy", np.stack([events.t_us, events.x, events.y, events.p], axis=1))
    port = free_port()
    command = [sys.executable, "-c", DV_SENDER, str(port), str(folder / "table.npy")]
    sender = subprocess.Popen(command, stdin=subprocess.PIPE)
    yield UntilAll(open_live(f"dv:127.0.0.1:{port}", SIZE), len(events))
    sender.kill()
    sender.communicate()


@contextlib.contextmanager
def usb(events: Events, folder: Path, _: str) -> Iterator[Live]:
    parts = [events[start : start + 900] for start in range(0, len(events), 900)]
    camera = Camera(["A1"], [(0, camera_packet(part)) for part in parts])
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "neuromorphic_drivers", camera)
        yield UntilAll(open_live("usb:", SIZE), len(events))


@contextlib.contextmanager
def zenoh(events: Events, folder: Path, encoding: str) -> Iterator[Live]:
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed: pip install 'evplace[live]'")
    from zenoh import CongestionControl

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    camera = session("", "peer", endpoint)
    live = Subscribed(session(endpoint, "peer"), "0/event_camera/events/**", SIZE)
    publisher = camera.declare_publisher(
        "0/event_camera/events/made", congestion_control=CongestionControl.BLOCK
    )
    while not publisher.matching_status.matching:
        time.sleep(0.01)
    for data in ros_messages(encoding, events):
        publisher.put(data, attachment=attachment(1, 0, b"a" * GID))
    yield UntilAll(live, len(events))
    leave(camera)


def free_port() -> int:
    with socket.socket() as any_one:
        any_one.bind(("127.0.0.1", 0))
        port: int = any_one.getsockname()[1]
        return port


ENCODINGS = ("evt3", "mono", "libcaer", "libcaer_cmp")
WAYS: dict[str, tuple[Callable[[Events, Path, str], Sent], tuple[str, ...]]] = {
    "replay": (replay, ("0", "4")),
    "stdin": (stdin, FORMATS),
    "tail": (tail, FORMATS),
    "udp": (udp, tuple(LAYOUTS)),
    "dv": (dv, ("",)),
    "usb": (usb, ("",)),
    "zenoh": (zenoh, ENCODINGS),
}
CASES = [(kind, how) for kind, (_, ways) in WAYS.items() for how in ways]


@pytest.fixture(scope="module")
def folder(image_map: PlaceMap, night_drive: Drive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """street.evp and drive.raw."""
    path = tmp_path_factory.mktemp("sources")
    image_map.save(path / "street.evp")
    write_recording(path / "drive.raw", [night_drive.events], SIZE)
    return path


@pytest.fixture
def offline(folder: Path, capsys: pytest.CaptureFixture[str]) -> str:
    """What `evplace localize --json` prints."""
    assert main(["localize", str(folder / "street.evp"), str(folder / "drive.raw"), "--json"]) == 0
    said = capsys.readouterr().out
    assert said.count('"localised"') > 30
    return said


def test_no_kind_of_source_is_left_out() -> None:
    assert sorted(WAYS) == sorted(families.names("live"))


@pytest.mark.parametrize(("kind", "how"), CASES)
def test_live_is_offline_byte_for_byte(
    kind: str, how: str, offline: str, folder: Path, night_drive: Drive, tmp_path: Path
) -> None:
    events, place_map = night_drive.events, PlaceMap.load(folder / "street.evp")
    reports: list[Report] = []
    with WAYS[kind][0](events, folder if kind == "replay" else tmp_path, how) as live:
        feed = Feed(live, SIZE)
        drive = LiveDrive(Localizer(place_map), feed, reports.append)
        drive.start()
        assert drive.ended.wait(HANG_S)
    assert drive.fault is None
    lines = json_lines.lines(located([report.match for report in reports], place_map))
    assert "".join(f"{line}\n" for line in lines) == offline
    assert feed.counters().events == len(events)
