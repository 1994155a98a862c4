"""Checks of COLLADA files (.dae) before Assimp, Pinocchio's mesh reader, opens them.

Assimp trusts the references inside such a file: corners without positions end the process (Assimp 5, through Coal 3.0), and a
malformed count or index is read as one that exhausts the memory. Found by scripts/fuzz_readers.py.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from pathlib import Path

from softrobots.core.bounded_reading import read_bytes
from softrobots.core.errors import FileFormatError

LARGEST_FILE = 50_000_000
"""Largest size of a COLLADA file [bytes]; the largest among known robots has 29 million."""
DEEPEST = 100
"""Deepest nesting of elements."""
MOST_COUNT = 100_000_000
"""Largest count, stride or offset."""

_WHOLE = re.compile(r"[\s\d]*", re.ASCII)
_REAL = re.compile(r"[\s\d.eE+-]*", re.ASCII)
_COUNTS = ("count", "stride", "offset", "set")
_UNIQUE = ("geometry", "mesh", "source", "vertices", "float_array")  # nodes of cameras and lights are called the same
_NAMED = re.compile(r"\{[^}]*\}")


def collada_problem(file: Path) -> str:
    """Return why a COLLADA file is not safe to read; empty if it is."""
    try:
        data = read_bytes(file, LARGEST_FILE)
        if b"<!DOCTYPE" in data or b"<!ENTITY" in data or b"\0" in data:  # NUL: also UTF-16
            return "declares a document type or is not in UTF-8"
        root = ElementTree.fromstring(data)
    except (FileFormatError, ElementTree.ParseError, LookupError, ValueError) as error:
        return str(error)
    return next(_problems(root), "")


def _problems(root: ElementTree.Element) -> Iterator[str]:
    level, depth = [root], 0
    named: dict[str, ElementTree.Element] = {}
    while level:
        depth += 1
        if depth > DEEPEST:
            yield f"has elements more than {DEEPEST} deep within each other"
        for element in level:
            element.tag = _NAMED.sub("", str(element.tag))
            name = element.get("id")
            if name is not None:
                if name in named and element.tag in _UNIQUE:
                    yield f"has two elements with the id {name[:100]!r}"
                named[name] = element
            yield from _number_problems(element)
        level = [child for element in level for child in element]
    for element in root.iter():
        yield from _reference_problems(element, named)
    yield from _circles(root)


def _number_problems(element: ElementTree.Element) -> Iterator[str]:
    for name in _COUNTS:
        text = element.get(name)
        if text is not None and not (text.isascii() and text.isdigit() and len(text) < 10 and int(text) <= MOST_COUNT):
            yield f"has {name} = {text[:100]!r} in <{element.tag}>"
    if element.tag in ("p", "vcount", "v", "h") and not _WHOLE.fullmatch(element.text or ""):
        yield f"has <{element.tag}> with text other than whole numbers"
    if element.tag == "float_array":
        text = element.text or ""
        if not _REAL.fullmatch(text) or len(text.split()) != int(element.get("count", "-1")):
            yield "has a <float_array> with another count of numbers than it declares"


def _reference_problems(element: ElementTree.Element, named: Mapping[str, ElementTree.Element]) -> Iterator[str]:
    for name in ("source", "url", "target"):
        text = element.get(name)
        if text is not None and text.startswith("#") and text[1:] not in named:
            yield f"has {name} = {text[:100]!r}, which does not exist"
    if element.tag == "vertices":
        inputs = [inner for inner in element.findall("input") if inner.get("semantic") == "POSITION"]
        sources = [named.get(inner.get("source", "")[1:]) for inner in inputs]
        if len(sources) != 1 or sources[0] is None or sources[0].find("technique_common/accessor") is None:
            yield "has <vertices> without positions"
    if element.tag == "accessor":
        array = named.get(element.get("source", "")[1:])
        last = int(element.get("offset", "0")) + int(element.get("count", "0")) * int(element.get("stride", "1"))
        if array is None or last > int(array.get("count", "0")):
            yield "has an <accessor> beyond the end of its array"
    if element.tag in ("triangles", "polylist", "polygons", "lines", "linestrips", "trifans", "tristrips"):
        corners = [
            named.get(inner.get("source", "")[1:]) for inner in element.findall("input") if inner.get("semantic") == "VERTEX"
        ]
        if len(corners) != 1 or corners[0] is None or corners[0].tag != "vertices":
            yield f"has <{element.tag}> without corners"


def _circles(root: ElementTree.Element) -> Iterator[str]:
    """Nodes that contain themselves, or instances that multiply without bound."""
    by_id: dict[str, list[ElementTree.Element]] = {}
    for node in root.iter("node"):
        by_id.setdefault(node.get("id", ""), []).append(node)
    inside = {
        node: [inner for instance in node.iter("instance_node") for inner in by_id.get(instance.get("url", "")[1:], ())]
        for node in root.iter("node")
    }
    level, steps = list(inside), 0
    for _ in range(DEEPEST):
        level = [inner for element in level for inner in inside.get(element, ())]
        steps += len(level)
        if not level:
            return
        if steps > 100_000:
            break
    yield "has nodes that contain each other in a circle"
