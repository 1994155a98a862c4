"""Facts of the arguments of a xacro file, from the comments before them, `Meaning [unit]. Source: source.`, by name."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import NamedTuple

from softrobots.core.xml_input import parse_xml, read_xml
from softrobots.description.expansion import XACRO_NAMESPACE


class ArgumentNote(NamedTuple):
    """Facts of an argument."""

    text: str
    """Meaning."""
    unit: str
    """Unit; "-" without one."""
    source: str
    """Where the default comes from."""


def argument_notes(xacro_file: str | Path) -> dict[str, ArgumentNote]:
    """Return the facts by name of the argument, in the order of the file; arguments without such a comment are omitted.

    Raises:
        DescriptionError: If the file does not exist or is not XML.
    """
    text = read_xml(Path(xacro_file))
    parse_xml(text, str(xacro_file))  # refuses malformed and hostile XML
    root = ElementTree.fromstring(text, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)))
    notes, comment = {}, ""
    for element in root:
        is_comment = not isinstance(element.tag, str)
        head, _, source = comment.partition(" Source: ")
        units = list(re.finditer(r" \[([^\[\]]+)\]", head))
        if element.tag == f"{{{XACRO_NAMESPACE}}}arg" and source and units:
            meaning = head[: units[-1].start()] + head[units[-1].end() :]
            notes[element.get("name", "")] = ArgumentNote(meaning.removesuffix("."), units[-1][1], source.removesuffix("."))
        comment = " ".join((element.text or "").split()) if is_comment else ""
    return notes
