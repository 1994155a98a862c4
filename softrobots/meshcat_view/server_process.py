"""The meshcat server as a process of its own, which `server.start_server` runs; it imports nothing of this package.

Meshcat's own server listens on every address of the machine and outlives a killed parent. This one binds the address that it is
told, and ends when its standard input closes, which happens however the parent ends.
"""

from __future__ import annotations

import os
import sys
import threading
from typing import Any


def main() -> None:
    """Serve until standard input closes; print `zmq_url=` and `web_url=` first. Words: the address, and perhaps the port."""
    from meshcat.servers.zmqserver import ZMQWebSocketBridge
    from tornado.web import Application, RequestHandler

    listen = Application.listen

    def listen_on_loopback(self: Any, port: int, address: str | None = None, **options: Any) -> Any:
        return listen(self, port, address=sys.argv[1], **options)

    class NoIcon(RequestHandler):  # type: ignore[misc]
        """What browsers ask for of themselves; without an answer they tell an error."""

        def get(self) -> None:
            """Answer with nothing."""
            self.set_status(204)

    Application.listen = listen_on_loopback
    port = int(sys.argv[2]) if len(sys.argv) > 2 else None
    try:
        bridge = ZMQWebSocketBridge(port=port)
    except OSError as error:
        sys.exit(f"port {port}: {error.strerror}")
    bridge.app.add_handlers(".*", [(r"/favicon\.ico", NoIcon)])
    print(f"zmq_url={bridge.zmq_url}\nweb_url={bridge.web_url}", flush=True)  # noqa: T201
    quiet = os.open(os.devnull, os.O_WRONLY)
    os.dup2(quiet, sys.stdout.fileno())  # nobody reads on, and a full pipe would block the server
    os.dup2(quiet, sys.stderr.fileno())
    threading.Thread(target=_end_with_parent, daemon=True).start()
    bridge.run()


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    main()
