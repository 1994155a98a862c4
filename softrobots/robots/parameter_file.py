"""Files of robot parameters: YAML, or JSON if the name ends with `.json`.

One mapping from the names of parameters to numbers, words, truth values, `null`, or lists of those; `robot:` may name the robot
that they are for. Base and markers that a fit has found stand beside them (`softrobots.robots.placed_robot`). A route of an
actuator is a mapping in a list:

    robot: pcc_arm
    segment_lengths: [0.5, 0.4]  # m
    bending_stiffness: 1.5e0     # N m^2
    kind: tension
    routing: [{at: [0.0, 0.9], azimuth: [0.0, 3.14], distance: 0.04}]

How YAML is read is in `softrobots.core.yaml_text`.
"""

from __future__ import annotations

import dataclasses
import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from softrobots.core.bounded_reading import read_text
from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.files import as_path, write_text
from softrobots.core.json_text import parse_json
from softrobots.core.yaml_text import parse_yaml, yaml_of
from softrobots.robots import ROBOTS, Route, XacroRobot, robot_class

LARGEST_FILE = 100_000
"""Largest size of a file [bytes]."""

PLACEMENT = ("base_position", "base_rotation", "markers")
"""Names of what a file holds that is no parameter of a robot; see `softrobots.robots.placed_robot`."""

_LARGEST_NUMBER = 1e300
_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")


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
    """Return a robot with the parameters of a file, without the base and the markers that it may have.

    `softrobots.robots.placed_robot.read_placed_robot` returns the robot with both.

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
    return robot_of(owner, {name: value for name, value in values.items() if name not in PLACEMENT}, robot)


def robot_of(owner: str | None, values: Mapping[str, Any], robot: str | None = None) -> XacroRobot:
    """Return the robot of the content of a file, see `read_robot`, which has the same errors."""
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
    lines = [f"{name}: {yaml_of(value)}{notes.get(name, '')}\n" for name, value in content.items()]
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
