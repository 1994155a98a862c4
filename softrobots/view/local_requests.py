"""Which requests a server on loopback answers: those of pages and people of this machine.

A browser sends every page's requests to loopback. A page from elsewhere tells so in `Origin`; one whose name its owner has made
to mean this machine (DNS rebinding) tells that name in `Host`. This file imports nothing of ours: the meshcat server, which
does not import the package either, runs it by its path.
"""

from urllib.parse import urlsplit

LOCAL_NAMES = ("127.0.0.1", "localhost", "::1")
"""What this machine is called in an address, also at the other end of an SSH tunnel."""

REFUSAL = "This page is for this machine only: open it as http://127.0.0.1 or http://localhost, through a tunnel if need be.\n"
"""What everybody else is told."""


def is_local(host: str | None, origin: str | None) -> bool:
    """Whether a request comes from this machine, as far as browsers tell.

    Args:
        host: Its header `Host`, or None.
        origin: Its header `Origin`, or None: what a browser leaves out for a page that is opened by its address.

    Returns:
        Whether both are names of loopback, or left out.
    """
    return all(told is None or _name(told) in LOCAL_NAMES for told in (None if host is None else f"//{host}", origin))


def _name(address: str) -> str | None:
    try:
        return urlsplit(address.strip()).hostname
    except ValueError:  # brackets without an address in them
        return None
