"""XML documents with a comment at their head."""

from __future__ import annotations

import textwrap
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable

_WIDTH = 110


def document(root: ElementTree.Element, head: Iterable[str]) -> str:
    """Return a document as text, with paragraphs as a comment at its head."""
    ElementTree.indent(root)
    paragraphs = (textwrap.wrap(text.replace("--", "- -"), _WIDTH, break_long_words=False) for text in head)
    lines = "\n     ".join(line for paragraph in paragraphs for line in paragraph)
    return f'<?xml version="1.0" ?>\n<!-- {lines} -->\n{ElementTree.tostring(root, encoding="unicode")}\n'
