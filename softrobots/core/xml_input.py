"""XML of other people: the one door that it comes through, before any parser of a library sees it.

Libraries trust what they read. Measured: Pinocchio's parser ends the process at a chain of 4000 links, for each of which it
calls itself, and takes 20 s for an element with 100000 attributes; expat expands entities. So a document is looked at here
first, and what no robot needs is refused. The largest description among 1200 that we know has 6000 tags and 0.2 MB.
"""

from __future__ import annotations

import codecs
import math
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

from softrobots.core.bounded_reading import read_bytes
from softrobots.core.checks import LARGEST
from softrobots.core.errors import DescriptionError, FileFormatError

LARGEST_FILE = 10_000_000
"""Bytes, or characters, that a description may have."""
MOST_TAGS = 40_000
"""Tags and comments that it may have."""
MOST_ATTRIBUTES = 100
"""Attributes that one element may have."""
DEEPEST = 400
"""Elements that may be within each other. MJCF nests a body for every joint; Python's own serialiser calls itself for each."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before that of UTF-16, which it begins with
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_CODECS = ("utf-8", "utf8", "us-ascii", "ascii", "iso-8859-1", "latin-1", "iso-8859-15", "windows-1252")
_HEAD = re.compile(r"""(<\?xml\s[^<>]{0,200}?\bencoding\s{0,9}=\s{0,9})(?:"([^"<>]{0,40})"|'([^'<>]{0,40})')""")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


def read_xml(path: Path) -> str:
    """Read the text of a file: UTF-8, what its first bytes or its declaration say, but not every encoding that there is.

    Args:
        path: The file.

    Returns:
        The text; an encoding that it declares is UTF-8.

    Raises:
        DescriptionError: If the file cannot be read, is too large, or is in another encoding than it says or than are known.
    """
    try:
        data = read_bytes(path, LARGEST_FILE)
    except FileFormatError as error:
        reason = str(error).removeprefix(f"cannot read {path}: ")
        raise DescriptionError(f"cannot read {str(path)[:200]!r}: {reason[:300]}") from error
    codec = next((name for mark, name in _MARKS if data.startswith(mark)), None)
    if codec is None:
        said = _HEAD.match(data[:400].decode("ascii", "replace"))
        codec = "utf-8" if said is None else (said[2] or said[3] or "").lower()
        if codec not in _CODECS:
            raise DescriptionError(f"{path} declares the encoding {codec!r}; one of {', '.join(_CODECS)} is required")
    try:
        return as_unicode(data.decode(codec))
    except UnicodeDecodeError as error:
        raise DescriptionError(f"cannot read {str(path)[:200]!r}: {error}") from error


def as_unicode(text: str) -> str:
    """Take byte order marks and blanks off the front of a text, and let it declare UTF-8 if it declares an encoding.

    What was said of the bytes that it was read from no longer holds, and parsers would believe it.
    """
    text = text.lstrip("\ufeff \t\r\n")
    said = _HEAD.match(text)
    return text if said is None else f'{said[1]}"utf-8"{text[said.end() :]}'


def parse_xml(text: str, source: str) -> ElementTree.Element:
    """Parse XML text and return its root element.

    Document types and entities are refused: no robot description needs them, and expanding them can exhaust memory or read
    other files.

    Args:
        text: The document.
        source: Where it comes from, for the error.

    Returns:
        The root element.

    Raises:
        DescriptionError: If the text is not well-formed XML, declares a document type, or is larger or nested deeper than any
            description of a robot: see `LARGEST_FILE`, `MOST_TAGS`, `MOST_ATTRIBUTES` and `DEEPEST`.
    """
    for what, count, most in (
        ("characters", len(text), LARGEST_FILE),
        ("tags", text.count("<"), MOST_TAGS),
        ("equals signs", text.count("="), 10 * MOST_TAGS),
    ):
        if count > most:
            raise DescriptionError(f"{source} has {count} {what}; at most {most} are read")
    if "\0" in text:
        raise DescriptionError(f"{source} is not well-formed XML: it has NUL characters, as UTF-16 without a mark would")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DescriptionError(f"{source} declares a document type or entities; plain XML is required")
    try:
        root = ElementTree.fromstring(text.encode("utf-8"), ElementTree.XMLParser(encoding="utf-8"))
    except (ElementTree.ParseError, UnicodeEncodeError, ValueError) as error:
        raise DescriptionError(f"{source} is not well-formed XML: {error}") from error
    level, depth = [root], 1
    while level:
        if depth > DEEPEST:
            raise DescriptionError(f"{source} has elements more than {DEEPEST} deep within each other")
        crowded = next((element for element in level if len(element.keys()) > MOST_ATTRIBUTES), None)
        if crowded is not None:
            raise DescriptionError(f"{source} has an element <{crowded.tag}> with more than {MOST_ATTRIBUTES} attributes")
        level, depth = [child for element in level for child in element], depth + 1
    return root


def number_in(text: str | None, most: float = LARGEST) -> float:
    """A number as XML files spell it, NaN if it is none.

    Args:
        text: Decimal digits, with point and exponent if need be; not `1_000`, `0x10`, `inf` or digits of other scripts, which
            some parsers take and others do not.
        most: How large it may be, either way.

    Returns:
        The number; NaN, too, if it is infinite or larger.
    """
    stripped = (text or "").strip()
    if len(stripped) > 400 or not _NUMBER.fullmatch(stripped):
        return math.nan
    value = float(stripped)
    return value if abs(value) <= most and math.isfinite(value) else math.nan
