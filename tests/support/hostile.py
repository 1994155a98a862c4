"""Hostile files: valid ones, damaged at random. Each damage is a function of bytes and a random generator.

Used by tests/test_hostile_*.py, a few cases each, and by scripts/fuzz_readers.py, many.
"""

from __future__ import annotations

import copy
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from softrobots.description.urdf_tags import NAMESPACE

Damage = Callable[[bytes, np.random.Generator], bytes]
"""What makes one damaged file of a valid one."""

HOSTILE_NUMBERS = (
    "1e309", "-1e309", "nan", "-nan", "NaN(1)", "inf", "-Infinity", "1,5", "0x10", "1e-320", "-0", "0", "-1", "", " ",
    "1e30", "1e31", "1e300", "-1e300", "1e-300", "9" * 400, "1_000", "\u0663", "1 2", "1 2 3", "--1", "1e", "+1", "1.0.0",
    "1d5", "true", "null", "4294967296", "-2147483649", "9223372036854775808", "1e999999999", "0." + "0" * 400 + "1",
    "\u22121",
)  # fmt: skip
"""Where a number is expected."""

HOSTILE_TEXTS = (
    "", " ", "a" * 5000, "../../etc/passwd", "/dev/zero", "\x00", "\ud7ff", "\u202e", "${1+1}", "$(arg x)", "%s%n", "a::b",
    "world", "universe", "root_joint", "file:///dev/zero", "package://", "package://a/../../b", "http://127.0.0.1:9/x.stl",
    "\U0001f600", "<a>", "&amp;", "]]>", "'", '"', "\\", "\n", "nul\tl", "__proto__",
)  # fmt: skip
"""Where a word is expected."""

HOSTILE_BYTES = (
    b"\x00", b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf", b"\x80", b"\xc0\xaf", b"\xed\xa0\x80", b"&#0;", b"&#x110000;",
    b"&lol;", b"<!DOCTYPE a>", b"<!--", b"-->", b"<![CDATA[", b"]]>", b"<?xml version='1.0'?>", b"<?a?>", b"<", b">", b"</",
    b"/>", b'"', b"'", b"{", b"[", b"[" * 2000, b'{"a":' * 2000, b"}", b"]", b",", b":", b"\n", b"\r", b"\t", b";", b"-",
    b"- ", b"&a", b"*a", b"!!python/none ",
)  # fmt: skip
"""Put anywhere into any file."""

for _prefix, _name in {
    "xacro": "http://www.ros.org/wiki/xacro",
    "softrobots": NAMESPACE,
    "drake": "http://drake.mit.edu",
    "": "http://www.collada.org/2005/11/COLLADASchema",
}.items():
    ElementTree.register_namespace(_prefix, _name)  # xacro knows its tags by their prefix

_DEEP = "deep"
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def damaged_bytes(data: bytes, rng: np.random.Generator) -> bytes:
    """Cut off, cut out, repeated, moved, flipped, or with something put in, or in another encoding."""
    some: Sequence[Damage] = (_cut_off, _cut_out, _repeat, _swap, _flip, _put_in, _other_number, _other_number, _encoded)
    return some[rng.integers(len(some))](data, rng)


def damaged_xml(data: bytes, rng: np.random.Generator) -> bytes:
    """A document with one to three elements or attributes gone, repeated, moved, renamed, nested, or with other values.

    One in four is damaged as bytes, too.
    """
    try:
        root = ElementTree.fromstring(data)
    except (ElementTree.ParseError, LookupError, ValueError):
        return damaged_bytes(data, rng)
    for _ in range(rng.integers(1, 4)):
        _TREE_DAMAGES[rng.integers(len(_TREE_DAMAGES))](root, rng)
    tag = _one(["a", *(element.tag for element in root.iter() if "}" not in element.tag)], rng).encode()
    depth = int(2.0 ** rng.uniform(0.0, 14.0))
    made = ElementTree.tostring(root, encoding="utf-8")
    made = made.replace(f"<{_DEEP} />".encode(), b"<%s>" % tag * depth + b"</%s>" % tag * depth)
    return damaged_bytes(made, rng) if rng.random() < 0.25 else made


def _span(data: bytes, rng: np.random.Generator) -> tuple[int, int]:
    """Start and end of a part, short ones more often than long ones."""
    start = int(rng.integers(len(data) + 1))
    return start, min(len(data), start + int(2.0 ** rng.uniform(0.0, 12.0)))


def _cut_off(data: bytes, rng: np.random.Generator) -> bytes:
    return data[: rng.integers(len(data) + 1)]


def _cut_out(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    return data[:start] + data[end:]


def _repeat(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    return data[:end] + data[start:end] * int(rng.integers(1, 20)) + data[end:]


def _swap(data: bytes, rng: np.random.Generator) -> bytes:
    start, end = _span(data, rng)
    at = int(rng.integers(len(data) + 1))
    rest = data[:start] + data[end:]
    return rest[:at] + data[start:end] + rest[at:]


def _flip(data: bytes, rng: np.random.Generator) -> bytes:
    made = bytearray(data)
    for _ in range(int(2.0 ** rng.uniform(0.0, 5.0)) if made else 0):
        made[rng.integers(len(made))] ^= 1 << int(rng.integers(8))
    return bytes(made)


def _put_in(data: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(data) + 1))
    return data[:at] + HOSTILE_BYTES[rng.integers(len(HOSTILE_BYTES))] + data[at:]


def _other_number(data: bytes, rng: np.random.Generator) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return _flip(data, rng)
    match = found[rng.integers(len(found))]
    return data[: match.start()] + _number(rng).encode() + data[match.end() :]


def _encoded(data: bytes, rng: np.random.Generator) -> bytes:
    text = data.decode("utf-8", "replace")
    names = ("utf-16", "utf-16-le", "utf-32", "utf-8-sig", "latin-1", "cp037", "utf-7")
    return text.encode(names[rng.integers(len(names))], "replace")


def _number(rng: np.random.Generator) -> str:
    if rng.random() < 0.5:
        return HOSTILE_NUMBERS[rng.integers(len(HOSTILE_NUMBERS))]
    return repr(float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-40.0, 40.0)))


def _elements(root: ElementTree.Element) -> list[ElementTree.Element]:
    return list(root.iter())


def _one(items: Sequence[Any], rng: np.random.Generator) -> Any:
    return items[rng.integers(len(items))]


def _with_children(root: ElementTree.Element, rng: np.random.Generator) -> ElementTree.Element:
    return _one([element for element in root.iter() if len(element)] or [root], rng)


def _delete(root: ElementTree.Element, rng: np.random.Generator) -> None:
    parent = _with_children(root, rng)
    if len(parent):
        parent.remove(_one(list(parent), rng))


def _duplicate(root: ElementTree.Element, rng: np.random.Generator) -> None:
    parent = _with_children(root, rng)
    if len(parent):
        parent.insert(int(rng.integers(len(parent) + 1)), copy.deepcopy(_one(list(parent), rng)))


def _move(root: ElementTree.Element, rng: np.random.Generator) -> None:
    parent = _with_children(root, rng)
    if len(parent):
        child = _one(list(parent), rng)
        parent.remove(child)
        new = _one(_elements(root), rng)
        new.insert(int(rng.integers(len(new) + 1)), child)


def _reverse(root: ElementTree.Element, rng: np.random.Generator) -> None:
    parent = _with_children(root, rng)
    parent[:] = list(parent)[::-1]


def _attributed(root: ElementTree.Element, rng: np.random.Generator) -> tuple[ElementTree.Element, str] | None:
    found = [(element, name) for element in root.iter() for name in element.attrib]
    return _one(found, rng) if found else None


def _swap_values(root: ElementTree.Element, rng: np.random.Generator) -> None:
    one, other = _attributed(root, rng), _attributed(root, rng)
    if one is not None and other is not None:
        (a, m), (b, n) = one, other
        a.attrib[m], b.attrib[n] = b.attrib[n], a.attrib[m]


def _hostile_value(root: ElementTree.Element, rng: np.random.Generator) -> None:
    """A hostile number in place of one of the numbers of an attribute or text, or a hostile word in place of a word."""
    texts = [element for element in root.iter() if (element.text or "").strip()]
    at = _attributed(root, rng)
    if at is None or (texts and rng.random() < 0.5):
        if not texts:
            return
        element = _one(texts, rng)
        element.text = _worse(element.text or "", rng)
    else:
        element, name = at
        element.attrib[name] = _worse(element.attrib[name], rng)


def _worse(value: str, rng: np.random.Generator) -> str:
    parts = value.split()
    if parts and _NUMBER.fullmatch(parts[0].encode("utf-8", "replace")):
        parts[rng.integers(len(parts))] = _number(rng)
        return " ".join(parts)
    word = HOSTILE_TEXTS[rng.integers(len(HOSTILE_TEXTS))]
    return "".join(letter for letter in word if letter != "\u0000")  # XML cannot say it


def _drop_attribute(root: ElementTree.Element, rng: np.random.Generator) -> None:
    at = _attributed(root, rng)
    if at is not None:
        del at[0].attrib[at[1]]


def _rename(root: ElementTree.Element, rng: np.random.Generator) -> None:
    element = _one(_elements(root), rng)
    element.tag = _one(_elements(root), rng).tag


def _same_name(root: ElementTree.Element, rng: np.random.Generator) -> None:
    """A name of the document for something that has another: twice the same, a cycle, or a stranger."""
    names = [
        (element, key) for element in root.iter() for key in element.attrib if key in ("name", "link", "joint", "body", "ref")
    ]
    if names:
        (a, m), (b, n) = _one(names, rng), _one(names, rng)
        a.attrib[m] = b.attrib[n]


def _nest(root: ElementTree.Element, rng: np.random.Generator) -> None:
    """A place for thousands of elements within each other; `damaged_xml` puts them there, since writing a tree is recursive."""
    ElementTree.SubElement(_with_children(root, rng), _DEEP)


def _many(root: ElementTree.Element, rng: np.random.Generator) -> None:
    parent = _with_children(root, rng)
    if len(parent):
        child = _one(list(parent), rng)
        numbered = rng.random() < 0.7
        for number in range(int(2.0 ** rng.uniform(0.0, 9.0))):
            twin = copy.deepcopy(child)
            if numbered and "name" in twin.attrib:
                twin.set("name", f"{twin.get('name')}_{number}")
            parent.append(twin)


_TREE_DAMAGES: Sequence[Callable[[ElementTree.Element, np.random.Generator], None]] = (
    _delete, _duplicate, _move, _reverse, _swap_values, _hostile_value, _hostile_value, _hostile_value, _hostile_value,
    _drop_attribute, _rename, _same_name, _same_name, _nest, _many,
)  # fmt: skip
