"""Start and end the meshcat server of a viewer, on loopback only, and connect to it."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from softrobots.core.errors import ViewerError
from softrobots.view.served_page import LOOPBACK

_REPLY_TIME = 30_000  # [ms], longest wait for a reply of the server
# As a file: as a module of the package it would import Pinocchio first, which takes as long as the server itself.
_RUN = f"import runpy; runpy.run_path({str(Path(__file__).with_name('server_process.py'))!r}, run_name='__main__')"


def start_server(port: int | None = None) -> tuple[subprocess.Popen[bytes], str, str]:
    """Start a server process.

    Args:
        port: Port of the page; by default the first free one from 7000.

    Returns:
        The process, its ZeroMQ address and its web address.

    Raises:
        ViewerError: If it ends before it serves, e.g. because the port is taken.
    """
    port_argument = [] if port is None else [str(port)]
    server = subprocess.Popen(
        [sys.executable, "-u", "-c", _RUN, LOOPBACK, *port_argument],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    watchdog = threading.Timer(_REPLY_TIME / 1000.0, server.kill)  # a silent server is killed, which ends the wait
    watchdog.start()
    line = next((line for line in server.stdout or () if line.startswith(b"serves ")), b"")
    watchdog.cancel()
    if not line:
        message = server.stderr.read().decode("utf-8", "replace")[-800:] if server.stderr is not None else ""
        end_server(server)
        raise ViewerError(f"the meshcat server ended before it served: {message}")
    _, zmq_url, web_url = line.decode().split()
    return server, zmq_url, web_url


def end_server(server: subprocess.Popen[bytes]) -> None:
    """End a server process and wait for its end."""
    with server:  # closes its streams and waits
        server.terminate()
        try:
            server.wait(5.0)
        except subprocess.TimeoutExpired:
            server.kill()


def connect(zmq_url: str, web_url: str) -> Any:
    """Connect to a server; return a `meshcat.Visualizer` whose calls raise instead of waiting forever."""
    import meshcat
    import zmq
    from meshcat.visualizer import ViewerWindow

    class Window(ViewerWindow):  # type: ignore[misc]
        """Meshcat's window without its second socket, which is never closed, and without its message on stdout."""

        def __init__(self) -> None:
            self.server_proc = None
            self.zmq_url, self.web_url = zmq_url, web_url
            self.connect_zmq()
            self.zmq_socket.rcvtimeo = _REPLY_TIME

        def send(self, command: Any) -> None:
            """Send a command, and wait for the answer."""
            try:
                super().send(command)
            except zmq.ZMQError as error:  # ended or stopped during the call
                raise ViewerError(f"the meshcat server does not answer: {error}") from error

    return meshcat.Visualizer(window=Window())


def send_html(page: Any, what: str, text: str) -> None:
    """Send the server of a `meshcat.Visualizer` what meshcat has no command for: the "page" that it serves, or its "legend".

    Raises:
        ViewerError: If the server does not answer.
    """
    page.window.send(SimpleNamespace(lower=lambda: {"type": what, "path": "", "text": text}))
