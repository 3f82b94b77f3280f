"""The door: without the token, or from elsewhere, nobody comes in."""

from __future__ import annotations

import asyncio

import pytest

from stillhook.page.gate import Gate

TOKEN, PORT = "s3cret-token", 8123


def through(path, kind="http", **headers):
    """Return what the page saw of a request, and what was answered."""
    seen, sent = [], []

    async def page(scope, receive, send):
        seen.append(scope)
        if scope["type"] == "http":
            await send({"type": "http.response.start", "status": 200, "headers": []})
            await send({"type": "http.response.body", "body": b"page"})

    async def receive():
        return {"type": f"{kind}.connect"}

    async def send(message):
        sent.append(message)

    given = {"host": f"127.0.0.1:{PORT}", **headers}
    fields = [(k.encode(), v.encode()) for k, v in given.items() if v is not None]
    scope = {"type": kind, "path": path, "headers": fields, "root_path": ""}
    asyncio.run(Gate(page, token=TOKEN, port=PORT)(scope, receive, send))
    return seen, sent


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("path", [f"/{TOKEN}/", f"/{TOKEN}/_nicegui_ws/socket.io"])
def test_who_has_the_token_comes_in(path, kind):
    seen, _ = through(path, kind)
    assert seen[0]["root_path"] == f"/{TOKEN}"
    assert through(path, kind, origin=f"http://127.0.0.1:{PORT}")[0]
    assert through(path, kind, host=f"localhost:{PORT}")[0]


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    ("path", "headers"),
    [
        ("/", {}),
        ("/_nicegui_ws/socket.io", {}),
        (f"/{TOKEN[:-1]}/", {}),
        (f"/{TOKEN}x/", {}),
        (f"/x/{TOKEN}/", {}),
        (f"/{TOKEN}/../secret", {}),
        (f"//{TOKEN}/", {}),
        (f"/{TOKEN}/", {"host": "evil.example"}),
        (f"/{TOKEN}/", {"host": "127.0.0.1:9"}),
        (f"/{TOKEN}/", {"host": None}),
        (f"/{TOKEN}/", {"origin": "http://evil.example"}),
        (f"/{TOKEN}/", {"origin": "https://127.0.0.1:8123"}),
        (f"/{TOKEN}/", {"origin": "null"}),
    ],
)
def test_nobody_else_does(path, headers, kind):
    seen, sent = through(path, kind, **headers)
    assert seen == []
    if kind == "http":
        assert sent[0]["status"] == 403
        assert b"Refused: open the address that `stillhook page` printed" in sent[1]["body"]
        assert TOKEN.encode() not in sent[1]["body"]
    else:
        assert sent == [{"type": "websocket.close", "code": 4403}]


def test_a_browser_is_told_to_ask_nobody_else():
    _, sent = through(f"/{TOKEN}/")
    headers = {k.decode(): v.decode() for k, v in sent[0]["headers"]}
    policy = headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert not [word for word in policy.split() if "//" in word and ":8123" not in word]
    assert headers["referrer-policy"] == "no-referrer"


def test_the_lifespan_passes():
    seen = []

    async def page(scope, receive, send):
        seen.append(scope["type"])

    asyncio.run(Gate(page, token=TOKEN, port=PORT)({"type": "lifespan"}, None, None))
    assert seen == ["lifespan"]
