"""What every page that is served has: an address on loopback, a tunnel to it, and an end."""

from __future__ import annotations

import abc
import contextlib
import socket
import time
import urllib.parse
from types import TracebackType
from typing import TypeVar

LOOPBACK = "127.0.0.1"
"""The only address that is served."""

_LOOK = 0.2  # [s], between two looks at whether a page is still served

_Page = TypeVar("_Page", bound="ServedPage")


class ServedPage(abc.ABC):
    """A page on loopback; a context manager that ends its server."""

    def __enter__(self: _Page) -> _Page:
        """Return the page."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End the server."""
        self.close()

    @property
    @abc.abstractmethod
    def url(self) -> str:
        """Address of the page; reachable from this machine only."""

    @property
    @abc.abstractmethod
    def serving(self) -> bool:
        """Whether the server runs."""

    @abc.abstractmethod
    def close(self) -> None:
        """End the server; the page stays as it is in browsers that show it."""

    @property
    def port(self) -> int:
        """The port that is really used."""
        return urllib.parse.urlsplit(self.url).port or 0

    @property
    def tunnel(self) -> str:
        """Command to type on another machine to see the page there, at the same address."""
        return tunnel_to(self.port)

    def wait(self) -> None:
        """Serve until Ctrl-C or until the server ends."""
        with contextlib.suppress(KeyboardInterrupt):
            while self.serving:
                time.sleep(_LOOK)


def tunnel_to(port: int) -> str:
    """Command to type on another machine that makes a port of this one's loopback reachable there, under the same number."""
    return f"ssh -L {port}:{LOOPBACK}:{port} {socket.gethostname()}"
