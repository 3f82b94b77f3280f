"""The door of the page: who has the token comes in, over HTTP and over the websocket.

    request --> Gate (token first in the path, host 127.0.0.1, own origin) --> the page

The token is the first part of every path, so that no cookie is needed, and another site that the
same browser has open cannot guess it.  A name that somebody makes point to 127.0.0.1 is refused by
its host, and a browser is told to ask nobody else for anything.
"""

from __future__ import annotations

import hmac
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]
Application = Callable[[Scope, Receive, Send], Awaitable[None]]

_REFUSED = b"Refused: open the address that `stillhook page` printed, with the token in it.\n"


class Gate:
    """An ASGI application before another one, for those who know the token."""

    def __init__(self, page: Application, *, token: str, port: int) -> None:
        self._page = page
        self._prefix = f"/{token}"
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self._headers = _own_headers(port)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hand a request on, or refuse it."""
        if scope["type"] == "lifespan":
            await self._page(scope, receive, send)
            return
        if not self._known(scope):
            await _refuse(scope, receive, send)
            return

        async def guarded(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message = {**message, "headers": [*message.get("headers", ()), *self._headers]}
            await send(message)

        await self._page({**scope, "root_path": self._prefix}, receive, guarded)

    def _known(self, scope: Scope) -> bool:
        """Return whether a request has the token, and comes from this page or from nowhere."""
        path = str(scope.get("path", ""))
        first = "/" + path.lstrip("/").partition("/")[0]
        token = hmac.compare_digest(first.encode(), self._prefix.encode())
        own = token and path.startswith(self._prefix) and ".." not in path
        headers = {bytes(k).lower(): bytes(v).decode("latin-1") for k, v in scope["headers"]}
        origin = headers.get(b"origin")
        ours = origin is None or origin.removeprefix("http://") in self._hosts
        return own and ours and headers.get(b"host", "") in self._hosts


def _own_headers(port: int) -> list[tuple[bytes, bytes]]:
    """Return what a browser is told: ask this server alone, tell nobody the address."""
    sockets = f"ws://127.0.0.1:{port} ws://localhost:{port}"
    policy = (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
        "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; "
        f"connect-src 'self' {sockets}; frame-ancestors 'none'; base-uri 'self'; "
        "form-action 'none'; object-src 'none'"
    )
    return [
        (b"content-security-policy", policy.encode()),
        (b"referrer-policy", b"no-referrer"),
        (b"x-content-type-options", b"nosniff"),
        (b"cross-origin-resource-policy", b"same-origin"),
    ]


async def _refuse(scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 4403})
        return
    headers = [(b"content-type", b"text/plain; charset=utf-8")]
    await send({"type": "http.response.start", "status": 403, "headers": headers})
    await send({"type": "http.response.body", "body": _REFUSED})
