"""Base class of served pages: address on loopback, SSH tunnel, and closing."""

from __future__ import annotations

import abc
import contextlib
import socket
import time
import urllib.parse
from types import TracebackType
from typing import TypeVar

LOOPBACK = "127.0.0.1"
"""The only address that pages are served on."""

_CHECK_INTERVAL = 0.2  # [s], between checks whether a page is still served

_Page = TypeVar("_Page", bound="ServedPage")


class ServedPage(abc.ABC):
    """A page on loopback; a context manager that ends its server."""

    def __enter__(self: _Page) -> _Page:
        """Return the page."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End the server."""
        self.close()

    _url: str

    @property
    def url(self) -> str:
        """Address of the page; reachable from this machine only."""
        return self._url

    @property
    @abc.abstractmethod
    def serving(self) -> bool:
        """Whether the server runs."""

    @abc.abstractmethod
    def close(self) -> None:
        """End the server; the page stays as it is in browsers that show it."""

    @property
    def port(self) -> int:
        """The port in use."""
        return urllib.parse.urlsplit(self.url).port or 0

    @property
    def tunnel(self) -> str:
        """Command that makes the page reachable from another machine, at the same address."""
        return tunnel_to(self.port)

    def wait(self) -> None:
        """Serve until Ctrl-C or until the server ends."""
        with contextlib.suppress(KeyboardInterrupt):
            while self.serving:
                time.sleep(_CHECK_INTERVAL)


def tunnel_to(port: int) -> str:
    """Return the SSH command that forwards a port of this machine's loopback to another machine, under the same number."""
    return f"ssh -L {port}:{LOOPBACK}:{port} {socket.gethostname()}"
