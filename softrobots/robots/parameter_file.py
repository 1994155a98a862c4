"""Parameters of a robot in a file: YAML, or JSON if its name ends with `.json`.

One mapping from the names of parameters to numbers, words, truth values, nothing (`null`), or lists of those; `robot:` may say
which robot they are for:

    robot: inflatable_arm
    link_lengths: [0.5, 0.4]  # m
    stiffness: 1.5e2          # N m/rad

Words that are not quoted mean what they mean in YAML 1.2: `1e3` is a number, `010` is ten and `no` is a word; in YAML 1.1 they
are a word, eight and a truth value. Nothing of a file is run: there are no tags, and no anchors that repeat things.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from softrobots.core.bounded_reading import read_text
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.files import as_path, write_text
from softrobots.core.json_text import parse_json
from softrobots.robots import ROBOTS, XacroRobot, robot_class

LARGEST_FILE = 100_000
"""Bytes of a file."""

MOST_VALUES = 5000
"""Names and values in a file."""

_DEEPEST = 3  # the mapping, a list with a value for each part, a list that is the value of a part
_LARGEST_NUMBER = 1e300
_NUMBER = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_MEANINGS = {word: meaning for text, meaning in (("true", True), ("false", False), ("null", None))
             for word in (text, text.capitalize(), text.upper())} | {"~": None, "": None}  # fmt: skip
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_WORDS_1_1 = {"y", "n", "yes", "no", "on", "off"}  # truth values in YAML 1.1


class ParameterFile(NamedTuple):
    """What a file says."""

    robot: str | None
    """Which robot it is for; None if it does not say."""
    values: dict[str, Any]
    """Parameters by name; lists are tuples."""


def read_parameters(path: str | os.PathLike[str]) -> ParameterFile:
    """Read parameters from a file; whether there is such a robot, and whether it takes them, is not looked at.

    Args:
        path: The file, in UTF-8; JSON if its name ends with `.json`, else YAML.

    Returns:
        What it says.

    Raises:
        ParameterError: If the path is none.
        FileFormatError: If the file cannot be read, is too large, or (naming the line, for YAML) is no mapping of names to
            numbers, words, truth values, nothing and lists of those; has a name twice, a tag, an anchor, or a number that is
            not finite.
    """
    file = as_path("path", path)
    text = read_text(file, LARGEST_FILE)
    try:
        said = parse_json(text) if file.suffix.lower() == ".json" else _parse_yaml(text)
        if not isinstance(said, dict) or not said:
            raise FileFormatError("a mapping with a line NAME: VALUE for each parameter is required")
        values = {name: _checked(name, value) for name, value in said.items()}
        robot = values.pop("robot", None)
        if robot is not None and not isinstance(robot, str):
            raise FileFormatError("robot: the name of a robot is required")
    except FileFormatError as error:
        raise FileFormatError(f"cannot read parameters from {file}: {error}") from error
    return ParameterFile(robot, values)


def read_robot(path: str | os.PathLike[str], robot: str | None = None) -> XacroRobot:
    """Make a robot with the parameters of a file.

    Args:
        path: The file.
        robot: Which robot of `ROBOTS`; the one that the file says by default.

    Returns:
        The robot.

    Raises:
        ParameterError: If the path is none, the file is for another robot or does not say for which, or a value is not what the
            robot accepts.
        FileFormatError: If the file cannot be read or holds something else.
        NameNotFound: If there is no such robot or parameter.
        SelfIntersection: If a helical tube would run into itself.
    """
    said = read_parameters(path)
    name = robot_of(said, robot)
    names = [field.name for field in dataclasses.fields(robot_class(name)[0])]
    unknown = next((parameter for parameter in said.values if parameter not in names), None)
    if unknown is not None:
        raise NameNotFound(f"parameter of {name}", unknown, names)
    return ROBOTS[name](**said.values)


def robot_of(said: ParameterFile, robot: str | None) -> str:
    """Which robot a file is for, where one may be asked for.

    Raises:
        ParameterError: If that is another one, or neither says.
    """
    if robot is None and said.robot is None:
        raise ParameterError("robot", robot, f"given here or in the file: {', '.join(ROBOTS)}")
    if robot is not None and said.robot not in (None, robot):
        raise ParameterError("robot", robot, f"{said.robot}, for which the file is")
    return str(robot or said.robot)


def write_parameters(
    path: str | os.PathLike[str],
    robot: str,
    values: Mapping[str, Any],
    *,
    units: Mapping[str, str] | None = None,
    overwrite: bool = False,
) -> Path:
    """Write parameters that `read_parameters` reads as they are, digit by digit; every reader of YAML understands them so.

    Args:
        path: File to write; JSON if its name ends with `.json`, else YAML.
        robot: Which robot they are for.
        values: Parameters by name: finite numbers, texts, truth values, None, and lists or tuples of those.
        units: Units of some of them, for comments behind the values; JSON has none.
        overwrite: Replace an existing file.

    Returns:
        The path of the file.

    Raises:
        ParameterError: If the path is none, or a name or a value is something else.
        OutputExists: If the file exists and `overwrite` is false.
        OutputError: If the file cannot be written.
    """
    file = as_path("path", path)
    said = {"robot": robot, **values}
    for name, value in said.items():
        try:
            if not _PLAIN.fullmatch(name):
                raise FileFormatError("a name of letters, digits and underscores is required")
            _checked(name, value)
        except FileFormatError as error:
            raise ParameterError(name, value, f"what a file of parameters can hold: {error}") from error
    if file.suffix.lower() == ".json":
        return write_text(file, json.dumps(said, indent=2, allow_nan=False) + "\n", overwrite=overwrite)
    notes = {name: f"  # {' '.join(unit.split())}" for name, unit in (units or {}).items() if unit}
    lines = [f"{name}: {_spelled(value)}{notes.get(name, '')}\n" for name, value in said.items()]
    return write_text(file, "".join(lines), overwrite=overwrite)


def _checked(name: str, value: Any, depth: int = 1) -> Any:
    """A value with tuples for lists, if it is one that a parameter may have."""
    if isinstance(value, list | tuple) and depth < _DEEPEST:
        return tuple(_checked(name, item, depth + 1) for item in value)
    if isinstance(value, int | float) and not abs(value) < _LARGEST_NUMBER:
        raise FileFormatError(f"{name}: finite numbers below {_LARGEST_NUMBER:g} in size are required")
    if value is not None and not isinstance(value, bool | int | float | str):
        raise FileFormatError(f"{name}: a number, a word, a truth value, nothing, or a list of those is required")
    return value


def _spelled(value: Any) -> str:
    """A value as YAML of any version reads it."""
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_spelled, value)) + "]"
    if isinstance(value, float):
        text = repr(float(value))
        return text if "." in text else text.replace("e", ".0e")  # YAML 1.1 takes 1e-05 for a word
    if value is None or isinstance(value, bool | int):
        return json.dumps(value)
    plain = _PLAIN.fullmatch(value) and value.lower() not in _WORDS_1_1 | {word.lower() for word in _MEANINGS}
    if plain:
        return str(value)
    return '"' + "".join(c if " " <= c <= "~" and c not in '"\\' else f"\\U{ord(c):08x}" for c in value) + '"'


def _parse_yaml(text: str) -> Any:
    """The value of a YAML text, made of the events of PyYAML's parser, which reads no further than it is asked to."""
    import yaml

    try:
        return _value_of(yaml.parse(text, Loader=yaml.SafeLoader))
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise FileFormatError(f"{'' if mark is None else f'line {mark.line + 1}: '}{error.problem}") from error
    except yaml.YAMLError as error:
        raise FileFormatError(f"it is no YAML: {' '.join(str(error).split())}") from error


class _Open(NamedTuple):
    """A mapping or a list that has not ended."""

    made: Any
    """What it holds so far."""
    names: list[str]
    """Of a mapping, the name whose value comes next, if one does."""


def _value_of(events: Any) -> Any:
    import yaml

    values, count, documents = [], 0, 0
    inside: list[_Open] = []
    for event in events:
        where = f"line {event.start_mark.line + 1}: "
        documents += isinstance(event, yaml.DocumentStartEvent)
        count += isinstance(event, yaml.NodeEvent)
        if documents > 1 or count > MOST_VALUES:
            raise FileFormatError(f"{where}one document with at most {MOST_VALUES} names and values is required")
        if isinstance(event, yaml.AliasEvent) or getattr(event, "anchor", None) is not None:
            raise FileFormatError(f"{where}no anchors (&) and aliases (*) are read")
        if isinstance(event, yaml.NodeEvent) and getattr(event, "tag", None) is not None:
            raise FileFormatError(f"{where}no tags (!) are read")
        if isinstance(event, yaml.CollectionStartEvent):
            if len(inside) == _DEEPEST:
                raise FileFormatError(f"{where}lists or mappings are inside each other more than {_DEEPEST} deep")
            inside.append(_Open({} if isinstance(event, yaml.MappingStartEvent) else [], []))
            continue
        if isinstance(event, yaml.CollectionEndEvent):
            value = inside.pop().made
        elif isinstance(event, yaml.ScalarEvent):
            value = event.value if event.style else _meaning(event.value, where)
        else:
            continue
        if not inside:
            values.append(value)
        elif isinstance(inside[-1].made, list):
            inside[-1].made.append(value)
        else:
            _put(inside[-1], event, value, where)
    return values[0] if values else None


def _put(mapping: _Open, event: Any, value: Any, where: str) -> None:
    """The next name of a mapping, or the value of the last one."""
    if mapping.names:
        mapping.made[mapping.names.pop()] = value
        return
    name = getattr(event, "value", None)
    if not isinstance(name, str) or not name:
        raise FileFormatError(f"{where}the name of a parameter is required before the colon")
    if name in mapping.made:
        raise FileFormatError(f"{where}{name[:60]} is there twice")
    mapping.names.append(name)


def _meaning(word: str, where: str) -> Any:
    """What a word without quotes stands for."""
    if word in _MEANINGS:
        return _MEANINGS[word]
    if _INTEGER.fullmatch(word):
        return int(word)
    if _NUMBER.fullmatch(word) and not math.isfinite(float(word)):
        raise FileFormatError(f"{where}{word[:60]} is no finite number")
    return float(word) if _NUMBER.fullmatch(word) else word
