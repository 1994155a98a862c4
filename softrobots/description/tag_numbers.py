"""Numbers in the attributes of the tags of this package, refused by name where they are none."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ElementTree

from softrobots.core.checks import LARGEST
from softrobots.core.errors import DescriptionError
from softrobots.core.xml_input import number_in

_MOST_NUMBERS = 1000  # in one attribute


def positive(element: ElementTree.Element, attribute: str, where: str) -> float:
    """Return a positive number; `where` names the tag in the error.

    Raises:
        DescriptionError: If the attribute is missing or no positive number.
    """
    value = number(element, attribute, where)
    if value < 1.0 / LARGEST:
        raise DescriptionError(f"{where} has {attribute} {value}; a positive number is required")
    return value


def number(element: ElementTree.Element, attribute: str, where: str) -> float:
    """Return a finite number; `where` names the tag in the error.

    Raises:
        DescriptionError: If the attribute is missing or no finite number.
    """
    text = element.get(attribute)
    value = number_in(text)
    if math.isnan(value):
        shown = text if text is None else text[:100]
        raise DescriptionError(f"{where} has {attribute} = {shown!r}; a finite number is required, at most {LARGEST:g} in size")
    return value


def numbers(element: ElementTree.Element, attribute: str, where: str) -> tuple[float, ...]:
    """Return two or more finite numbers, separated by blanks.

    Raises:
        DescriptionError: If the attribute is missing or holds anything else.
    """
    words = element.get(attribute, "").split()
    values = tuple(number_in(word) for word in words[: _MOST_NUMBERS + 1])
    if not 2 <= len(values) <= _MOST_NUMBERS or any(map(math.isnan, values)):
        raise DescriptionError(
            f"{where} has {attribute} = {element.get(attribute, '')[:100]!r}; 2 to {_MOST_NUMBERS} finite numbers are required"
        )
    return values


def segment_number(element: ElementTree.Element, where: str) -> int:
    """Return the number of the segment of a tag.

    Raises:
        DescriptionError: If it is no number from 1.
    """
    text = element.get("segment", "")
    if not text.isascii() or not text.isdigit() or not 0 < int(text) < 10_000:
        raise DescriptionError(f"{where} has segment = {text!r}; a number from 1 is required")
    return int(text)


def described(element: ElementTree.Element, kind: str, source: str) -> str:
    """Return the words that name a tag in errors."""
    return f"the {kind} {element.get('name', '')!r} of {source}"
