"""The meshcat server as a separate process, which `server.ServerProcess` runs; it imports nothing of this package.

Meshcat's own server listens on every address of the machine and outlives a killed parent. This one binds the given address,
refuses foreign pages, and ends when its standard input closes, which happens however the parent ends. It serves the page that
the parent sends, with a legend, and drops properties that have been set again, which meshcat's own keeps for every new browser.
"""

from __future__ import annotations

import contextlib
import os
import runpy
import sys
import threading
from pathlib import Path
from typing import Any

import umsgpack
from meshcat.servers.zmqserver import VIEWER_ROOT, ZMQWebSocketBridge, find_node
from tornado.web import Application, RequestHandler
from tornado.websocket import WebSocketClosedError

_RULES = runpy.run_path(str(Path(__file__).resolve().parent.parent / "local_requests.py"))


class Refused(RequestHandler):  # type: ignore[misc]
    """The answer to foreign pages, also to their websocket requests."""

    def prepare(self) -> None:
        """Refuse before any other handling."""
        self.set_status(403)
        self.finish(_RULES["REFUSAL"])


class NoIcon(RequestHandler):  # type: ignore[misc]
    """The icon that browsers request by themselves; without an answer they log an error."""

    def get(self) -> None:
        """Return an empty answer."""
        self.set_status(204)


class Page(RequestHandler):  # type: ignore[misc]
    """The page that the parent sent; meshcat's own until it sends one."""

    def initialize(self, bridge: Bridge) -> None:
        """Take the server, which keeps the page."""
        self._bridge = bridge

    def get(self) -> None:
        """Return the page."""
        self.set_header("Cache-Control", "no-store")
        self.finish(self._bridge.page or Path(VIEWER_ROOT, "index.html").read_text(encoding="utf-8"))


class Bridge(ZMQWebSocketBridge):  # type: ignore[misc]
    """Meshcat's server with a page of our own and its legend."""

    def __init__(self, port: int | None) -> None:
        self.page = ""
        self.legend = b""
        super().__init__(port=port)
        self.app.add_handlers(".*", [(r"/favicon\.ico", NoIcon), (r"/static/(?:index\.html)?", Page, {"bridge": self})])

    def handle_zmq(self, frames: list[bytes]) -> None:
        """Handle a command of the parent."""
        kind, where, data = frames if len(frames) == 3 else (frames[0], b"", b"")
        if kind == b"page":
            self.page = umsgpack.unpackb(data)["text"]
            self.zmq_socket.send(b"ok")
        elif kind == b"legend":
            self.legend = data
            self.forward_to_websockets(frames)
            self.zmq_socket.send(b"ok")
        else:
            super().handle_zmq(frames)
        if kind == b"set_property":
            node = find_node(self.tree, [part for part in where.decode().split("/") if part])
            name = umsgpack.unpackb(data)["property"]
            node.properties = [*(old for old in node.properties[:-1] if umsgpack.unpackb(old)["property"] != name), data]

    def forward_to_websockets(self, frames: list[bytes]) -> None:
        """Send a command to every browser; one that is closing must not stop the others."""
        for websocket in tuple(self.websocket_pool):
            with contextlib.suppress(WebSocketClosedError):
                websocket.write_message(frames[2], binary=True)

    def send_scene(self, websocket: Any) -> None:
        """Send everything to a new browser."""
        super().send_scene(websocket)
        if self.legend:
            websocket.write_message(self.legend, binary=True)


def serve_this_machine_only(address: str) -> None:
    """Make every server of tornado listen on one address, and refuse foreign pages."""
    listen, find_handler = Application.listen, Application.find_handler

    def listen_there(self: Any, port: int, **options: Any) -> Any:
        return listen(self, port, **(options | {"address": address}))

    def find_for_this_machine(self: Any, request: Any, **options: Any) -> Any:
        headers = request.headers
        if _RULES["is_local"](headers.get("Host"), headers.get("Origin") or headers.get("Sec-Websocket-Origin")):
            return find_handler(self, request, **options)
        return self.get_handler_delegate(request, Refused)

    Application.listen, Application.find_handler = listen_there, find_for_this_machine


def main() -> None:
    """Print "serves" and its two addresses, and serve until standard input closes; arguments: the address, perhaps the port."""
    serve_this_machine_only(sys.argv[1])
    port = int(sys.argv[2]) if len(sys.argv) > 2 else None
    try:
        bridge = Bridge(port)
    except OSError as error:
        sys.exit(f"port {port}: {error.strerror}")
    print(f"serves {bridge.zmq_url} {bridge.web_url}", flush=True)  # noqa: T201
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, sys.stdout.fileno())  # the parent reads no further, and a full pipe would block the server
    os.dup2(quiet, sys.stderr.fileno())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    bridge.run()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    main()
