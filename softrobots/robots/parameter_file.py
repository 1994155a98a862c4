"""Files of robot parameters: YAML, or JSON if the name ends with `.json`.

One mapping from the names of parameters to numbers, words, truth values, `null`, or lists of those; `robot:` may name the robot
that they are for. A route of an actuator is a mapping in a list:

    robot: pcc_arm
    segment_lengths: [0.5, 0.4]  # m
    bending_stiffness: 1.5e0     # N m^2
    kind: tension
    routing: [{at: [0.0, 0.9], azimuth: [0.0, 3.14], distance: 0.04}]

Unquoted words have their meaning in YAML 1.2: `1e3` is a number, `010` is ten and `no` is a word (in YAML 1.1: a word, eight,
a truth value). Tags, anchors and aliases are refused, so that a file can neither construct objects nor grow when read.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import yaml

from softrobots.core.bounded_reading import read_text
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.files import as_path, write_text
from softrobots.core.json_text import parse_json
from softrobots.robots import ROBOTS, Route, XacroRobot, robot_class

LARGEST_FILE = 100_000
"""Largest size of a file [bytes]."""

MOST_VALUES = 5000
"""Most names and values in a file."""

_DEEPEST = 4  # the mapping, a list with a value for each part, a list or mapping that is the value of a part, a list in that
_LARGEST_NUMBER = 1e300
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_MEANINGS = {word: meaning for text, meaning in (("true", True), ("false", False), ("null", None))
             for word in (text, text.capitalize(), text.upper())} | {"~": None, "": None}  # fmt: skip
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_WORDS_1_1 = {"y", "n", "yes", "no", "on", "off"}  # truth values in YAML 1.1


class ParameterFile(NamedTuple):
    """Content of a file."""

    robot: str | None
    """The robot that it is for; None if the file does not name one."""
    values: dict[str, Any]
    """Parameters by name; lists are tuples."""


def read_parameters(path: str | os.PathLike[str]) -> ParameterFile:
    """Read parameters from a file, without checking that the robot exists and accepts them.

    Args:
        path: The file, in UTF-8; JSON if its name ends with `.json`, else YAML.

    Raises:
        ParameterError: If `path` is no path.
        FileFormatError: If the file cannot be read, is too large, or (with the line, for YAML) is no mapping of names to
            numbers, words, truth values, null, and lists of those or of mappings; has a name twice, a tag, an anchor, or a
            number that is not finite.
    """
    file = as_path("path", path)
    text = read_text(file, LARGEST_FILE)
    try:
        content = parse_json(text) if file.suffix.lower() == ".json" else parse_yaml(text)
        if not isinstance(content, dict) or not content:
            raise FileFormatError("a mapping with a line NAME: VALUE for each parameter is required")
        values = {name: _checked(name, value) for name, value in content.items()}
        robot = values.pop("robot", None)
        if robot is not None and not isinstance(robot, str):
            raise FileFormatError("robot: the name of a robot is required")
    except FileFormatError as error:
        raise FileFormatError(f"cannot read parameters from {file}: {error}") from error
    return ParameterFile(robot, values)


def read_robot(path: str | os.PathLike[str], robot: str | None = None) -> XacroRobot:
    """Return a robot with the parameters of a file.

    Args:
        path: The file.
        robot: Name of the robot in `ROBOTS`; by default the one that the file names.

    Raises:
        ParameterError: If `path` is no path, the file is for another robot or names none, or the robot refuses a value.
        FileFormatError: If the file cannot be read or holds something else.
        NameNotFound: If there is no such robot or parameter.
        SelfIntersection: If a helical tube would run into itself.
    """
    owner, values = read_parameters(path)
    name = robot if robot is not None else owner
    if name is None:
        raise ParameterError("robot", robot, f"given here or in the file: {', '.join(ROBOTS)}")
    if owner not in (None, name):
        raise ParameterError("robot", robot, f"{owner}, for which the file is")
    names = [field.name for field in dataclasses.fields(robot_class(name)[0])]
    unknown = next((parameter for parameter in values if parameter not in names), None)
    if unknown is not None:
        raise NameNotFound(f"parameter of {name}", unknown, names)
    return ROBOTS[name](**values)


def write_parameters(
    path: str | os.PathLike[str],
    robot: str,
    values: Mapping[str, Any],
    *,
    units: Mapping[str, str] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write parameters to a file that `read_parameters`, and any reader of YAML 1.1 or 1.2, reads without loss of digits.

    Args:
        path: File to write; JSON if its name ends with `.json`, else YAML.
        robot: The robot that they are for.
        values: Parameters by name: finite numbers, texts, truth values, None, and lists or tuples of those or of routes.
        units: Units for comments behind the values (YAML only).
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If `path` is no path, or a name or value cannot stand in such a file.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    file = as_path("path", path)
    content = {"robot": robot, **values}
    for name, value in content.items():
        try:
            if not _PLAIN.fullmatch(name):
                raise FileFormatError("a name of letters, digits and underscores is required")
            content[name] = _checked(name, value)
        except FileFormatError as error:
            raise ParameterError(name, value, f"what a file of parameters can hold: {error}") from error
    if file.suffix.lower() == ".json":
        return write_text(file, json.dumps(content, indent=2, allow_nan=False) + "\n", overwrite=overwrite)
    notes = {name: f"  # {' '.join(unit.split())}" for name, unit in (units or {}).items() if unit}
    lines = [f"{name}: {_yaml(value)}{notes.get(name, '')}\n" for name, value in content.items()]
    return write_text(file, "".join(lines), overwrite=overwrite)


def _checked(name: str, value: Any, depth: int = 1) -> Any:
    """The value with tuples for lists, if a parameter may have it."""
    if isinstance(value, list | tuple) and depth < 3:
        return tuple(_checked(name, item, depth + 1) for item in value)
    mapping = vars(value) if isinstance(value, Route) else value
    if isinstance(mapping, dict) and depth == 2 and all(map(_PLAIN.fullmatch, mapping)):
        return {key: _checked(name, item, 2 if isinstance(item, list | tuple) else 3) for key, item in mapping.items()}
    if isinstance(value, int | float) and not abs(value) < _LARGEST_NUMBER:
        raise FileFormatError(f"{name}: finite numbers below {_LARGEST_NUMBER:g} in size are required")
    if value is not None and not isinstance(value, bool | int | float | str):
        raise FileFormatError(f"{name}: a number, a word, a truth value, null, or a list of those is required")
    return value


def _yaml(value: Any) -> str:
    """The value as text that YAML 1.1 and 1.2 read alike."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name}: {_yaml(item)}" for name, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_yaml, value)) + "]"
    if isinstance(value, float):
        text = repr(float(value))
        return text if "." in text else text.replace("e", ".0e")  # 1e-05 is a word in YAML 1.1
    if value is None or isinstance(value, bool | int):
        return json.dumps(value)
    if _PLAIN.fullmatch(value) and value.lower() not in _WORDS_1_1 | {word.lower() for word in _MEANINGS}:
        return str(value)
    return '"' + "".join(c if " " <= c <= "~" and c not in '"\\' else f"\\U{ord(c):08x}" for c in value) + '"'


def parse_yaml(text: str) -> Any:
    """Return the value of a YAML text, from the events of PyYAML's parser; reading ends at the first event that is refused.

    Raises:
        FileFormatError: If the text is no YAML, or holds more than a file of parameters can; with the line.
    """
    try:
        events = yaml.parse(text, Loader=yaml.SafeLoader)
        document = (event for event in events if not isinstance(event, yaml.StreamStartEvent | yaml.DocumentStartEvent))
        first = next(document)
        value = None if isinstance(first, yaml.StreamEndEvent) else _value(first, document, itertools.count(1), 0)
        second_document = next((event for event in events if isinstance(event, yaml.DocumentStartEvent)), None)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise FileFormatError(f"{'' if mark is None else f'line {mark.line + 1}: '}{error.problem}") from error
    except yaml.YAMLError as error:
        raise FileFormatError(f"it is no YAML: {' '.join(str(error).split())}") from error
    if second_document is not None:
        raise FileFormatError(f"line {second_document.start_mark.line + 1}: one document is required")
    return value


def _value(event: Any, events: Iterator[Any], counter: Iterator[int], depth: int) -> Any:
    """Value of the node that begins with an event; takes the other events of the node."""
    where = f"line {event.start_mark.line + 1}: "
    if next(counter) > MOST_VALUES:
        raise FileFormatError(f"{where}at most {MOST_VALUES} names and values are read")
    if isinstance(event, yaml.AliasEvent) or event.anchor is not None:
        raise FileFormatError(f"{where}no anchors (&) and aliases (*) are read")
    if event.tag is not None:
        raise FileFormatError(f"{where}no tags (!) are read")
    if isinstance(event, yaml.ScalarEvent):
        return event.value if event.style else _meaning(event.value, where)
    if depth == _DEEPEST:
        raise FileFormatError(f"{where}lists or mappings are nested more than {_DEEPEST} deep")
    if isinstance(event, yaml.SequenceStartEvent):
        items = itertools.takewhile(lambda item: not isinstance(item, yaml.SequenceEndEvent), events)
        return [_value(item, events, counter, depth + 1) for item in items]
    mapping: dict[str, Any] = {}
    while not isinstance(key := next(events), yaml.MappingEndEvent):
        where = f"line {key.start_mark.line + 1}: "
        _value(key, events, counter, depth + 1)  # refuses tags and anchors
        name = getattr(key, "value", None)
        if not name:
            raise FileFormatError(f"{where}the name of a parameter is required before the colon")
        if name in mapping:
            raise FileFormatError(f"{where}{name[:60]} is there twice")
        mapping[name] = _value(next(events), events, counter, depth + 1)
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
