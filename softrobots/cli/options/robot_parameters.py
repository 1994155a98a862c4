"""Parameters of robots on the command line: what there is, with unit and default, and `field=value` made into a robot."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.description.argument_notes import argument_notes
from softrobots.description.expansion import declared_arguments
from softrobots.robots import ROBOTS, Robot
from softrobots.robots.parameter_file import ParameterFile

_WORDS = {"true": True, "false": False, "none": None, "": None}  # as xacro arguments spell them


NOTHING = ParameterFile(None, {})
"""What no file says."""


class RobotParameter(NamedTuple):
    """A parameter of a robot."""

    name: str
    """Its name."""
    default: str
    """Its default, as it would be typed."""
    unit: str
    """Its unit; empty if it has none."""
    text: str
    """What it is."""

    @property
    def line(self) -> str:
        """Name, default and unit."""
        return f"{self.name}={self.default}" + (f" [{self.unit}]" if self.unit else "")


def robot_parameters(name: str) -> tuple[RobotParameter, ...]:
    """Parameters of a robot of `ROBOTS`, out of the fields of its class and their docstrings.

    Raises:
        NameNotFound: If there is no such robot.
    """
    kind, preset = _kind(name)
    texts = _field_docstrings(kind)
    made = []
    for field in dataclasses.fields(kind):
        text = texts.get(field.name, "")
        brackets = re.findall(r"\[([^\[\]\d][^\[\]]*)\]", text.split(". ")[0])  # an interval starts with a number
        units = [inside for inside in brackets if not re.search(r"\d{4}", inside)]  # a paper ends with its year
        default = _spelled(preset.get(field.name, field.default))
        made.append(RobotParameter(field.name, default, units[-1] if units else "", text))
    return tuple(made)


def xacro_parameters(path: Path) -> tuple[RobotParameter, ...]:
    """Arguments of a xacro file, with what the comments before them tell.

    Raises:
        DescriptionError: If the file does not exist or is not XML.
    """
    declared, notes = declared_arguments(path), argument_notes(path)
    made = []
    for name, default in declared.items():
        note = notes.get(name)
        unit, text = ("", "") if note is None else (note.unit, f"{note.text} [{note.unit}]. {note.source}")
        made.append(RobotParameter(name, default or "", unit, text))
    return tuple(made)


def parse_parameters(words: Sequence[str], known: Sequence[RobotParameter], owner: str) -> dict[str, str]:
    """Take `field=value` apart; `field:=value`, as xacro spells it, will do too.

    Args:
        words: The words.
        known: What may be given.
        owner: What it is given to, for errors.

    Returns:
        Text by name of the parameter.

    Raises:
        ParameterError: If a word is something else, or a parameter comes twice.
        NameNotFound: If there is no such parameter; lists those that exist, with default and unit.
    """
    given: dict[str, str] = {}
    for word in words:
        name, equals, value = word.partition("=")
        name = name.removesuffix(":").strip()
        if not equals or not name:
            raise ParameterError("parameter", word, "of the form NAME=VALUE")
        if name not in (parameter.name for parameter in known):
            names, lines = [parameter.name for parameter in known], [parameter.line for parameter in known]
            raise NameNotFound(f"parameter of {owner}", name, names, lines=lines)
        if name in given:
            raise ParameterError(name, value, "given once")
        given[name] = value
    return given


def check_names(said: ParameterFile, known: Sequence[RobotParameter], owner: str) -> None:
    """Refuse a file with a parameter that there is not.

    Args:
        said: What the file says.
        known: What may be given.
        owner: What it is given to, for errors.

    Raises:
        NameNotFound: If there is no such parameter; lists those that exist, with default and unit.
    """
    names = [parameter.name for parameter in known]
    for name in said.values:
        if name not in names:
            raise NameNotFound(f"parameter of {owner}", name, names, lines=[parameter.line for parameter in known])


def make_robot(name: str, words: Sequence[str], said: ParameterFile = NOTHING) -> Robot:
    """Make a robot of `ROBOTS` with parameters of the command line.

    Args:
        name: Name of the robot.
        words: Parameters, each `field=value`. A value is a number, a list `[0.5,0.4]`, true, false, none, or a word.
        said: Parameters of a file; those of the command line win.

    Raises:
        NameNotFound: If there is no such robot or parameter.
        ParameterError: If a word is no `field=value`, a parameter comes twice, or a value is not what the robot accepts.
        SelfIntersection: If a helical tube would run into itself.
    """
    known = robot_parameters(name)
    check_names(said, known, name)
    texts = parse_parameters(words, known, name)
    return ROBOTS[name](**{**said.values, **{field: _value(text) for field, text in texts.items()}})


def first_sentence(name: str) -> str:
    """What a robot of `ROBOTS` is, in a line."""
    kind, preset = _kind(name)
    told = (inspect.getdoc(kind) or "").split("\n")[0]
    return told + (f" ({', '.join(f'{field}={value}' for field, value in preset.items())})" if preset else "")


def _kind(name: str) -> tuple[Any, Mapping[str, Any]]:
    """The class of a robot, and the fields that its entry presets."""
    if name not in ROBOTS:
        raise NameNotFound("robot", name, ROBOTS)
    maker: Callable[..., Robot] = ROBOTS[name]
    return (maker.func, maker.keywords) if isinstance(maker, partial) else (maker, {})


def _field_docstrings(kind: Any) -> dict[str, str]:
    """The text under each field of a class; Python itself does not keep it."""
    body = ast.parse(textwrap.dedent(inspect.getsource(kind))).body[0]
    statements = body.body if isinstance(body, ast.ClassDef) else []
    texts = {}
    for field, text in itertools.pairwise(statements):
        documented = isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)
        if documented and isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name):
            texts[field.target.id] = " ".join(str(text.value.value).split())  # type: ignore[attr-defined]
    return texts


def _value(text: str) -> Any:
    """What a word stands for: a Python literal, true, false, none, or itself."""
    if text.strip().lower() in _WORDS:
        return _WORDS[text.strip().lower()]
    try:
        return ast.literal_eval(text.strip())
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        return text


def _spelled(value: Any) -> str:
    """A default as it would be typed."""
    if value is None or isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple | list):
        return "[" + ",".join(map(_spelled, value)) + "]"
    return str(value)
