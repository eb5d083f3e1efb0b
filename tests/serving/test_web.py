"""What the service answers, to whom, and that nobody can hold it up."""

from __future__ import annotations

import io
import json
import re
import struct
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_sources import Made, block
from PIL import Image

from conftest import HANG_S, Drive, make_drive
from evplace.core.errors import OutputError, RecordingError, SettingsError
from evplace.core.events import Events
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap, train
from evplace.sources.live import open_live
from evplace.sources.writers import write_recording

pytest.importorskip("starlette", reason="the service needs the extra 'web': pip install 'evplace[web]'")
pytest.importorskip("uvicorn", reason="the service needs the extra 'web': pip install 'evplace[web]'")
pytest.importorskip("websockets", reason="the service needs the extra 'web': pip install 'evplace[web]'")

from served import Served, serving

from evplace.serving.server import bound
from evplace.serving.service import Service


@pytest.fixture(scope="module")
def street(image_map: PlaceMap, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("maps") / "street.evp"
    image_map.save(path)
    return path


class Fed:
    """A service, and the source that feeds it."""

    def __init__(self, served: Served, source: Made, events: Events) -> None:
        self.served, self.source, self._events = served, source, events
        self._at = 0

    def drive(self, events: int = 6000) -> None:
        """Some more of the drive."""
        stop = self._at + events
        for start in range(self._at, stop, 1000):
            self.source.put(block(self._events[start : start + 1000]))
        self._at = stop

    def answered(self) -> dict[str, Any]:
        """The last match, once there is one."""
        found: dict[str, Any] = self.served.until(lambda: self.served.json("/state")["match"])
        return found


@pytest.fixture
def fed(image_map: PlaceMap, street: Path, night_drive: Drive) -> Iterator[Fed]:
    source = Made(pace=0)
    with serving(image_map, street, source) as served:
        yield Fed(served, source, night_drive.events)


def test_the_state_says_all_that_is_known(fed: Fed) -> None:
    assert fed.served.json("/state")["match"] is None
    fed.drive()
    match = fed.answered()
    assert match["state"] == "localised"
    state = fed.served.json("/state")
    assert state["map"]["name"] == "street.evp"
    assert re.fullmatch(r"[0-9a-f]{64}", state["map"]["sha256"])
    assert state["map"]["sha256"] == match["map_sha256"]
    assert state["counters"]["events"] > 0
    assert state["source"]["state"] in ("live", "silent")
    assert fed.served.json("/healthz")["healthy"] is True


def test_each_match_is_one_message(fed: Fed, image_map: PlaceMap, night_drive: Drive) -> None:
    with fed.served.listen() as socket:
        fed.served.until(lambda: fed.served.json("/state")["clients"] == 1)
        fed.drive(30_000)
        wanted = list(Localizer(image_map, "best").push(night_drive.events[:30_000]))
        for match in wanted[:40]:
            said = json.loads(socket.recv(timeout=HANG_S))
            assert (said["t_us"], said["item"], said["state"]) == (match.t_us, match.item, match.state)
            assert (said["easting"], said["northing"]) == match.position
    fed.served.until(lambda: fed.served.json("/state")["clients"] == 0)


def test_the_pages_pictures_and_route_are_there(fed: Fed, image_map: PlaceMap) -> None:
    status, page = fed.served.ask("/")
    assert status == 200
    for name in re.findall(r'(?:src|href)="([^"]+)"', page.decode()):
        assert fed.served.ask(f"/{name}")[0] == 200, name
    route = fed.served.json("/map.json")
    assert len(route["items"]) == len(image_map.items)
    assert route["has_images"]
    status, png = fed.served.ask("/reference/7.png")
    assert image_map.references is not None
    np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(png))), image_map.references[7])
    assert fed.served.ask("/reference/99999.png")[0] == 404
    with fed.served.listen("/pictures") as socket:
        fed.drive()
        data = socket.recv(timeout=HANG_S)
        t_us, width, height = struct.unpack("<qHH", data[:12])
        assert (width, height, len(data)) == (160, 90, 12 + 160 * 90)
        assert t_us > 0
    assert fed.served.json("/recent")[0][1] == "localised"


def test_metrics_are_prometheus_text(fed: Fed) -> None:
    fed.drive()
    fed.answered()
    status, body = fed.served.ask("/metrics")
    assert status == 200
    for line in body.decode().splitlines():
        assert re.fullmatch(
            r"# (HELP|TYPE) evplace_\w+ .+|evplace_\w+(\{\w+=\"[^\"]*\"\})? (NaN|nan|-?[\d.e+-]+)", line
        ), line
    assert re.search(r'evplace_matches_total\{state="localised"\} [1-9]', body.decode())


# Who may ask


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 421),
        ({"Host": "127.0.0.1.evil.example:80"}, 421),
        ({"Host": "192.168.1.7:8000"}, 421),
        ({"Host": ""}, 421),
        ({"Host": "localhost:1"}, 200),
        ({"Host": "[::1]:8000"}, 200),
        ({"Host": "ROBOT.local"}, 200),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "localhost:8000", "Origin": "http://localhost:8000"}, 200),
        ({"Host": "localhost:8000", "Origin": "http://localhost:9000"}, 403),
    ],
)
def test_host_and_origin_are_checked(fed: Fed, headers: dict[str, str], status: int) -> None:
    assert fed.served.ask("/state", **headers)[0] == status


def test_a_foreign_page_gets_no_socket(fed: Fed) -> None:
    from websockets.exceptions import InvalidStatus

    for path in ("/live", "/pictures"):
        with pytest.raises(InvalidStatus, match="403"), fed.served.listen(path, origin="http://evil.example"):
            pass
    with fed.served.listen(origin=f"http://127.0.0.1:{fed.served.port}"):
        pass


def test_a_token_is_asked_of_everybody(image_map: PlaceMap, street: Path) -> None:
    from websockets.exceptions import InvalidStatus

    with serving(image_map, street, Made(), token="secret", host="0.0.0.0") as served:
        for path in ("/", "/state", "/metrics", "/healthz", "/map.json"):
            assert served.ask(path)[0] == 401
            assert served.ask(f"{path}?token=wrong")[0] == 401
            assert served.ask(f"{path}?token=secret")[0] == 200
            assert served.ask(path, Authorization="Bearer secret")[0] == 200
            assert served.ask(path, Host="192.168.1.7", Authorization="Bearer secret")[0] == 200
        with pytest.raises(InvalidStatus, match="403"), served.listen("/live?token=wrong"):
            pass
        with served.listen("/live?token=secret"):
            pass


def test_beyond_this_machine_there_must_be_a_token() -> None:
    with pytest.raises(SettingsError, match=r"host 0\.0\.0\.0 can be reached by other machines"):
        bound("0.0.0.0", 0, None)


def test_a_port_in_use_is_one_line() -> None:
    with bound("127.0.0.1", 0, None) as first:
        port = first.getsockname()[1]
        with pytest.raises(OutputError, match=rf"cannot serve at 127\.0\.0\.1:{port}: "):
            bound("127.0.0.1", port, None)


def test_answers_forbid_the_page_to_ask_elsewhere(fed: Fed) -> None:
    import http.client

    connection = http.client.HTTPConnection("127.0.0.1", fed.served.port, timeout=HANG_S)
    connection.request("GET", "/")
    answer = connection.getresponse()
    policy = answer.getheader("content-security-policy")
    assert policy is not None
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    answer.read()
    connection.close()


# Nobody can hold it up


def still_answers(fed: Fed) -> None:
    assert fed.served.ask("/state")[0] == 200
    before = fed.served.service.feed.counters().events
    fed.drive(2000)
    fed.served.until(lambda: fed.served.service.feed.counters().events > before)


@pytest.mark.parametrize(
    "data",
    [b"\r\n\r\n", b"GARBAGE\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"GET /\r\nHost\r\n\r\n",
     bytes(range(256)) * 8,
     b"GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n", b"GET /" + b"a" * 100_000,
     b"POST /replay HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n"],
)  # fmt: skip
def test_malformed_requests_are_refused_and_nothing_else_happens(fed: Fed, data: bytes) -> None:
    with fed.served.raw() as socket:
        socket.sendall(data)
        answer = socket.recv(4096)
        assert answer == b"" or answer.startswith((b"HTTP/1.1 4", b"HTTP/1.1 505"))
    still_answers(fed)


def test_a_body_that_is_too_large_is_refused(fed: Fed) -> None:
    headers = {"Content_Type": "application/json"}
    assert fed.served.ask("/replay", "POST", b"x" * 100_000, **headers)[0] == 413
    with fed.served.raw() as socket:  # without a length said before
        socket.sendall(b"POST /replay HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n")
        socket.sendall(b"Transfer-Encoding: chunked\r\n\r\n")
        piece = b"4000\r\n" + b"x" * 0x4000 + b"\r\n"
        try:
            for _ in range(100):
                socket.sendall(piece)
            answer = socket.recv(4096)
        except OSError:
            answer = b""  # it has hung up
        assert not answer.startswith(b"HTTP/1.1 2")
    still_answers(fed)


def test_a_body_that_does_not_come_is_given_up(fed: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evplace.serving._web.BODY_S", 0.2)
    with fed.served.raw() as socket:
        socket.sendall(b"POST /replay HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n")
        socket.sendall(b"Content-Length: 10\r\n\r\n{")
        assert socket.recv(4096).startswith(b"HTTP/1.1 408")
    still_answers(fed)


@pytest.mark.parametrize("sent", ["x" * 5000, b"\0" * 5000])
def test_one_who_says_too_much_is_hung_up_on(fed: Fed, sent: str | bytes) -> None:
    """Nothing of ours listens to what comes by a WebSocket, so that it holds 4 kB at most."""
    from websockets.exceptions import ConnectionClosed

    for path in ("/live", "/pictures"):
        with fed.served.listen(path) as socket, pytest.raises(ConnectionClosed, match="1009"):
            socket.send(sent)
            while True:
                socket.recv(timeout=HANG_S)
    fed.served.until(lambda: fed.served.json("/state")["clients"] == 0)
    still_answers(fed)


def test_too_many_connections_are_sent_away(
    image_map: PlaceMap, street: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evplace.serving.server.CONNECTIONS", 3)
    with serving(image_map, street, Made()) as served:
        resting = [served.raw() for _ in range(3)]
        served.until(lambda: served.ask("/state")[0] == 503)
        for socket in resting:
            socket.close()
        served.until(lambda: served.ask("/state")[0] == 200)


def test_requests_that_come_byte_by_byte_are_given_up(fed: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("evplace.serving._connections.HEADER_S", 0.2)
    slow = [fed.served.raw() for _ in range(50)]
    for socket in slow:
        socket.sendall(b"GET /state HTTP/1.1\r\nHost: local")
    still_answers(fed)
    for socket in slow:
        assert socket.recv(100) == b""
        socket.close()
    with fed.served.raw() as again:  # the same after a first request that was good
        again.sendall(b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n")
        assert again.recv(10_000).startswith(b"HTTP/1.1 200")
        again.sendall(b"GET /state HTTP/1.1\r\nHost: local")
        while again.recv(10_000):
            pass


def test_one_who_never_reads_holds_up_nobody(fed: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    """It loses messages, and the others get all of theirs."""
    with fed.served.listen(max_queue=1) as deaf, fed.served.listen() as other:
        deaf.socket.settimeout(None)
        fed.served.until(lambda: fed.served.json("/state")["clients"] == 2)
        got: list[str] = []

        def read() -> None:
            got.extend(other.recv(timeout=HANG_S) for _ in range(30))

        reading = threading.Thread(target=read, daemon=True)
        reading.start()
        fed.drive(25_000)
        reading.join(HANG_S)
        assert len(got) == 30
    still_answers(fed)


def test_a_listener_that_takes_nothing_has_a_bounded_queue() -> None:
    import asyncio

    from evplace.serving._hub import WAITING, Listener

    listener = Listener()
    for number in range(1000):
        listener.put(str(number))
    assert listener.lost == 1000 - WAITING
    assert asyncio.run(listener.get()) == str(1000 - WAITING)


def test_too_many_listeners_are_sent_away(fed: Fed, monkeypatch: pytest.MonkeyPatch) -> None:
    from websockets.exceptions import InvalidStatus

    monkeypatch.setattr("evplace.serving._web.LISTENERS", 1)
    with fed.served.listen():
        fed.served.until(lambda: fed.served.json("/state")["clients"] == 1)
        with pytest.raises(InvalidStatus), fed.served.listen():
            pass


# What goes wrong while serving


def test_a_source_that_fails_is_said_and_the_last_answer_stays(fed: Fed) -> None:
    fed.drive()
    match = fed.answered()
    fed.source.put(RecordingError("the camera is gone"))
    fed.served.until(lambda: fed.served.ask("/healthz")[0] == 503)
    state = fed.served.json("/state")
    assert state["source"]["fault"] == "the camera is gone"
    assert state["source"]["state"] == "ended"
    assert state["match"]["t_us"] >= match["t_us"]


def test_a_map_that_is_replaced_is_said_and_the_loaded_one_goes_on(
    image_map: PlaceMap, night_drive: Drive, tmp_path: Path
) -> None:
    path = tmp_path / "street.evp"
    image_map.save(path)
    source = Made(pace=0)
    with serving(image_map, path, source) as served:
        fed = Fed(served, source, night_drive.events)
        assert served.json("/state")["map"]["replaced"] is False
        from conftest import make_traverse
        from evplace.places import PlaceGrid

        other = make_traverse(make_drive(seed=5, windows=30))
        assert other.track is not None
        train(other, PlaceGrid.from_track(other.track), scorer="sad").save(path, overwrite=True)
        assert served.json("/state")["map"]["replaced"] is True
        fed.drive()
        assert fed.answered()["state"] == "localised"
        assert served.json("/map.json")["sha256"] == fed.answered()["map_sha256"]


def test_another_sensor_is_refused_before_anything_begins(image_map: PlaceMap, street: Path) -> None:
    with pytest.raises(RecordingError, match="sensor of 80x60 pixels, this source has 346x260"):
        Service(Localizer(image_map, "best"), Made(size=(346, 260)), street, "made")


def test_a_page_that_is_opened_again_finds_what_was(fed: Fed) -> None:
    with fed.served.listen() as socket:
        fed.drive()
        first = json.loads(socket.recv(timeout=HANG_S))
    with fed.served.listen() as socket:
        assert first["t_us"] in [past[0] for past in fed.served.json("/recent")]
        fed.drive()
        assert json.loads(socket.recv(timeout=HANG_S))["t_us"] > first["t_us"]


# A replay can be controlled


def test_a_replay_is_paused_wound_and_changed(
    image_map: PlaceMap, street: Path, night_drive: Drive, tmp_path: Path
) -> None:
    write_recording(tmp_path / "night.raw", [night_drive.events], (80, 60))
    source = open_live(str(tmp_path / "night.raw"), loops=0)
    good = {"Content_Type": "application/json"}
    with serving(image_map, street, source) as served:

        def told(body: object, **headers: str) -> int:
            return served.ask("/replay", "POST", json.dumps(body).encode(), **(headers or good))[0]

        assert told({"paused": True}) == 200
        served.until(lambda: served.json("/state")["source"]["state"] == "paused")
        assert told({"paused": False, "speed": 2, "by_s": 1.0}) == 200
        replay = served.json("/state")["source"]["replay"]
        assert (replay["speed"], replay["paused"]) == (2.0, False)
        served.until(lambda: served.json("/state")["source"]["replay"]["at_s"] >= 1.0)
        for wrong in ({"speed": "2"}, {"speed": True}, {"by_s": 1e99}, {"paused": 3}, {"other": 1}, [1], "x"):
            assert told(wrong) == 400, wrong
        assert told({"speed": 0}) == 409
        assert told({"paused": True}, Content_Type="text/plain") == 415
        assert served.ask("/replay", "POST", b"{", **good)[0] == 400
        assert told({"paused": True}, Content_Type="application/json", Origin="http://evil.example") == 403


def test_a_camera_cannot_be_wound(fed: Fed) -> None:
    body = json.dumps({"by_s": 1.0}).encode()
    status, text = fed.served.ask("/replay", "POST", body, Content_Type="application/json")
    assert status == 409
    assert b"no replay" in text
