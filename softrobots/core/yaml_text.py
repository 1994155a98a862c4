"""YAML of plain values, as it is read from untrusted files, and written.

Unquoted words have their meaning in YAML 1.2: `1e3` is a number, `010` is ten and `no` is a word (in YAML 1.1: a word, eight,
a truth value). Tags, anchors and aliases are refused, so that a file can neither construct objects nor grow when read.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from collections.abc import Iterator
from typing import Any

import yaml

from softrobots.core.errors import FileFormatError

_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_MEANINGS = {word: meaning for text, meaning in (("true", True), ("false", False), ("null", None))
             for word in (text, text.capitalize(), text.upper())} | {"~": None, "": None}  # fmt: skip
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_WORDS_1_1 = {"y", "n", "yes", "no", "on", "off"}  # truth values in YAML 1.1


def yaml_of(value: Any) -> str:
    """Return a value as text, in one line, that YAML 1.1 and 1.2 read alike."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {yaml_of(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(yaml_of, value)) + "]"
    if isinstance(value, float):
        text = repr(float(value))
        return text if "." in text else text.replace("e", ".0e")  # 1e-05 is a word in YAML 1.1
    if value is None or isinstance(value, bool | int):
        return json.dumps(value)
    if _PLAIN.fullmatch(value) and value.lower() not in _WORDS_1_1 | {word.lower() for word in _MEANINGS}:
        return str(value)
    return '"' + "".join(c if " " <= c <= "~" and c not in '"\\' else f"\\U{ord(c):08x}" for c in value) + '"'


def parse_yaml(text: str, *, deepest: int = 4, most: int = 5000) -> Any:
    """Return the value of a YAML text, from the events of PyYAML's parser; reading ends at the first event that is refused.

    Args:
        text: The text.
        deepest: Most lists and mappings inside one another.
        most: Most names and values.

    Raises:
        FileFormatError: If the text is no YAML of one document, has a tag, an anchor, a name twice or a number that is not
            finite, or exceeds a limit; with the line.
    """
    try:
        events = yaml.parse(text, Loader=yaml.SafeLoader)
        document = (event for event in events if not isinstance(event, yaml.StreamStartEvent | yaml.DocumentStartEvent))
        first = next(document)
        value = None if isinstance(first, yaml.StreamEndEvent) else _value(first, document, _Limits(deepest, most))
        second_document = next((event for event in events if isinstance(event, yaml.DocumentStartEvent)), None)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise FileFormatError(f"{'' if mark is None else f'line {mark.line + 1}: '}{error.problem}") from error
    except yaml.YAMLError as error:
        raise FileFormatError(f"it is no YAML: {' '.join(str(error).split())}") from error
    if second_document is not None:
        raise FileFormatError(f"line {second_document.start_mark.line + 1}: one document is required")
    return value


class _Limits:
    """What is read at most, and how many values have been."""

    def __init__(self, deepest: int, most: int) -> None:
        self.deepest, self.most, self.counter = deepest, most, itertools.count(1)


def _value(event: Any, events: Iterator[Any], limits: _Limits, depth: int = 0) -> Any:
    """Value of the node that begins with an event; takes the other events of the node."""
    where = f"line {event.start_mark.line + 1}: "
    if next(limits.counter) > limits.most:
        raise FileFormatError(f"{where}at most {limits.most} names and values are read")
    if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
        raise FileFormatError(f"{where}no anchors (&) and aliases (*) are read")
    if event.tag is not None:
        raise FileFormatError(f"{where}no tags (!) are read")
    if isinstance(event, yaml.ScalarEvent):
        return event.value if event.style else _meaning(event.value, where)
    if depth == limits.deepest:
        raise FileFormatError(f"{where}lists or mappings are nested more than {limits.deepest} deep")
    if isinstance(event, yaml.SequenceStartEvent):
        items = itertools.takewhile(lambda item: not isinstance(item, yaml.SequenceEndEvent), events)
        return [_value(item, events, limits, depth + 1) for item in items]
    mapping: dict[str, Any] = {}
    while not isinstance(key := next(events), yaml.MappingEndEvent):
        where = f"line {key.start_mark.line + 1}: "
        _value(key, events, limits, depth + 1)  # refuses tags and anchors
        name = getattr(key, "value", None)
        if not name:
            raise FileFormatError(f"{where}a name is required before the colon")
        if name in mapping:
            raise FileFormatError(f"{where}{name[:60]} is there twice")
        mapping[name] = _value(next(events), events, limits, depth + 1)
    return mapping


def _meaning(word: str, where: str) -> Any:
    """Value of a word without quotes."""
    if word in _MEANINGS:
        return _MEANINGS[word]
    if _INTEGER.fullmatch(word):
        return int(word)
    if _NUMBER.fullmatch(word) and not math.isfinite(float(word)):
        raise FileFormatError(f"{where}{word[:60]} is no finite number")
    return float(word) if _NUMBER.fullmatch(word) else word
