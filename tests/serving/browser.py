"""A browser that is told what to do over its debugging port: pages as people see them."""

from __future__ import annotations

import base64
import contextlib
import itertools
import json
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from conftest import HANG_S

FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --disable-dev-shm-usage --remote-debugging-port=0"
).split()
DESKTOP, PHONE = (1280, 900, False), (390, 844, True)


class Tab:
    """One page. Requests and complaints are kept from its start on."""

    def __init__(self, socket: Any) -> None:
        self._socket = socket
        self._ids = itertools.count(1)
        self.requests: list[str] = []
        self.complaints: list[str] = []
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def call(self, method: str, **values: Any) -> dict[str, Any]:
        """Have something done; what happened meanwhile is kept."""
        number = next(self._ids)
        self._socket.send(json.dumps({"id": number, "method": method, "params": values}))
        while True:
            said = json.loads(self._socket.recv(timeout=HANG_S))
            if said.get("id") == number:
                assert "error" not in said, (method, said)
                result: dict[str, Any] = said["result"]
                return result
            self._note(said)

    def _note(self, said: dict[str, Any]) -> None:
        method, values = said.get("method"), said.get("params", {})
        if method == "Network.requestWillBeSent":
            self.requests.append(values["request"]["url"])
        elif method == "Network.webSocketCreated":
            self.requests.append(values["url"])
        elif method == "Runtime.exceptionThrown":
            self.complaints.append(json.dumps(values["exceptionDetails"])[:500])
        elif method == "Runtime.consoleAPICalled" and values["type"] in ("error", "warning"):
            self.complaints.append(json.dumps(values["args"])[:500])
        elif method == "Log.entryAdded" and values["entry"]["level"] in ("error", "warning"):
            self.complaints.append(values["entry"]["text"])

    def look(self, kind: tuple[int, int, bool], dark: bool = False) -> None:
        """A screen of that size, and the colours that its user likes."""
        width, height, mobile = kind
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width, height=height, deviceScaleFactor=2 if mobile else 1, mobile=mobile,
        )  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])

    def open(self, address: str) -> None:
        """Go there."""
        self.call("Page.navigate", url=address)

    def value(self, code: str) -> Any:
        """What a line of JavaScript gives."""
        answer = self.call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait(self, code: str) -> Any:
        """The first value of a line of JavaScript that is true."""
        until_s = time.monotonic() + HANG_S
        while not (found := self.value(code)):
            assert time.monotonic() < until_s, f"{code} never became true"
            time.sleep(0.05)
        return found

    def picture(self, path: Path, whole: bool = True) -> None:
        """Write what is seen as a .png."""
        shot = self.call("Page.captureScreenshot", captureBeyondViewport=whole)
        path.write_bytes(base64.b64decode(shot["data"]))


def browser() -> str:
    """A browser's path; the test is skipped where there is none."""
    found = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if found is None:
        pytest.skip("no browser: install chromium to test the page as it is drawn")
    return found


@contextlib.contextmanager
def opened(profile: Path, wait: Callable[[float], None] = time.sleep) -> Iterator[Tab]:
    """A tab of a browser of its own."""
    from websockets.sync.client import connect

    command = [browser(), *FLAGS, f"--user-data-dir={profile}", "about:blank"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        port = profile / "DevToolsActivePort"
        until_s = time.monotonic() + HANG_S
        while not (port.exists() and len(port.read_text().split()) == 2):
            assert time.monotonic() < until_s, "the browser did not start"
            assert process.poll() is None, "the browser ended"
            wait(0.05)
        number = port.read_text().split()[0]
        with connect(_page_of(number), max_size=None, open_timeout=HANG_S, close_timeout=0.1) as socket:
            yield Tab(socket)
    finally:
        process.kill()
        process.wait()


def _page_of(port: str) -> str:
    """The address by which the first page is told what to do."""
    import urllib.request

    while True:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=HANG_S) as answer:
            for page in json.load(answer):
                if page["type"] == "page":
                    return str(page["webSocketDebuggerUrl"])
