"""What the arguments of a xacro file mean: the comment before each, `What it is [unit]. Source: where it is from`."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import NamedTuple

from softrobots.core.xml_input import parse_xml, read_xml
from softrobots.description.expansion import XACRO_NAMESPACE


class ArgumentNote(NamedTuple):
    """What is written about an argument."""

    text: str
    """What it is."""
    unit: str
    """Its unit; "-" without one."""
    source: str
    """Where its default is from."""


def argument_notes(xacro_file: str | Path) -> dict[str, ArgumentNote]:
    """Read the comments before the arguments of a xacro file.

    Args:
        xacro_file: Path of the file.

    Returns:
        Note by name, in the order of the file; arguments without a comment of that form are left out.

    Raises:
        DescriptionError: If the file does not exist or is not XML.
    """
    text = read_xml(Path(xacro_file))
    parse_xml(text, str(xacro_file))  # refuses what is no XML
    root = ElementTree.fromstring(text, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True)))
    notes, comment = {}, ""
    for element in root:
        if not isinstance(element.tag, str):  # a comment
            comment = " ".join((element.text or "").split())
            continue
        note = _note(comment)
        if element.tag == f"{{{XACRO_NAMESPACE}}}arg" and note is not None:
            notes[element.get("name", "")] = note
        comment = ""
    return notes


def _note(comment: str) -> ArgumentNote | None:
    head, _, source = comment.partition(" Source: ")
    units = list(re.finditer(r" \[([^\[\]]+)\]", head))
    if not source or not units:
        return None
    unit = units[-1]
    text = head[: unit.start()] + head[unit.end() :]
    return ArgumentNote(text.removesuffix("."), unit[1], source.removesuffix("."))
