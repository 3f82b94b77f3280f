"""The server as users start it: who comes in, where it listens, how it ends."""

from __future__ import annotations

import http.client
import socket
from importlib.util import find_spec

import pytest
from served_page import serve, stop

from stillhook.cli import main
from stillhook.page import NO_PAGE, DoorPlate, serve_page
from stillhook.page.files import StartFolder

needs_nicegui = pytest.mark.skipif(
    find_spec("nicegui") is None, reason="needs nicegui: run `make page`"
)


def asked(page, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", page.port, timeout=20)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    body = answer.read().decode("utf-8", "replace")
    connection.close()
    return answer.status, body


UPGRADE = {
    "Connection": "Upgrade",
    "Upgrade": "websocket",
    "Sec-WebSocket-Version": "13",
    "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
}


@needs_nicegui
@pytest.mark.ci
def test_only_who_has_the_token_is_served_until_ctrl_c(tmp_path):
    page = serve(tmp_path, "thesis-1975")
    try:
        token = page.url.rstrip("/").rpartition("/")[2]
        assert len(token) == 32
        status, body = asked(page, f"/{token}/")
        assert status == 200
        assert "Stillhook" in body
        assert asked(page, "/")[0] == 403
        assert asked(page, f"/{token}/", Host="evil.example")[0] == 403
        assert asked(page, f"/{token}/../../etc/passwd")[0] == 403
        for path in ("_nicegui/static/../../../../etc/passwd", "%2e%2e/%2e%2e/etc/passwd"):
            assert asked(page, f"/{token}/{path}")[0] in (403, 404)
        socket_path = "_nicegui_ws/socket.io/?EIO=4&transport=websocket"
        assert asked(page, f"/{socket_path}", **UPGRADE)[0] == 403
        evil = {**UPGRADE, "Origin": "http://evil.example"}
        assert asked(page, f"/{token}/{socket_path}", **evil)[0] == 403
        # On this machine alone: nobody answers at its other addresses.
        for address in {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None)}:
            if not address.startswith("127.") and ":" not in address:
                with pytest.raises(ConnectionRefusedError):
                    socket.create_connection((address, page.port), timeout=2.0).close()
    finally:
        status, said = stop(page)
    assert status == 0
    assert "Traceback" not in said
    assert [path.name for path in tmp_path.iterdir()] == []


@needs_nicegui
def test_two_pages_have_two_tokens_and_a_taken_port_is_told(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert main(["page", "--no-open", "--port", str(port)]) == 2
    assert f"page: port {port} of 127.0.0.1 cannot be used" in capsys.readouterr().err
    assert DoorPlate(port=8123, token="t").url == "http://127.0.0.1:8123/t/"


@needs_nicegui
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["no-such-case"], "no-such-case"),
        (["../outside.yaml"], "must be a file in the folder that the page was started in"),
        (["/etc/passwd"], "must be a file in the folder that the page was started in"),
        (["thesis-1975", "--set", "rope.length=-1"], "rope.length"),
        (["--port", "70000"], "--port"),
    ],
)
def test_what_cannot_be_shown_is_told_before_anything_is_served(
    words, said, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert main(["page", "--no-open", *words]) == 2
    assert said in capsys.readouterr().err


def test_without_nicegui_one_sentence_says_what_to_do(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("stillhook.page.server.can_serve", lambda: False)
    with pytest.raises(ValueError, match="needs nicegui: run `make page`"):
        serve_page("thesis-1975", folder=StartFolder(tmp_path))
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["page", "--no-open"]) == 2
    assert capsys.readouterr().err.strip() == NO_PAGE
