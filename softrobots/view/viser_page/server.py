"""Viser's server for a page with sliders: on loopback only, silent, without public sharing, for pages of this machine only."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from softrobots.core.errors import MissingDependency, ViewerError
from softrobots.view.local_requests import REFUSAL, is_local
from softrobots.view.served_page import LOOPBACK

FIRST_PORT = 8080
"""The port that is tried first."""

_STARTING = threading.Lock()


def start_server(label: str, port: int | None = None) -> Any:
    """Start a server in threads of this process; its `stop` ends it.

    Args:
        label: Title of the panel with the sliders.
        port: The port; the first free one from `FIRST_PORT` by default.

    Returns:
        A `viser.ViserServer`.

    Raises:
        MissingDependency: If viser is not installed.
        ViewerError: If the port is not free.
    """
    with MissingDependency.of_imports("viser", "viser"):
        import rich
        import viser

    class Server(viser.ViserServer):  # type: ignore[misc]
        """Viser's server without the public tunnel that any page which finds the port could request."""

        def request_share_url(self, verbose: bool = True) -> None:
            """Share nothing."""

    # Viser prints to stdout at start and end even with verbose=False. Rich captures only what the calling thread prints.
    console = rich.get_console()
    with console.capture(), _for_this_machine():
        server = Server(host=LOOPBACK, port=FIRST_PORT if port is None else port, label=label, verbose=False)
    server.get_event_loop().call_soon_threadsafe(console.begin_capture)
    if port is not None and server.get_port() != port:  # viser took the next free one
        server.stop()
        raise ViewerError(f"port {port} of {LOOPBACK} cannot be had: it is taken, or reserved for the system")
    server.gui.configure_theme(show_logo=False, show_share_button=False)
    server.gui.main_panel.dock_right()  # beside the robot, not before it
    return server


@contextmanager
def _for_this_machine() -> Iterator[None]:
    """Make websocket servers that are started meanwhile refuse foreign pages (`local_requests`); viser has no option for it."""
    import websockets.asyncio.server

    websockets_server: Any = websockets.asyncio.server
    serve = websockets_server.serve

    def guarded(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        def process(connection: Any, request: Any) -> Any:
            if not is_local(*(next(iter(request.headers.get_all(name)), None) for name in ("Host", "Origin"))):
                return connection.respond(403, REFUSAL)
            return None if process_request is None else process_request(connection, request)

        return serve(*arguments, process_request=process, **options)

    with _STARTING:
        websockets_server.serve = guarded
        try:
            yield
        finally:
            websockets_server.serve = serve
