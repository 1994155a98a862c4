"""Parameters of robots on the command line: a table of them, and `NAME=VALUE` as values of a robot or a xacro file."""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import inspect
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from softrobots.core.errors import FileFormatError, NameNotFound, ParameterError
from softrobots.core.yaml_text import parse_yaml
from softrobots.description.expansion import argument_notes, declared_arguments
from softrobots.robots import ROBOTS, XacroRobot, robot_class
from softrobots.robots.fields import facts_of
from softrobots.robots.parameter_file import write_parameters

_WORDS = {"true": True, "false": False, "none": None, "": None}  # as xacro arguments spell them


class RobotParameter(NamedTuple):
    """A parameter of a robot, or an argument of a xacro file."""

    name: str
    """Its name."""
    default: str
    """Its default, as it would be typed."""
    unit: str
    """Its unit; empty if it has none."""
    text: str
    """Its meaning, unit, bounds and source."""


def robot_parameters(name: str) -> tuple[RobotParameter, ...]:
    """Return the parameters of a robot of `ROBOTS`, from the fields of its class.

    Raises:
        NameNotFound: If there is no such robot.
    """
    kind, preset = robot_class(name)
    defaults = {field.name: preset.get(field.name, field.default) for field in dataclasses.fields(kind)}
    facts = facts_of(kind)
    return tuple(
        RobotParameter(field, _typed(default), facts[field].unit, facts[field].description)
        for field, default in defaults.items()
    )


def xacro_parameters(path: Path) -> tuple[RobotParameter, ...]:
    """Return the arguments of a xacro file, with the facts that the comments before them state.

    Raises:
        DescriptionError: If the file does not exist or is not XML.
    """
    notes, parameters = argument_notes(path), []
    for name, default in declared_arguments(path).items():
        note = notes.get(name)
        unit, text = ("", "") if note is None else (note.unit, f"{note.text} [{note.unit}]. {note.source}")
        parameters.append(RobotParameter(name, default or "", unit, text))
    return tuple(parameters)


def parse_parameters(words: Sequence[str], known: Sequence[RobotParameter], owner: str) -> dict[str, str]:
    """Split words of the form `name=value`, or `name:=value` as xacro spells it, into text by name of the parameter.

    Args:
        words: The words.
        known: The parameters that exist.
        owner: The robot or file that has them, for errors.

    Raises:
        ParameterError: If a word has another form, or a parameter comes twice.
        NameNotFound: If there is no such parameter; lists those that exist, with default and unit.
    """
    texts: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        name = name.removesuffix(":").strip()
        if not equals or not name:
            raise ParameterError("parameter", word, "of the form NAME=VALUE")
        check_names((name,), known, owner)
        if name in texts:
            raise ParameterError(name, value, "given once")
        texts[name] = value
    return texts


def check_names(names: Iterable[str], known: Sequence[RobotParameter], owner: str) -> None:
    """Refuse names of parameters that are not among those of an owner, a robot or a file.

    Raises:
        NameNotFound: If there is no such parameter; lists those that exist, with default and unit.
    """
    existing = [parameter.name for parameter in known]
    for name in names:
        if name not in existing:
            lines = [f"{one.name}={one.default}" + (f" [{one.unit}]" if one.unit else "") for one in known]
            raise NameNotFound(f"parameter of {owner}", name, existing, lines=lines)


def make_robot(name: str, words: Sequence[str], values: Mapping[str, Any] | None = None) -> XacroRobot:
    """Return a robot of `ROBOTS` with parameters of the command line.

    Args:
        name: Name of the robot.
        words: Parameters, each `name=value`. A value is a number, a list `[0.5,0.4]`, true, false, none, or a word;
            a list may hold words `[base,2]` or routes `[{at: [0, 0.5], azimuth: 0.3, distance: 0.04}]`.
        values: Further parameters, e.g. of a file; those in `words` win.

    Raises:
        NameNotFound: If there is no such robot or parameter.
        ParameterError: If a word is not of that form, a parameter comes twice, or the robot refuses a value.
        SelfIntersection: If a helical tube would run into itself.
    """
    known = robot_parameters(name)
    check_names(values or {}, known, name)
    texts = parse_parameters(words, known, name)
    return ROBOTS[name](**{**(values or {}), **{field: _value(text) for field, text in texts.items()}})


def name_of(robot: XacroRobot) -> str | None:
    """Return the name in `ROBOTS` of a robot, whose preset fields it has; None if it is of no class there."""
    for name in reversed(list(ROBOTS)):
        kind, preset = robot_class(name)
        if type(robot) is kind and all(getattr(robot, field) == value for field, value in preset.items()):
            return name
    return None


def write_robot(path: Path, name: str, robot: Any, placement: Mapping[str, Any], *, overwrite: bool) -> Path:
    """Write all parameters of a robot of `ROBOTS`, and where it stands, to a file; errors are those of `write_parameters`."""
    known = robot_parameters(name)
    values = {parameter.name: _shortest(robot, parameter.name) for parameter in known}
    units = {parameter.name: parameter.unit for parameter in known} | {"base_position": "m", "base_rotation": "rad"}
    return write_parameters(path, name, values | dict(placement), units=units, overwrite=overwrite)


def first_sentence(name: str) -> str:
    """Return the first line of the docstring of a robot of `ROBOTS`, with the fields that its entry presets."""
    kind, preset = robot_class(name)
    line = (inspect.getdoc(kind) or "").split("\n")[0]
    return line + (f" ({', '.join(f'{field}={value}' for field, value in preset.items())})" if preset else "")


def _value(text: str) -> Any:
    """Value of a text: a Python literal, true, false, none, a list as in a file of parameters, or the text itself."""
    if text.strip().lower() in _WORDS:
        return _WORDS[text.strip().lower()]
    with contextlib.suppress(ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return ast.literal_eval(text.strip())
    with contextlib.suppress(FileFormatError):
        return parse_yaml(text) if text.strip().startswith("[") else text
    return text


def _shortest(robot: Any, name: str) -> Any:
    """A parameter of a robot, as one value if all parts have the same and the robot accepts one."""
    value = getattr(robot, name)
    if isinstance(value, tuple) and value and all(item == value[0] for item in value):
        with contextlib.suppress(ParameterError):
            if dataclasses.replace(robot, **{name: value[0]}) == robot:
                return value[0]
    return value


def _typed(value: Any) -> str:
    """A default as it would be typed."""
    if value is None or isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple | list):
        return "[" + ",".join(map(_typed, value)) + "]"
    return str(value)
