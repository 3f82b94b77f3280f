"""The server of the page: bound to 127.0.0.1, behind a random token, until Ctrl-C.

serve_page(case) --> socket --> Gate --> NiceGUI --> a Tab for each browser tab
"""

from __future__ import annotations

import contextlib
import importlib.util
import secrets
import socket
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from models.basics import InputError, reason

from .files import StartFolder

NO_PAGE = "the page was not started: it needs nicegui: run `make page`"
HOST = "127.0.0.1"
_TOKEN = 24  # bytes
_SWITCH = 0.001  # between the thread of the looks and the event loop, which should never wait [s]


@dataclass(frozen=True, kw_only=True)
class DoorPlate:
    """Where the page can be found."""

    port: int
    token: str

    @property
    def url(self) -> str:
        """The address, token and all."""
        return f"http://{HOST}:{self.port}/{self.token}/"


def can_serve() -> bool:
    """Return whether NiceGUI is installed."""
    return importlib.util.find_spec("nicegui") is not None


def serve_page(
    case: str,
    *,
    changes: Mapping[str, Any] | None = None,
    port: int = 0,
    ready: Callable[[DoorPlate], None] | None = None,
    folder: StartFolder | None = None,
) -> None:
    """Serve the page until Ctrl-C.

    Parameters
    ----------
    case
        A bundled case, or the name of a case file in the folder.
    changes
        Changes of the case by dotted path.
    port
        The port on 127.0.0.1; 0 for any that is free.
    ready
        Called with the address once connections are taken.
    folder
        The folder that is read from and written to; by default the current one.

    Raises
    ------
    InputError
        If NiceGUI is not installed, the case cannot be opened, or the port is taken.
    """
    if not can_serve():
        raise InputError(NO_PAGE)
    home = folder or StartFolder.here()
    opened, _ = home.open_case(case)  # a wrong case is told before a browser is opened
    if changes:
        opened.replace(dict(changes))
    listening = _bound(port)
    with listening:
        plate = DoorPlate(port=listening.getsockname()[1], token=secrets.token_urlsafe(_TOKEN))
        with ThreadPoolExecutor(1, thread_name_prefix="looks") as executor:
            server = _server(home, case, changes, plate, executor)
            if ready is not None:
                ready(plate)
            interval = sys.getswitchinterval()
            sys.setswitchinterval(_SWITCH)
            try:
                with contextlib.suppress(KeyboardInterrupt):  # which is how it is stopped
                    server.run(sockets=[listening])
            finally:
                sys.setswitchinterval(interval)


def _bound(port: int) -> socket.socket:
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen(64)
    except (OSError, OverflowError) as error:
        listening.close()
        why = reason(error) if isinstance(error, OSError) else str(error)
        raise InputError(f"page: port {port} of {HOST} cannot be used: {why}") from None
    return listening


def _server(
    home: StartFolder,
    case: str,
    changes: Mapping[str, Any] | None,
    plate: DoorPlate,
    executor: ThreadPoolExecutor,
) -> Any:
    """Return the server, ready to run."""
    import uvicorn

    from .gate import Gate

    gate = Gate(application(home, case, changes, executor), token=plate.token, port=plate.port)
    config = uvicorn.Config(
        gate,
        log_level="warning",
        access_log=False,
        server_header=False,
        ws_max_size=2_000_000,
        timeout_graceful_shutdown=1,
    )
    return uvicorn.Server(config)


def application(
    home: StartFolder, case: str, changes: Mapping[str, Any] | None, executor: ThreadPoolExecutor
) -> Any:
    """Return the page as an ASGI application; one for each process, as NiceGUI has it."""
    from fastapi import FastAPI
    from nicegui import Client, app, ui

    from .charts import colour_rules
    from .layout import Layout
    from .tab import Tab

    here = Path(__file__).parent
    style = colour_rules() + (here / "page.css").read_text(encoding="utf-8")
    script = (here / "page.js").read_text(encoding="utf-8")
    tabs: set[Tab] = set()

    @ui.page("/", title="Stillhook", dark=None)
    async def page(client: Client) -> None:
        ui.add_head_html(f"<style>{style}</style><script>{script}</script>")
        ui.colors(primary="#0b5c94")
        tab = Tab(home, executor, Layout, ui.download.content)
        tabs.add(tab)

        def ended() -> None:
            tabs.discard(tab)
            tab.end()

        client.on_delete(ended)
        ui.timer(0.05, lambda: tab.open(case, changes), once=True)

    def all_ended() -> None:
        for tab in tabs:
            tab.end()

    app.on_shutdown(all_ended)
    outer = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    ui.run_with(
        outer,
        title="Stillhook",
        dark=None,
        tailwind=False,
        language="en-GB",
        show_welcome_message=False,
        reconnect_timeout=10.0,
        binding_refresh_interval=None,
    )
    return outer
