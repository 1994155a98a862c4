"""The drawing commands of a meshcat page as one packed text: reproducible, and a third of the size.

Meshcat's own pages hold one base64 text for each command, with random object names that reveal time and machine. Here objects
are renumbered, numbers rounded, repeated arrays shared, and everything deflated together with the script of the page; the
browser unpacks it.
"""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Sequence
from typing import Any

from softrobots.core.errors import ViewerError

RESOLUTION = 2.0**-18
"""Numbers on a page are multiples of this: of lengths it is 4 um, of directions 4 urad."""

_COMMAND = re.compile(r'fetch\("data:application/octet-binary;base64,([^"]+)"\)')
_SCRIPT = re.compile(r"<script>\s*(/\*!.*?)</script>", re.DOTALL)
_UUID = re.compile(rb"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}")
_FLOATS = 0x17  # meshcat's number of the extension type of msgpack that holds numbers of 32 bits
_HEAD = re.compile(rb"(?:\xc8(..)|\xc9(....))[\x12-\x17]", re.DOTALL)  # of an array of meshcat's, with its length in bytes
_REPEATED = 256  # bytes of an array from which it is looked for among the others


def read_page(static: str) -> tuple[str, list[bytes]]:
    """Return the script and the commands, each in msgpack, of a page of meshcat's `static_html`.

    Raises:
        ViewerError: If there is no script or no command, as from another version of meshcat.
    """
    script, commands = _SCRIPT.search(static), [base64.b64decode(text) for text in _COMMAND.findall(static)]
    if script is None or not commands:
        raise ViewerError("the page of meshcat holds no script or no commands where meshcat 0.3.2 puts them")
    return script[1].strip(), commands


def tidied(commands: Sequence[bytes]) -> list[bytes]:
    """Return the commands independent of time and machine.

    Objects are numbered instead of named at random, numbers are multiples of `RESOLUTION` (which removes differences in the
    last bits between machines), and the animation comes after the objects that it moves.
    """
    import umsgpack

    names: dict[bytes, bytes] = {}

    def number(match: re.Match[bytes]) -> bytes:
        return names.setdefault(match[0], b"00000000-0000-0000-0000-%012x" % len(names))

    drawn: list[bytes] = []
    played: list[bytes] = []
    for command in commands:
        decoded = _rounded(umsgpack.unpackb(command))
        text = _UUID.sub(number, umsgpack.packb(decoded, force_float_precision="single"))
        (played if decoded["type"] == "set_animation" else drawn).append(text)
    return drawn + played


def packed(script: str, commands: Sequence[bytes]) -> str:
    """Pack a script and commands into one line of base64.

    It holds, deflated, a line of JSON (lengths of all pieces, and the pieces of each command), then the pieces, of which the
    first is the script. Arrays that several commands share, such as corners of triangles, are one piece.
    """
    pieces: dict[bytes, int] = {script.encode(): 0}
    numbered = [[pieces.setdefault(part, len(pieces)) for part in _parts(command)] for command in commands]
    head = json.dumps({"lengths": [len(piece) for piece in pieces], "commands": numbered}, separators=(",", ":"))
    return base64.b64encode(zlib.compress(head.encode() + b"\n" + b"".join(pieces), 9)).decode()


def _rounded(value: Any) -> Any:
    """Decoded msgpack with its numbers rounded, also those in arrays."""
    import numpy as np
    import umsgpack

    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(part) for part in value]
    if isinstance(value, float):
        return round(value / RESOLUTION) * RESOLUTION + 0.0  # no negative zero
    if isinstance(value, umsgpack.Ext) and value.type == _FLOATS:
        numbers = np.frombuffer(value.data, dtype="<f4").astype(np.float64)
        return umsgpack.Ext(_FLOATS, (np.rint(numbers / RESOLUTION) * RESOLUTION + 0.0).astype("<f4").tobytes())
    return value


def _parts(command: bytes) -> list[bytes]:
    """A command split around its large arrays, which are found by their heads; joined, the parts are the command."""
    parts, begin, place = [], 0, 0
    while head := _HEAD.search(command, place):
        start = place = head.end()
        stop = start + int.from_bytes(head[1] or head[2], "big")
        if start + _REPEATED <= stop <= len(command):
            parts += [command[begin:start], command[start:stop]]
            begin = place = stop
    return [part for part in (*parts, command[begin:]) if part]
