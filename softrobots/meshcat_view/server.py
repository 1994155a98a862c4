"""The meshcat server on loopback only; run as `python -m softrobots.meshcat_view.server [PORT]` by the viewer.

Meshcat's own server listens on every address of the machine and outlives a killed parent. This one binds 127.0.0.1 and ends
when its standard input closes, which happens however the parent ends.
"""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from typing import Any

from softrobots.errors import ViewerError

LOOPBACK = "127.0.0.1"
"""The only address that is served."""

_REPLY_TIME = 30_000  # [ms], longest wait for an answer of the server


def main() -> None:
    """Serve until standard input closes; print `zmq_url=` and `web_url=` first. A word is the port; by default a free one."""
    from meshcat.servers.zmqserver import ZMQWebSocketBridge
    from tornado.web import Application, RequestHandler

    listen = Application.listen

    def listen_on_loopback(self: Any, port: int, address: str | None = None, **options: Any) -> Any:
        return listen(self, port, address=LOOPBACK, **options)

    class NoIcon(RequestHandler):  # type: ignore[misc]
        """What browsers ask for of themselves; without an answer they tell an error."""

        def get(self) -> None:
            """Answer with nothing."""
            self.set_status(204)

    Application.listen = listen_on_loopback
    port = int(sys.argv[1]) if len(sys.argv) > 1 else None
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


def start_server(port: int | None = None) -> tuple[subprocess.Popen[bytes], str, str]:
    """Start a server process.

    Args:
        port: Port of the page; by default the first free one from 7000.

    Returns:
        The process, its ZeroMQ address and its web address.

    Raises:
        ViewerError: If it ends before it serves, e.g. because the port is taken.
    """
    wish = [] if port is None else [str(port)]
    server = subprocess.Popen(
        [sys.executable, "-u", "-m", "softrobots.meshcat_view.server", *wish],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    watchdog = threading.Timer(_REPLY_TIME / 1000.0, server.kill)  # a server that says nothing ends, and so does the wait
    watchdog.start()
    found: dict[str, str] = {}
    while server.stdout is not None and len(found) < 2:
        line = server.stdout.readline().decode("utf-8", "replace")
        if not line:
            watchdog.cancel()
            told = server.stderr.read().decode("utf-8", "replace")[-800:] if server.stderr is not None else ""
            end_server(server)
            raise ViewerError(f"the meshcat server ended before it served: {told}")
        name, _, value = line.strip().partition("=")
        if name in ("zmq_url", "web_url"):
            found[name] = value
    watchdog.cancel()
    return server, found["zmq_url"], found["web_url"]


def end_server(server: subprocess.Popen[bytes]) -> None:
    """End a server process and wait for its end."""
    server.terminate()
    try:
        server.wait(5.0)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()
    for stream in (server.stdin, server.stdout, server.stderr):
        if stream is not None:
            stream.close()


def connect(zmq_url: str, web_url: str) -> Any:
    """Connect to a server; returns a `meshcat.Visualizer` whose calls fail rather than wait for ever."""
    import meshcat
    from meshcat.visualizer import ViewerWindow

    class Window(ViewerWindow):  # type: ignore[misc]
        """Meshcat's window without its second socket, which nobody closes, and without its message on stdout."""

        def __init__(self) -> None:
            self.server_proc = None
            self.zmq_url, self.web_url = zmq_url, web_url
            self.connect_zmq()
            self.zmq_socket.rcvtimeo = _REPLY_TIME

    return meshcat.Visualizer(window=Window())


if __name__ == "__main__":
    main()
