"""Check and parse untrusted XML before any other parser reads it.

Other parsers trust their input. Measured: Pinocchio's crashes at a chain of 4000 links, because it recurses for each of them,
and takes 20 s for an element with 100000 attributes; expat expands entities. So documents are checked here first, and what no
robot needs is refused. The largest of 1200 robot descriptions examined has 6000 tags and 0.2 MB.
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
"""Maximum number of bytes, or characters, of a description."""
MOST_TAGS = 40_000
"""Maximum number of tags and comments."""
MOST_ATTRIBUTES = 100
"""Maximum number of attributes of one element."""
DEEPEST = 400
"""Maximum nesting depth. MJCF nests a body for every joint, and Python's own serialiser recurses for each."""

_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before the mark of UTF-16, with which it starts
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_CODECS = ("utf-8", "utf8", "us-ascii", "ascii", "iso-8859-1", "latin-1", "iso-8859-15", "windows-1252")
_HEAD = re.compile(r"""(<\?xml\s[^<>]{0,200}?\bencoding\s{0,9}=\s{0,9})(?:"([^"<>]{0,40})"|'([^'<>]{0,40})')""")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)


def read_xml(path: Path) -> str:
    """Read the text of an XML file in the encoding of its byte order mark or declaration; UTF-8 by default.

    A declared encoding is changed to UTF-8.

    Raises:
        DescriptionError: If the file cannot be read, is too large, declares another than the usual encodings, or is not in the
            encoding that it declares.
    """
    try:
        data = read_bytes(path, LARGEST_FILE)
    except FileFormatError as error:
        reason = str(error).removeprefix(f"cannot read {path}: ")
        raise DescriptionError(f"cannot read {str(path)[:200]!r}: {reason[:300]}") from error
    codec = next((name for mark, name in _MARKS if data.startswith(mark)), None)
    if codec is None:
        declaration = _HEAD.match(data[:400].decode("ascii", "replace"))
        codec = "utf-8" if declaration is None else (declaration[2] or declaration[3] or "").lower()
        if codec not in _CODECS:
            raise DescriptionError(f"{path} declares the encoding {codec!r}; one of {', '.join(_CODECS)} is required")
    try:
        return as_unicode(data.decode(codec))
    except UnicodeDecodeError as error:
        raise DescriptionError(f"cannot read {str(path)[:200]!r}: {error}") from error


def as_unicode(text: str) -> str:
    """Return decoded XML without leading byte order marks and blanks, and with UTF-8 as its declared encoding, if any.

    A declared encoding of the original bytes no longer holds, and parsers would apply it.
    """
    text = text.lstrip("\ufeff \t\r\n")
    declaration = _HEAD.match(text)
    return text if declaration is None else f'{declaration[1]}"utf-8"{text[declaration.end() :]}'


def parse_xml(text: str, source: str) -> ElementTree.Element:
    """Parse XML text and return its root element; `source` names it in errors.

    Document types and entities are refused: no robot description needs them, and expanding them can exhaust memory or read
    other files.

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
        raise DescriptionError(f"{source} is not well-formed XML: it has NUL characters, like UTF-16 without a byte order mark")
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise DescriptionError(f"{source} declares a document type or entities; plain XML is required")
    try:
        root = ElementTree.fromstring(text.encode("utf-8"), ElementTree.XMLParser(encoding="utf-8"))
    except (ElementTree.ParseError, UnicodeEncodeError, ValueError) as error:
        raise DescriptionError(f"{source} is not well-formed XML: {error}") from error
    level, depth = [root], 1
    while level:
        if depth > DEEPEST:
            raise DescriptionError(f"{source} has elements nested more than {DEEPEST} deep")
        crowded = next((element for element in level if len(element.keys()) > MOST_ATTRIBUTES), None)
        if crowded is not None:
            raise DescriptionError(f"{source} has an element <{crowded.tag}> with more than {MOST_ATTRIBUTES} attributes")
        level, depth = [child for element in level for child in element], depth + 1
    return root


def number_in(text: str | None, most: float = LARGEST) -> float:
    """Parse a decimal number in XML, NaN if it is not one or larger in size than `most`.

    `1_000`, `0x10`, `inf` and digits of other scripts, which only some parsers accept, are not.
    """
    stripped = (text or "").strip()
    if len(stripped) > 400 or not _NUMBER.fullmatch(stripped):
        return math.nan
    value = float(stripped)
    return value if abs(value) <= most and math.isfinite(value) else math.nan
