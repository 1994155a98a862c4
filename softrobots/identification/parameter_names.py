"""Names of parameters, and the numbers of a robot that they stand for; the table of the names is in `parameters`."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from softrobots.core.errors import NameNotFound, ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.robots.fields import Facts

Kind = Literal["field", "spring", "base", "marker", "offset", "motor", "force", "wrench", "gravity", "idle"]
"""What a parameter changes: a field of the dataclass, joint springs, the pose of the base, a marker, motor offsets; or, where
derivatives are asked for, an actuator coordinate, a load or gravity; or nothing, of friction that is left out."""

LOADS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "force": ("N", ("force.x", "force.y", "force.z")),
    "wrench": ("N, N m", tuple(f"wrench.{part}.{axis}" for part in ("force", "moment") for axis in "xyz")),
    "gravity": ("m/s^2", ("gravity.x", "gravity.y", "gravity.z")),
}
"""Units and components of the loads that derivatives are taken by."""

_INDEXED = re.compile(r"(\w+)\[([^\[\]]*)\](?:\.(\w+))?")
_MARKER = re.compile(r"marker\.(.+)\.offset(?:\.([xyz]))?")


class Place(NamedTuple):
    """The numbers that a parameter sets."""

    kind: Kind
    """What it changes."""
    names: tuple[str, ...] = ()
    """The field, the joints, `position` or `rotation`, or the marker."""
    parts: tuple[int, ...] = ()
    """Entries from 0: of the field (none if it is one number), stiffness (0) or rest (1) of a spring, axes, or actuators."""
    row: tuple[float, ...] = ()
    """Present entries of the field; none if it is one number."""


@dataclass(frozen=True)
class Parameter:
    """One number that is fitted, or that derivatives are taken by."""

    name: str
    """Its name, e.g. "link[1].stiffness" or "base.position.x"."""
    unit: str
    """Its unit, "-" for ratios."""
    value: float
    """Its present value; the mean of numbers that it ties together."""
    lower: float
    """Lower bound from the physics, minus infinity without one."""
    upper: float
    """Upper bound likewise."""
    logarithmic: bool
    """Whether it is positive, so that its logarithm is fitted."""
    place: Place
    """The numbers that it sets."""


class Registry:
    """The parameters that a robot has, by name."""

    def __init__(self, robot: Any, model: SoftModel, markers: Mapping[str, str]) -> None:
        """Take the dataclass (or None), the model and the frames of the markers."""
        self._robot, self._model, self._markers = robot, model, markers
        fields = dataclasses.fields(robot) if robot is not None else ()
        self._facts: dict[str, Facts] = {field.name: field.metadata["facts"] for field in fields if "facts" in field.metadata}
        self._part = next((name.removesuffix("_lengths") for name in self._facts if name.endswith("_lengths")), "")
        self._actuator = getattr(robot, "ACTUATOR", "")

    def find(self, name: str) -> tuple[Parameter, ...]:
        """Return the parameters of a name: one, or one for each component or part.

        Raises:
            NameNotFound: If the robot has none of that name; with all that it has.
            ParameterError: If the name is of a count, a word, a truth value, or a field without a value.
        """
        if name in self._facts:
            return (self._field(name, name, *self._tied(name)),)
        if name in LOADS:
            return tuple(self._load(name, part, text) for part, text in enumerate(LOADS[name][1]))
        for group, (_, names) in LOADS.items():
            if name in names:
                return (self._load(group, names.index(name), name),)
        found = self._base(name) or self._marker(name)
        match = _INDEXED.fullmatch(name)
        if match is not None and not found:
            word, inside, attribute = match.groups()
            found = self._indexed(word, inside, attribute or "")
        if not found:
            raise NameNotFound("parameter", name, self.names())
        return found

    def names(self) -> list[str]:
        """Return the names that there are, those of parts as `link[*].stiffness`; loads, for derivatives only, last."""
        names: list[str] = []
        for name in self._facts:
            if self._accepted(name):
                with contextlib.suppress(ParameterError):  # of some fields a single number gives no entries
                    self._tied(name)
                    names.append(name)
                if isinstance(self._values(name), tuple):
                    names += [f"{word}[*].{name}" for word in self._words(name)] or [f"{name}[*]"]
        for joint in self._model.structure.spring_joints:
            names += [f"joint[{joint}].stiffness", f"joint[{joint}].rest"]
        names += ["base.position", "base.rotation", *(f"marker.{marker}.offset" for marker in self._markers)]
        return names + ["motor[*].offset", "motor[*]"] * (self._model.n_motors > 0) + list(LOADS)

    def _accepted(self, field: str) -> bool:
        """Whether a field has numbers, and the robot takes them: those in force where it has none may be told by others."""
        try:
            values = self._values(field)
            if getattr(self._robot, field) is None:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")  # told when the robot was made
                    dataclasses.replace(self._robot, **{field: values})
        except ParameterError:
            return False
        return True

    def _words(self, field: str) -> Iterator[str]:
        """What the parts of a field are called: those of the robot, and its actuators."""
        if self._facts[field].form != "special":
            if self._part:
                yield self._part
            if self._actuator and field.startswith(f"{self._actuator}_"):
                yield self._actuator

    def _base(self, name: str) -> tuple[Parameter, ...]:
        for what, unit in (("position", "m"), ("rotation", "rad")):
            whole = f"base.{what}"
            axes = range(3) if name == whole else ["xyz".find(name[-1])] if name[:-1] == f"{whole}." else []
            if axes and axes[0] >= 0:
                return tuple(_free(f"{whole}.{'xyz'[i]}", unit, Place("base", (what,), (i,))) for i in axes)
        return ()

    def _marker(self, name: str) -> tuple[Parameter, ...]:
        match = _MARKER.fullmatch(name)
        if match is None or match[1] not in self._markers:
            return ()
        axes = range(3) if match[2] is None else ["xyz".index(match[2])]
        return tuple(_free(f"marker.{match[1]}.offset.{'xyz'[i]}", "m", Place("marker", (match[1],), (i,))) for i in axes)

    @staticmethod
    def _load(group: str, part: int, name: str) -> Parameter:
        unit = LOADS[group][0] if group != "wrench" else ("N", "N m")[part // 3]
        return _free(name, unit, Place(group, (), (part,)))  # type: ignore[arg-type]

    def _indexed(self, word: str, inside: str, attribute: str) -> tuple[Parameter, ...]:
        """Parameters of `word[inside].attribute`, or of `field[inside]`."""
        if word == "joint" and attribute in ("stiffness", "rest"):
            joints = self._model.structure.spring_joints
            groups = _groups(inside, joints, lambda text: joints.index(text) if text in joints else -1)
            return tuple(self._spring([joints[i] for i in group], attribute) for group in groups)
        if word == "motor" and attribute in ("offset", ""):
            return tuple(self._motor(group, attribute) for group in _numbered(inside, self._model.n_motors))
        field = attribute or word
        if field not in self._facts or (attribute and word not in self._words(field)):
            return ()
        values = self._values(field)
        if not isinstance(values, tuple):
            return ()
        robot, of_segments = self._robot, False
        if attribute and self._facts[field].form == "per_actuator":
            if word == self._actuator and len(values) < robot.n_actuators:
                values = robot.by_actuator(field)
            of_segments = word == self._part and len(values) > robot.n_segments
        parts = groups = _numbered(inside, robot.n_segments if of_segments else len(values))
        if of_segments:
            groups = [tuple(i for i, one in enumerate(robot.actuator_segments) if one in some) for some in parts]
        texts = [",".join(str(i + 1) for i in part) for part in parts]
        end = f".{attribute}" if attribute else ""
        return tuple(
            self._field(field, f"{word}[{text}]{end}", values, group) for text, group in zip(texts, groups, strict=True)
        )

    def _spring(self, joints: Sequence[str], what: str) -> Parameter:
        table, springs = self._model.spring_table, self._model.structure.strain_springs
        units = {springs.turning[springs.names.index(joint)] for joint in joints}
        name = f"joint[{','.join(joints)}].{what}"
        if len(units) > 1:
            raise ParameterError("parameters", name, "of joints that all turn, or all slide")
        value = float(np.mean([table[joint][what == "rest"] for joint in joints]))
        turns = units.pop()
        if what == "rest":
            return _free(name, "rad" if turns else "m", Place("spring", tuple(joints), (1,)), value)
        unit = "N m/rad" if turns else "N/m"
        return Parameter(name, unit, value, 0.0, math.inf, True, Place("spring", tuple(joints), (0,)))

    def _motor(self, group: tuple[int, ...], attribute: str) -> Parameter:
        name = f"motor[{','.join(str(i + 1) for i in group)}]"
        units = {self._model.actuators.units[i] for i in group}
        if len(units) > 1:
            raise ParameterError("parameters", name, f"of actuators of one unit (these have {', '.join(sorted(units))})")
        if attribute:
            return _free(f"{name}.offset", units.pop(), Place("offset", (), group))
        if len(group) > 1:
            raise ParameterError("parameters", name, f"one actuator, or its offset, {name}.offset")
        return _free(name, units.pop(), Place("motor", (), group))

    def _values(self, field: str) -> Any:
        """The numbers of a field, or those in force where it has none."""
        value, facts = getattr(self._robot, field), self._facts[field]
        if value is None and facts.in_force:
            value = getattr(self._robot, facts.in_force)
        if value is None:
            raise ParameterError("parameters", field, f"a field with a value to start from; give the robot {field}=...")
        if not _numeric(value):
            raise ParameterError(
                "parameters", field, f"a field of real numbers, and no word, truth value or count; it is {value!r}"
            )
        return value

    def _tied(self, field: str) -> tuple[Any, tuple[int, ...]]:
        """The numbers of a field, and the entries that a single number for the field sets."""
        values = self._values(field)
        if not isinstance(values, tuple) or self._facts[field].form != "special":
            return values, tuple(range(len(values))) if isinstance(values, tuple) else ()
        single = 1.1 * max(map(abs, values), default=0.0) + 0.1
        try:
            given = getattr(dataclasses.replace(self._robot, **{field: single}), field)
        except ParameterError:
            given = ()
        entries = tuple(i for i, value in enumerate(given) if value == single)
        others = [value != before for value, before in zip(given, values, strict=False) if value != single]
        if not entries or any(others):
            raise ParameterError(
                "parameters", field, f"one entry, {field}[1], or all, {field}[*]: one number does not give them"
            )
        return values, entries

    def _field(self, field: str, name: str, values: Any, entries: tuple[int, ...]) -> Parameter:
        facts = self._facts[field]
        value = float(np.mean([values[i] for i in entries])) if entries else float(values)
        lower, upper = (
            next((float(bound) for bound in pair if bound is not None), default)
            for pair, default in (((facts.above, facts.at_least), -math.inf), ((facts.below, facts.at_most), math.inf))
        )
        place = Place("field", (field,), entries, values if entries else ())
        return Parameter(name, facts.unit, value, lower, upper, facts.above is not None and facts.above >= 0.0, place)


def _free(name: str, unit: str, place: Place, value: float = 0.0) -> Parameter:
    """A parameter without bounds."""
    return Parameter(name, unit, value, -math.inf, math.inf, False, place)


def _numeric(value: Any) -> bool:
    return isinstance(value, float) or (
        isinstance(value, tuple) and bool(value) and all(isinstance(one, float) for one in value)
    )


def _numbered(inside: str, count: int) -> list[tuple[int, ...]]:
    """Groups of parts, counted from 0, of text such as `2`, `1,2` or `*`."""
    return _groups(inside, [str(i + 1) for i in range(count)], lambda text: int(text) - 1 if text.isdecimal() else -1)


def _groups(inside: str, names: Sequence[str], place: Callable[[str], int]) -> list[tuple[int, ...]]:
    if inside == "*":
        return [(i,) for i in range(len(names))]
    places = tuple(place(text.strip()) for text in inside.split(","))
    for text, i in zip(inside.split(","), places, strict=True):
        if not 0 <= i < len(names):
            raise NameNotFound("part", text.strip(), [*names, "*"])
    if len(set(places)) < len(places):
        raise ParameterError("parameters", inside, "parts that are named once")
    return [places]
