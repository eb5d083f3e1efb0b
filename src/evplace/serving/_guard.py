"""Guard: who may ask, and how much. Everything that reaches the service passes here first.

Another web page that a user has open may send requests to this machine. So the Host must be an address (or
localhost, or a name that was allowed): a name that was pointed here afterwards, as in DNS rebinding, is none.
The Origin, which browsers send, must be the page's own. Beyond this machine a token is asked for.
"""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from typing import Any
from urllib.parse import parse_qs

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

BODY = 4096
"""Bytes of a request's body at most: none of ours is longer."""
POLICY = (
    b"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    b"connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
HEADERS = (
    (b"content-security-policy", POLICY),
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class Guard:
    """An ASGI application in front of another."""

    def __init__(
        self,
        app: App,
        token: str | None,
        names: Iterable[str] = (),
        anywhere: bool = False,
        free: Iterable[str] = (),
    ) -> None:
        """`names` are Hosts that are right beside addresses; `anywhere` whether other machines may ask.

        The paths in `free` hold nothing of a drive and need no token: a page asks for its styles without.
        """
        self._app, self._token, self._anywhere, self._free = app, token, anywhere, frozenset(free)
        self._names = {"localhost", *(name.lower() for name in names)}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse, or hand on."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self.refusal(scope)
        if refusal is None:
            await self._app(scope, _Bounded(receive), _with_headers(send))
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008, "reason": refusal[1]})
        else:
            await answer(send, *refusal)

    def refusal(self, scope: Scope) -> tuple[int, str] | None:
        """The status and the reason for which a request is refused; None where it is not."""
        headers = _headers(scope)
        host = headers.get("host", "")
        if not self._is_ours(host):
            return 421, "this Host is not served here: ask by address, or allow the name"
        origin = headers.get("origin")
        if origin is not None and origin.lower() not in (f"http://{host}".lower(), f"https://{host}".lower()):
            return 403, "another page may not ask: its Origin is not this service's"
        if not (self._token is None or scope["path"] in self._free or self._has_token(scope, headers)):
            return 401, "a token is needed: ?token=... or Authorization: Bearer ..."
        if _length(headers) > BODY:
            return 413, f"a request holds at most {BODY} bytes"
        return None

    def _is_ours(self, host: str) -> bool:
        """Whether a Host header is one by which this service goes."""
        name = host.rpartition("]")[0].lstrip("[") if host.startswith("[") else host.partition(":")[0]
        if name.lower() in self._names:
            return True
        try:
            at = ipaddress.ip_address(name)
        except ValueError:
            return False
        return self._anywhere or at.is_loopback

    def _has_token(self, scope: Scope, headers: dict[str, str]) -> bool:
        given = headers.get("authorization", "").removeprefix("Bearer ")
        asked = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [given])[0]
        return hmac.compare_digest(asked.encode(), (self._token or "").encode())


async def answer(send: Send, status: int, text: str) -> None:
    """A whole answer of one line."""
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"connection", b"close"), *HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": f"{text}\n".encode()})


class _Bounded:
    """What a client sends, up to BODY bytes; beyond that it counts as gone."""

    def __init__(self, receive: Receive) -> None:
        self._receive, self._left = receive, BODY

    async def __call__(self) -> MutableMapping[str, Any]:
        message = await self._receive()
        self._left -= len(message.get("body", b""))
        return {"type": "http.disconnect"} if self._left < 0 else message


def _with_headers(send: Send) -> Send:
    async def sent(message: MutableMapping[str, Any]) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *HEADERS]}
        await send(message)

    return sent


def _headers(scope: Scope) -> dict[str, str]:
    """Headers by name; of one that comes twice the two together, which is none that is right."""
    found: dict[str, str] = {}
    for name, value in scope["headers"]:
        key = name.decode("latin-1").lower()
        text = value.decode("latin-1")
        found[key] = f"{found[key]}, {text}" if key in found else text
    return found


def _length(headers: dict[str, str]) -> int:
    stated = headers.get("content-length", "0")
    return int(stated) if stated.isdecimal() else BODY + 1
