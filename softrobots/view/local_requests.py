"""Rule for which requests a server on loopback answers: only those of pages of this machine.

A browser sends requests of any page to loopback. A foreign page is recognised by its `Origin`, and one whose domain resolves to
this machine (DNS rebinding) by its `Host`. This file imports nothing of the package, because the meshcat server runs it by its
path.
"""

from urllib.parse import urlsplit

LOCAL_NAMES = ("127.0.0.1", "localhost", "::1")
"""Names of loopback in an address, also at the other end of an SSH tunnel."""

REFUSAL = "This page is for this machine only: open it as http://127.0.0.1 or http://localhost, through a tunnel if need be.\n"
"""Answer to all other requests."""


def is_local(host: str | None, origin: str | None) -> bool:
    """Whether a request comes from a page of this machine.

    Args:
        host: Its header `Host`, or None.
        origin: Its header `Origin`, or None; a browser sends none for a page that is opened by its address.

    Returns:
        True if both are names of loopback or None.
    """
    return all(url is None or _name(url) in LOCAL_NAMES for url in (None if host is None else f"//{host}", origin))


def _name(address: str) -> str | None:
    try:
        return urlsplit(address.strip()).hostname
    except ValueError:  # brackets without an address in them
        return None
