"""Variants of a robot that differ in some of its numbers, for searches over parameters: their URDF text takes milliseconds.

    variants = Variants(robot, [("stiffness", 0), ("stiffness", 1), ("base_mass", None)])
    variants.values                     # the present numbers, shape (3,)
    other = variants.robot(values)      # equal to dataclasses.replace(robot, stiffness=..., base_mass=...), so checked
    load_model(other)                   # other.urdf() is at hand, digit for digit that of any equal robot; xacro does not run

Their texts are those of `softrobots.description.recorded_expansions`.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, instance_of
from softrobots.core.errors import ParameterError
from softrobots.description.paths import xacro_folder
from softrobots.description.recorded_expansions import RecordedExpansions
from softrobots.robots.fields import XacroRobot, facts_of
from softrobots.robots.routes import Route

Part = int | tuple[int | str, ...] | None
"""Which number of a field: None for its only one, or its place, from 0; (route, "distance", place) of a route."""


class Variants:
    """A robot with some of its numbers open.

    Args:
        robot: The robot.
        fields: The numbers, pairs of a field of the robot and a `Part` of it.

    Raises:
        ParameterError: If the robot is of another type, or there is no such number in it.
    """

    def __init__(self, robot: XacroRobot, fields: Sequence[tuple[str, Part]]) -> None:
        self.base = instance_of("robot", robot, XacroRobot, "a robot of a dataclass with a xacro file")
        self._paths: list[tuple[Any, ...]] = [
            (name, *(part if isinstance(part, tuple) else () if part is None else (part,))) for name, part in fields
        ]
        for field, path in zip(fields, self._paths, strict=True):
            if path[0] not in facts_of(robot) or type(_number(robot, path)) is not float or self._paths.count(path) > 1:
                raise ParameterError("fields", field, "pairs (field, part) that name numbers of the robot, each once")
        self.expansions = RecordedExpansions(xacro_folder() / robot.XACRO)
        """The recorded expansions, whose numbers are `values`."""

    @property
    def values(self) -> FloatArray:
        """The present numbers, shape (n,), in the units of their fields."""
        return np.array(self._numbers(self.base))

    def robot(self, values: Sequence[float] | FloatArray) -> Any:
        """Return the robot with other numbers, and its URDF text at hand.

        Args:
            values: The numbers, shape (n,), in the units of their fields.

        Returns:
            A robot equal to the base with these numbers.

        Raises:
            ParameterError: If there are more or fewer numbers, or the robot refuses one.
            DescriptionError: If xacro refuses them.
        """
        robot = self.changed(values)
        object.__setattr__(robot, "_text", self._text(robot))
        return robot

    def changed(self, values: Sequence[float] | FloatArray) -> Any:
        """Return the robot with other numbers, equal to `robot(values)`, without its URDF text.

        Raises:
            ParameterError: If there are more or fewer numbers, or the robot refuses one.
        """
        given = finite_array("values", values, (len(self._paths),)).tolist()
        raw = self._with(self.base, given)
        fields = {path[0]: getattr(raw, path[0]) for path in self._paths}
        return dataclasses.replace(self.base, **{name: _checked(value) for name, value in fields.items()})

    def _numbers(self, robot: XacroRobot) -> list[float]:
        return [_number(robot, path) for path in self._paths]

    def _with(self, robot: XacroRobot, numbers: Sequence[Any]) -> XacroRobot:
        """A copy with other numbers that nothing has checked."""
        for path, number in zip(self._paths, numbers, strict=True):
            robot = _replaced(robot, path, number)
        return robot

    def _text(self, robot: XacroRobot) -> str:
        text = self.expansions.text(
            self._numbers(robot), robot.xacro_arguments(), lambda numbers: self._with(robot, numbers).xacro_arguments()
        )
        return robot.urdf() if text is None else text


def _number(value: Any, path: Sequence[Any]) -> Any:
    """The number at a path; None where the path leads nowhere."""
    for step in path:
        if isinstance(step, str):
            value = getattr(value, step, None)
        elif isinstance(value, tuple) and 0 <= step < len(value):
            value = value[step]
        else:
            return None
    return value


def _replaced(value: Any, path: Sequence[Any], number: Any) -> Any:
    """A copy of a dataclass or of a tuple with another number at a path."""
    if not path:
        return number
    step, *rest = path
    if not isinstance(step, str):
        return (*value[:step], _replaced(value[step], rest, number), *value[step + 1 :])
    other = copy.copy(value)
    object.__setattr__(other, step, _replaced(getattr(value, step), rest, number))
    return other


def _checked(value: Any) -> Any:
    """A field in which routes are checked again."""
    if not isinstance(value, tuple):
        return value
    return tuple(dataclasses.replace(item) if isinstance(item, Route) else item for item in value)
