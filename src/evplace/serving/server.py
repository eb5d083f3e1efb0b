"""The service on a socket: connections are bounded in number and time, and signals end it within seconds."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import socket
import sys
import threading
from collections.abc import Callable, Generator
from typing import Any

from evplace.core.errors import MissingExtraError, OutputError, SettingsError
from evplace.serving._guard import Guard
from evplace.serving.service import Service

CONNECTIONS = 256
"""Connections at most; further ones get 503."""
HEADER_S = 5.0
"""Seconds within which a request's head must have come."""
IDLE_S = 10
"""Seconds that a connection may rest between requests."""
DRAIN_S = 1
"""Seconds that requests in progress are waited for at the end."""
CLOSE_S = 0.6
"""Seconds within which the drive ends."""
Stop = Callable[[], object]
"""Ends a server, from any thread."""
LOOPBACK = ("127.0.0.1", "::1", "localhost")


def check_web() -> None:
    """MissingExtraError where what serves pages is not installed."""
    for package in ("starlette", "uvicorn", "websockets"):
        try:
            __import__(package)
        except ImportError as error:
            raise MissingExtraError(package, "web", "a service with a page") from error


def bound(host: str, port: int, token: str | None) -> socket.socket:
    """A socket at which a service may listen.

    SettingsError for a host beyond this machine without a token; OutputError where the port is taken.
    """
    if host not in LOOPBACK and not token:
        raise SettingsError(
            f"the host {host} can be reached by other machines: give a `token`, or leave the host 127.0.0.1"
        )
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listening = socket.socket(family, socket.SOCK_STREAM)
    if sys.platform != "win32":
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((host, port))
        listening.listen(64)
    except (OSError, OverflowError) as error:
        listening.close()
        reason = getattr(error, "strerror", None) or error
        raise OutputError(f"cannot serve at {host}:{port}: {reason}: give another `port`") from error
    return listening


async def serve(
    service: Service,
    listening: socket.socket,
    token: str | None,
    names: tuple[str, ...],
    ready: Callable[[Stop], None],
) -> None:
    """Serve until a signal comes, or until what `ready` is given is called.

    `ready` is called once pages are answered. Signals are heard on the main thread alone.
    """
    import uvicorn

    from evplace.serving._connections import Patient, Quiet
    from evplace.serving._web import PARTS, application

    loop = asyncio.get_running_loop()
    service.start(loop)
    anywhere = listening.getsockname()[0] not in LOOPBACK
    logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)  # what goes wrong is said in one line
    config = uvicorn.Config(
        Guard(application(service), token, names, anywhere, PARTS),
        http=Patient,
        ws="websockets-sansio",
        ws_max_size=4096,
        ws_per_message_deflate=False,
        limit_concurrency=CONNECTIONS,
        timeout_keep_alive=IDLE_S,
        timeout_graceful_shutdown=DRAIN_S,
        h11_max_incomplete_event_size=16 << 10,
        access_log=False,
        log_config=None,
        lifespan="off",
        server_header=False,
        proxy_headers=False,
    )
    server = Quiet(config)
    with _signals(loop, server):
        serving = asyncio.create_task(server.serve(sockets=[listening]))
        while not server.started and not serving.done():
            await asyncio.sleep(0.01)
        ready(lambda: loop.call_soon_threadsafe(server.end))
        await serving
        await asyncio.to_thread(service.drive.close, CLOSE_S)  # while there is a loop to report to


@contextlib.contextmanager
def _signals(loop: asyncio.AbstractEventLoop, server: Any) -> Generator[None, None, None]:
    """SIGTERM and Ctrl-C end the server well; a second one at once."""

    main = threading.current_thread() is threading.main_thread()
    names = [signal.SIGINT, signal.SIGTERM] if main else []
    before = {name: signal.getsignal(name) for name in names}
    for name in names:
        signal.signal(name, lambda *_: loop.call_soon_threadsafe(server.end))
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)
