"""Elements of a xacro file while xacro expands it: `xml.dom.minidom` in linear time, and what is parsed only once."""

from __future__ import annotations

import itertools
from functools import lru_cache
from typing import Any, NamedTuple
from xml.dom import minidom

from softrobots.core.xml_input import parse_xml


@lru_cache(maxsize=64)
def parsed(text: str, file: str) -> minidom.Document:
    """Return the document of a text; what is done to it would stay, so work on copies of its nodes."""
    parse_xml(text, file)
    document = minidom.parseString(text)
    element: Any
    for element in document.getElementsByTagName("*"):
        element.__class__, element.texts = _Element, dict(element.attributes.items())
    return document


class _Attribute(NamedTuple):
    value: str


class _Attributes:
    """What xacro asks of the attributes of an element."""

    def __init__(self, texts: dict[str, str]) -> None:
        self._texts = texts
        self.keys = texts.keys

    def items(self) -> list[tuple[str, str]]:
        return list(self._texts.items())

    def __getitem__(self, name: str) -> _Attribute:
        return _Attribute(self._texts[name])


class _Element(minidom.Element):
    """Element whose attributes are texts; minidom makes two nodes of each, which takes half of the time of an expansion."""

    texts: dict[str, str]
    """Attributes by name."""

    def _get_attributes(self) -> _Attributes:
        return _Attributes(self.texts)

    attributes = property(_get_attributes)

    def getAttribute(self, attname: str) -> str:
        return self.texts.get(attname, "")

    def getAttributeNode(self, attrname: str) -> _Attribute | None:  # type: ignore[override]
        return _Attribute(self.texts[attrname]) if attrname in self.texts else None

    def hasAttribute(self, name: str) -> bool:
        return name in self.texts

    def setAttribute(self, attname: str, value: str) -> None:
        self.texts[attname] = value

    def removeAttribute(self, name: str) -> None:
        self.texts.pop(name, None)

    def cloneNode(self, deep: bool) -> _Element:
        copy = _Element(self.tagName)
        copy.ownerDocument, copy.texts = self.ownerDocument, dict(self.texts)
        child: Any
        new: Any
        last: Any = None
        for child in self.childNodes if deep else ():
            if child.nodeType == self.TEXT_NODE:
                new, new.data, new.ownerDocument = minidom.Text(), child.data, self.ownerDocument
            else:
                new = child.cloneNode(deep)
            new.parentNode, new.previousSibling = copy, last
            if last is not None:
                last.nextSibling = new
            copy.childNodes.append(new)
            last = new
        return copy


def replace_node(node: Any, by: Any, content_only: bool = False) -> None:
    """Replace a node by others, or by what they contain; xacro's own function searches the siblings for every one of them."""
    nodes = []
    for source in by if isinstance(by, list) else [by] if by is not None else []:
        if content_only:
            nodes += source.childNodes
            del source.childNodes[:]
        else:
            if source.parentNode is not None:
                source.parentNode.removeChild(source)
            nodes.append(source)
    siblings = node.parentNode.childNodes
    place = siblings.index(node)
    row = [node.previousSibling, *nodes, node.nextSibling]
    for left, right in itertools.pairwise(row):
        if left is not None:
            left.nextSibling = right
        if right is not None:
            right.previousSibling = left
    for new in nodes:
        new.parentNode = node.parentNode
    siblings[place : place + 1] = nodes
    node.parentNode = node.previousSibling = node.nextSibling = None
