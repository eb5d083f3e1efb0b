"""`evplace serve` as a person starts and ends it."""

from __future__ import annotations

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from conftest import HANG_S, Drive
from evplace.cli import main
from evplace.core.events import Events
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.sources.readers import open_recording
from evplace.sources.writers import write_recording
from made_streams import faery_datagrams

pytest.importorskip("starlette", reason="the service needs the extra 'web': pip install 'evplace[web]'")
pytest.importorskip("uvicorn", reason="the service needs the extra 'web': pip install 'evplace[web]'")
pytest.importorskip("websockets", reason="the service needs the extra 'web': pip install 'evplace[web]'")

SIZE = (80, 60)


@pytest.fixture(scope="module")
def folder(image_map: PlaceMap, night_drive: Drive, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """street.evp and night.raw."""
    path = tmp_path_factory.mktemp("serve")
    image_map.save(path / "street.evp")
    write_recording(path / "night.raw", [night_drive.events], SIZE)
    return path


class Running:
    """A service in a process of its own."""

    def __init__(self, folder: Path, *more: str, **process: Any) -> None:
        command = [sys.executable, "-m", "evplace", "serve", "--map", str(folder / "street.evp"), *more]
        self.process = subprocess.Popen(
            [*command, "--matcher", "best", "--port", "0"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, stdin=subprocess.PIPE, text=True, **process,
        )  # fmt: skip
        assert self.process.stderr is not None
        self.said = ""
        while "open http" not in self.said:
            line = self.process.stderr.readline()
            assert line, self.said
            self.said += line
        found = re.search(r"open (http://\S+?/)", self.said)
        assert found
        self.address = found[1]

    def json(self, path: str) -> Any:
        with urllib.request.urlopen(self.address + path, timeout=HANG_S) as answer:
            return json.load(answer)

    def until(self, done: Callable[[Any], Any]) -> Any:
        """The state, once something is true of it."""
        until_s = time.monotonic() + HANG_S
        while not done(state := self.json("state")):
            assert time.monotonic() < until_s, state
            time.sleep(0.01)
        return state

    def ended(self) -> tuple[int, str, str]:
        """Exit code, and what it said."""
        out, err = self.process.communicate(timeout=HANG_S)
        return self.process.returncode, out, self.said + err


@contextlib.contextmanager
def running(folder: Path, *more: str, **process: Any) -> Iterator[Running]:
    service = Running(folder, *more, **process)
    try:
        yield service
    finally:
        service.process.kill()
        service.process.communicate()


def localised(state: Any) -> bool:
    return state["match"] is not None and state["match"]["state"] == "localised"


@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_well(folder: Path, tmp_path: Path, sent: signal.Signals) -> None:
    """With listeners, a recording and lines: all is complete, and the end is said in one line."""
    from websockets.sync.client import connect

    came, lines = tmp_path / "came.raw", tmp_path / "lines"
    more = ("--source-set", "loops=0", "--record", str(came), "--lines", str(lines))
    with running(folder, "--source", str(folder / "night.raw"), *more) as service:
        service.until(localised)
        with connect(service.address.replace("http", "ws") + "live") as listener:
            listener.recv(timeout=HANG_S)
            service.process.send_signal(sent)
            code, _, said = service.ended()
    assert code == 0
    assert re.search(r"ended after [\d,]+ events, [\d,]+ recorded in ", said)
    assert "Traceback" not in said
    assert sum(map(len, open_recording(came).packets())) > 0
    for line in lines.read_text().splitlines():
        assert json.loads(line)["map_sha256"]
    assert not [file for file in tmp_path.iterdir() if file.name.startswith(".")]


@pytest.mark.skipif(sys.platform == "win32", reason="files are limited in size by the system on Unix alone")
@pytest.mark.parametrize("name", ["came.raw", "came.aedat4", "came.h5"])
def test_a_full_disk_ends_the_recording_alone_and_is_said(folder: Path, tmp_path: Path, name: str) -> None:
    """No file may grow beyond 60 kB here: that fails where a full disk does, when it is written."""
    import resource

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, 60_000))

    more = ("--source", str(folder / "night.raw"), "--source-set", "loops=0", "--source-set", "speed=20")
    with running(folder, *more, "--record", str(tmp_path / name), preexec_fn=limit) as service:
        state = service.until(lambda state: state["recording"]["fault"] is not None)
        assert name in state["recording"]["fault"]
        later = service.until(lambda now: now["match"]["host_s"] > state["match"]["host_s"] + 0.05)
        assert localised(later)
        assert later["counters"]["not_recorded"] > 0
        service.process.send_signal(signal.SIGTERM)
        code, _, said = service.ended()
    assert code == 0
    assert said.count("Traceback") == 0
    assert state["recording"]["fault"] in said
    assert list(tmp_path.iterdir()) == []


def test_it_ends_with_its_source_where_it_is_told_to(
    folder: Path, image_map: PlaceMap, night_drive: Drive
) -> None:
    """The lines are the matches of the same recording offline."""
    more = ("--source-set", "speed=0", "--lines", "-", "--stop-at-end")
    with running(folder, "--source", str(folder / "night.raw"), *more) as service:
        code, out, _ = service.ended()
    assert code == 0
    where = Localizer(image_map, "best")
    wanted = [*where.push(night_drive.events), *where.finish()]
    found = [json.loads(line) for line in out.splitlines()]
    assert [(one["t_us"], one["item"]) for one in found] == [(match.t_us, match.item) for match in wanted]


def test_standard_input_is_a_source(folder: Path, night_drive: Drive) -> None:
    with running(folder, "--source", "-", "--lines", "-", "--stop-at-end") as service:
        assert service.process.stdin is not None
        service.process.stdin.buffer.write((folder / "night.raw").read_bytes())
        service.process.stdin.close()
        service.process.stdin = None
        code, out, _ = service.ended()
    assert code == 0
    assert len(out.splitlines()) == 60


SENDER = """
import socket, sys, time
from evplace.sources.readers import open_recording
from evplace.sources.live.replay import Replay
sys.path[:0] = sys.argv[3:]
from made_streams import faery_datagrams
from evplace.core.events import Events
sender = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for block in Replay(sys.argv[1], loops=0).open(None).blocks():
    if hasattr(block, "t_us"):
        for data in faery_datagrams(Events(*block[:4], (80, 60))):
            sender.sendto(data, ("127.0.0.1", int(sys.argv[2])))
"""


def test_a_sender_that_is_killed_is_missed_and_found_again(folder: Path) -> None:
    """No answer stands for a camera that is gone; once it is back, the place is."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_one:
        any_one.bind(("127.0.0.1", 0))
        port = any_one.getsockname()[1]
    tests = str(Path(__file__).parents[1])
    command = [sys.executable, "-c", SENDER, str(folder / "night.raw"), str(port), tests]
    with running(folder, "--source", f"udp:{port}") as service:
        for _ in range(2):
            sender = subprocess.Popen(command)
            service.until(localised)
            sender.kill()
            sender.communicate()
            state = service.until(lambda state: state["match"]["state"] == "no-events")
            assert state["match"]["place"] is None
            service.until(lambda state: state["source"]["state"] == "silent")


def test_garbage_on_the_network_changes_nothing(folder: Path, night_drive: Drive) -> None:
    with running(folder, "--source", "udp:0", "--lines", "-") as service:
        assert service.process.poll() is None
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_one:
        any_one.bind(("127.0.0.1", 0))
        port = any_one.getsockname()[1]
    good = faery_datagrams(night_drive.events)
    with (
        running(folder, "--source", f"udp:{port}") as service,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender,
    ):
        for number, data in enumerate(good):
            sender.sendto(data, ("127.0.0.1", port))
            if number % 3 == 0:
                sender.sendto(os.urandom(13 * (number % 50)), ("127.0.0.1", port))
                sender.sendto(os.urandom(100), ("127.0.0.1", port))
        service.until(localised)
        assert service.json("healthz")["healthy"]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--source", "missing.raw"], "cannot read missing.raw"),
        (["--source", "udp:nowhere"], "'nowhere' is no address"),
        (["--source", "night.raw", "--source-set", "sped=2"], "unknown setting 'sped'"),
        (["--source", "night.raw", "--host", "0.0.0.0"], "give a --token"),
        (["--source", "night.raw", "--record", "came.npz"], "can only be written at the end"),
        (["--source", "night.raw", "--record", "street.evp"], "is a folder"),
    ],
)
def test_what_is_wrong_is_one_line(
    folder: Path,
    more: list[str],
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(folder)
    assert main(["serve", "--map", "street.evp", "--port", "0", *more]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert words in said[0]


def test_a_port_in_use_is_one_line(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        arguments = ["serve", "--map", f"{folder}/street.evp", "--source", f"{folder}/night.raw"]
        assert main([*arguments, "--port", str(port)]) == 2
    said = capsys.readouterr().err
    assert re.fullmatch(rf"evplace: cannot serve at 127\.0\.0\.1:{port}: .*: give another --port\n", said)


def test_without_the_extra_one_line_says_what_to_install(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    assert main(["serve", "--map", f"{folder}/street.evp", "--source", f"{folder}/night.raw"]) == 2
    assert "pip install 'evplace[web]'" in capsys.readouterr().err


def test_another_sensor_is_one_line(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_recording(tmp_path / "other.raw", [Events.of([0], [0], [0], [True], (346, 260))], (346, 260))
    assert (
        main(["serve", "--map", f"{folder}/street.evp", "--source", f"{tmp_path}/other.raw", "--port", "0"])
        == 2
    )
    assert "sensor of 80x60 pixels, this source has 346x260" in capsys.readouterr().err
