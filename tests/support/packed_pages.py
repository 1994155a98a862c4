"""What a self-contained page holds: the inverse of `softrobots.view.meshcat_page.page_commands.packed`."""

from __future__ import annotations

import base64
import json
import re
import zlib

_SCENE = re.compile(r'<script id="softrobots-scene" type="text/plain">([^<]*)</script>')


def scene_of(page: str) -> tuple[str, list[bytes]]:
    """Script and drawing commands of a page that `Viewer.html` returned."""
    match = _SCENE.search(page)
    assert match is not None, "this page holds no packed scene"
    return unpacked(match[1])


def unpacked(text: str) -> tuple[str, list[bytes]]:
    """Script and commands from the text of `packed`."""
    head, _, rest = zlib.decompress(base64.b64decode(text, validate=True)).partition(b"\n")
    index, pieces = json.loads(head), []
    for length in index["lengths"]:
        pieces.append(rest[:length])
        rest = rest[length:]
    return pieces[0].decode(), [b"".join(pieces[number] for number in numbers) for numbers in index["commands"]]
