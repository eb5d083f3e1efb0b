"""A service on a port of its own, for tests that ask it something."""

from __future__ import annotations

import asyncio
import contextlib
import http.client
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from conftest import HANG_S
from evplace.localizer import Localizer
from evplace.placemap import PlaceMap
from evplace.serving.server import Stop, bound, serve
from evplace.serving.service import Service
from evplace.sources.live import Live


class Served:
    """A service that answers."""

    def __init__(self, service: Service, port: int) -> None:
        self.service, self.port = service, port

    def ask(
        self, path: str, method: str = "GET", body: bytes | None = None, **headers: str
    ) -> tuple[int, bytes]:
        """Status and body of one answer; underscores in the names of headers are dashes."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=HANG_S)
        with contextlib.closing(connection):
            names = {name.replace("_", "-"): value for name, value in headers.items()}
            connection.request(method, path, body, names)
            answer = connection.getresponse()
            return answer.status, answer.read()

    def json(self, path: str) -> Any:
        """What an address says as JSON."""
        status, body = self.ask(path)
        assert status == 200, body
        return json.loads(body)

    def listen(self, path: str = "/live", **more: Any) -> Any:
        """A WebSocket, as a context."""
        from websockets.sync.client import connect

        address = f"ws://127.0.0.1:{self.port}{path}"
        return connect(address, open_timeout=HANG_S, close_timeout=0.1, **more)

    def raw(self) -> socket.socket:
        """A bare connection."""
        return socket.create_connection(("127.0.0.1", self.port), timeout=HANG_S)

    def until(self, done: Callable[[], Any]) -> Any:
        """What `done` gives, once that is true."""
        until_s = time.monotonic() + HANG_S
        while not (found := done()):
            assert time.monotonic() < until_s, "it never came true"
            time.sleep(0.01)
        return found


@contextlib.contextmanager
def serving(
    place_map: PlaceMap,
    path: Path,
    source: Live,
    token: str | None = None,
    host: str = "127.0.0.1",
    at_port: int = 0,
    **more: Any,
) -> Iterator[Served]:
    """A service for the map that lies at `path`, on a thread of its own."""
    service = Service(Localizer(place_map, more.pop("matcher", "best")), source, path, "made", **more)
    listening = bound(host, at_port, token)
    port = listening.getsockname()[1]
    stops: list[Stop] = []
    ready = threading.Event()

    def begun(stop: Stop) -> None:
        stops.append(stop)
        ready.set()

    def run() -> None:
        asyncio.run(serve(service, listening, token, ("robot.local",), begun))

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    assert ready.wait(HANG_S)
    try:
        yield Served(service, port)
    finally:
        stops[0]()
        thread.join(HANG_S)
        assert not thread.is_alive()
        service.close()
