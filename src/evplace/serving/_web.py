"""The service's pages and addresses, as an ASGI application."""

from __future__ import annotations

import asyncio
import contextlib
import json
import struct
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from evplace.core.errors import EvplaceError
from evplace.serving._hub import Hub, Picture
from evplace.serving._metrics import prometheus
from evplace.serving.service import Service

PAGE = Path(__file__).parent / "page"
PARTS = frozenset(f"/{file.name}" for file in PAGE.iterdir() if file.suffix != ".html")
"""What the page is drawn with: styles, script and icon."""
TYPES = {".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml"}
SEND_S = 10.0
"""Seconds within which a client must take what it is sent."""
BODY_S = 5.0
"""Seconds within which a request's body must come."""
PICTURE_S = 1 / 15
"""Seconds between two event images for one page, at least."""
LISTENERS = 200
"""WebSocket clients at most."""


def application(service: Service) -> Starlette:
    """What answers for a service that has been started on this loop."""
    pages = [
        Route(f"/{'' if file.name == 'index.html' else file.name}", _file(file)) for file in PAGE.iterdir()
    ]
    answers = _Answers(service)
    return Starlette(
        routes=[
            *pages,
            Route("/state", answers.state),
            Route("/healthz", answers.health),
            Route("/metrics", answers.metrics),
            Route("/map.json", answers.route),
            Route("/recent", answers.recent),
            Route("/reference/{item:int}.png", answers.reference),
            Route("/replay", answers.replay, methods=["POST"]),
            WebSocketRoute("/live", answers.live),
            WebSocketRoute("/pictures", answers.pictures),
        ]
    )


def _file(path: Path) -> Callable[[Request], Response]:
    data, kind = path.read_bytes(), TYPES[path.suffix]

    def answer(_: Request) -> Response:
        return Response(data, media_type=kind, headers={"cache-control": "no-cache"})

    return answer


class _Answers:
    """One method an address."""

    def __init__(self, service: Service) -> None:
        self._service = service

    @property
    def _hub(self) -> Hub:
        assert self._service.hub is not None  # the service was started with a loop
        return self._service.hub

    async def state(self, _: Request) -> Response:
        return JSONResponse(self._service.state())

    async def health(self, _: Request) -> Response:
        source = self._service.source_state()
        good = self._service.healthy()
        return JSONResponse({"healthy": good, "source": source}, 200 if good else 503)

    async def metrics(self, _: Request) -> Response:
        text = prometheus(self._service, self._hub)
        return PlainTextResponse(text, media_type="text/plain; version=0.0.4")

    async def route(self, _: Request) -> Response:
        return JSONResponse(self._service.route(), headers={"cache-control": "no-cache"})

    async def recent(self, _: Request) -> Response:
        return JSONResponse(list(self._hub.recent))

    async def reference(self, request: Request) -> Response:
        image = self._service.reference(request.path_params["item"])
        if image is None:
            return PlainTextResponse("the map has no image of that item\n", 404)
        return Response(image, media_type="image/png", headers={"cache-control": "max-age=3600"})

    async def replay(self, request: Request) -> Response:
        """Pause, go on, wind or change the speed: a JSON object with paused, speed or by_s."""
        if request.headers.get("content-type", "").partition(";")[0] != "application/json":
            return PlainTextResponse("send application/json\n", 415)
        try:
            values = json.loads(await asyncio.wait_for(request.body(), BODY_S))
            paused, speed, by_s = _wanted(values)
            self._service.change_replay(paused, speed, by_s)
        except TimeoutError:
            return PlainTextResponse("the body did not come in time\n", 408)
        except EvplaceError as error:
            return PlainTextResponse(f"{error}\n", 409)
        except (ValueError, RecursionError):
            return PlainTextResponse("send paused (true or false), speed or by_s (numbers)\n", 400)
        return JSONResponse(self._service.source_state()["replay"])

    async def live(self, socket: WebSocket) -> None:
        """One JSON a match."""
        if self._hub.listeners >= LISTENERS:
            await socket.close(1013, "too many listen already")
            return
        await socket.accept()
        listener = self._hub.listen()
        try:
            async with _until_gone(socket):
                while True:
                    text = await listener.get()
                    async with asyncio.timeout(SEND_S):
                        await socket.send_text(text)
        finally:
            self._hub.leave(listener)

    async def pictures(self, socket: WebSocket) -> None:
        """Event images: 12 bytes (time in microseconds, width, height), then a byte a pixel."""
        await socket.accept()
        async with _until_gone(socket):
            last: Picture | None = None
            while True:
                picture, pictured = self._hub.picture, self._hub.pictured
                if picture is None or picture is last:
                    await pictured.wait()
                    continue
                last = picture
                height, width = picture.grey.shape
                data = struct.pack("<qHH", picture.t_us, width, height) + picture.grey.tobytes()
                async with asyncio.timeout(SEND_S):
                    await socket.send_bytes(data)
                await asyncio.sleep(PICTURE_S)


@contextlib.asynccontextmanager
async def _until_gone(socket: WebSocket) -> AsyncIterator[None]:
    """Ends the block when the client goes, says anything improper, or takes nothing any more."""
    sender = asyncio.current_task()
    assert sender is not None
    gone = False

    async def listen() -> None:
        nonlocal gone
        with contextlib.suppress(RuntimeError):  # once it has gone, there is nothing to receive
            while True:
                await socket.receive()
        gone = True
        sender.cancel()

    listening = asyncio.create_task(listen())
    try:
        yield
    except asyncio.CancelledError:
        if not gone:  # it is the service that ends
            raise
        sender.uncancel()
    except (TimeoutError, WebSocketDisconnect, RuntimeError, OSError):
        with contextlib.suppress(Exception):
            await asyncio.wait_for(socket.close(1008), 1.0)
    finally:
        listening.cancel()


def _wanted(values: Any) -> tuple[bool | None, float | None, float]:
    """What a request asks of a replay; ValueError where it is no such thing."""
    if not isinstance(values, dict) or set(values) - {"paused", "speed", "by_s"}:
        raise ValueError
    paused, speed, by_s = values.get("paused"), values.get("speed"), values.get("by_s", 0.0)
    numbers = [value for value in (speed, by_s) if value is not None]
    if paused not in (None, True, False) or any(
        isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e6
        for value in numbers
    ):
        raise ValueError
    return paused, None if speed is None else float(speed), float(by_s)
