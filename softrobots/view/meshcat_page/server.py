"""The meshcat server of a viewer, on loopback only, and the connection to it."""

from __future__ import annotations

import contextlib
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


class ServerProcess:
    """A running server process, and its ZeroMQ and web addresses.

    A thread of its own waits for its end. The main thread, where Ctrl-C raises, never asks `Popen` for the status: a
    KeyboardInterrupt inside of `Popen.poll` leaves its lock held, and every later wait hangs.
    """

    def __init__(self, port: int | None = None) -> None:
        """Start a server.

        Args:
            port: Port of the page; by default the first free one from 7000.

        Raises:
            ViewerError: If it ends before it serves, e.g. because the port is taken.
        """
        port_argument = [] if port is None else [str(port)]
        self.process = subprocess.Popen(
            [sys.executable, "-u", "-c", _RUN, LOOPBACK, *port_argument],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self._ended = threading.Event()
        threading.Thread(target=self._wait, daemon=True).start()
        watchdog = threading.Timer(_REPLY_TIME / 1000.0, self.process.kill)  # a silent server is killed, which ends the wait
        watchdog.start()
        line = next((line for line in self.process.stdout or () if line.startswith(b"serves ")), b"")
        watchdog.cancel()
        if not line:
            errors = self.process.stderr
            message = errors.read().decode("utf-8", "replace")[-800:] if errors is not None else ""
            self.end()
            raise ViewerError(f"the meshcat server ended before it served: {message}")
        _, self.zmq_url, self.web_url = line.decode().split()

    @property
    def running(self) -> bool:
        """Whether the process runs."""
        return not self._ended.is_set()

    def end(self) -> None:
        """End the process, wait for its end, and close its streams."""
        self.process.terminate()
        if not self._ended.wait(5.0):
            self.process.kill()
            self._ended.wait()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            if stream is not None:
                with contextlib.suppress(BrokenPipeError):
                    stream.close()

    def _wait(self) -> None:
        self.process.wait()
        self._ended.set()


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
