"""Pictures of pages, and the addresses on which a process listens."""

from __future__ import annotations

import io
import socket
from pathlib import Path

import numpy as np

from studies.shared.browser import show_share


def listening(pid: int) -> set[str]:
    """Local addresses on which a process listens, from /proc."""
    inodes = set()
    for descriptor in Path(f"/proc/{pid}/fd").iterdir():
        try:
            target = str(descriptor.readlink())
        except OSError:
            continue
        if target.startswith("socket:["):
            inodes.add(target[8:-1])
    found = set()
    for table, family in (("tcp", socket.AF_INET), ("tcp6", socket.AF_INET6)):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and fields[9] in inodes:
                raw = bytes.fromhex(fields[1].split(":")[0])
                words = b"".join(raw[i : i + 4][::-1] for i in range(0, len(raw), 4))
                found.add(socket.inet_ntop(family, words))
    return found


def pixels(picture: bytes) -> np.ndarray:
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")).astype(int)


def coloured(picture: np.ndarray) -> int:
    """How many pixels have the warm colours of inflated links: red well above blue."""
    scene = picture[200:, :]  # below the legend
    return int(np.count_nonzero(scene[..., 0] - scene[..., 2] > 60))


def pictures_of(browser: object, page_address: str, *shares: float) -> list[np.ndarray]:
    """Pictures of a page at shares of its animation, in this order."""
    page = browser.new_page(viewport={"width": 800, "height": 600})
    messages: list[str] = []
    page.on("console", lambda message: messages.append(message.text) if message.type == "error" else None)
    requests: list[str] = []
    page.on("request", lambda request: None if request.url.startswith("data:") else requests.append(request.url))
    page.on("pageerror", lambda error: messages.append(str(error)))
    page.goto(page_address)
    shots = []
    for share in shares:
        show_share(page, share)
        shots.append(pixels(page.screenshot()))
    page.close()
    assert messages == []
    assert set(requests) == {page_address}  # self-contained: no file but its own is asked for
    return shots
