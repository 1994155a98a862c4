"""A robot as a dataclass: fields that carry meaning, unit, bounds and source, and are the arguments of a xacro file.

The facts are stated only there. The checks of a robot, the command line, the API reference and the JSON beside a URDF read
them, and a test compares the xacro files with them.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Sequence
from dataclasses import Field, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Literal, TypeVar

import numpy as np

from softrobots.core.errors import FieldNotFound, ParameterError
from softrobots.core.summary import Part, Summarised, facts, field_facts
from softrobots.description.expansion import expand
from softrobots.description.paths import xacro_folder
from softrobots.description.recorded_expansions import RecordedExpansions
from softrobots.robots.field_values import checked_value, numbers, within

MOST_PARTS = 1000
"""Largest number of links or segments; xacro takes minutes for that many."""

_ELSEWHERE = {
    "payload": ["a load on the tip of any robot: force= or wrench= of the solvers, or a body by softrobots.mount(robot, body)"]
}  # what users look for among the fields of every robot

PerPart = float | Sequence[float]
"""One number for all links or segments, or one for each, base to tip."""

Form = Literal["single", "per_part", "per_actuator", "colour", "special"]
"""One value; one for all parts or one for each; that or one for each actuator; a colour for all parts or each; checked by the
robot itself."""

Value = TypeVar("Value")
RobotClass = TypeVar("RobotClass", bound="XacroRobot")


@dataclass(frozen=True)
class Facts:
    """What is known of a parameter besides its name and default."""

    unit: str
    """Unit, "-" for ratios, empty for words, truth values and counts."""
    what: str
    """Meaning."""
    source: str = "chosen"
    """Where the default comes from."""
    above: float | None = None
    """Lower bound, excluded."""
    at_least: float | None = None
    """Lower bound, included."""
    below: float | None = None
    """Upper bound, excluded."""
    at_most: float | None = None
    """Upper bound, included."""
    options: tuple[str, ...] = ()
    """Words to choose from."""
    form: Form = "single"
    """How many values there are."""
    in_xacro: bool = True
    """Whether the xacro file has an argument of this name."""
    in_force: str = ""
    """Property of the robot with the values that hold where the field is None; empty if it has none."""

    @property
    def bounds(self) -> str:
        """The bounds in words, e.g. "above 0, at most 1"; empty without bounds."""
        limits = (("above", self.above), ("at least", self.at_least), ("below", self.below), ("at most", self.at_most))
        return ", ".join(f"{words} {limit:g}" for words, limit in limits if limit is not None)

    @property
    def description(self) -> str:
        """Meaning, unit, bounds and source in one or two sentences."""
        head = self.what + (f" [{self.unit}]" if self.unit else "") + (f", {self.bounds}" if self.bounds else "")
        return f"{head}." if self.source == "chosen" else f"{head}. {self.source[0].upper()}{self.source[1:]}."

    def allow(self, numbers: Sequence[float]) -> bool:
        """Return whether all numbers are within the bounds."""
        low, high = min(numbers), max(numbers)
        return (
            (self.above is None or low > self.above)
            and (self.at_least is None or low >= self.at_least)
            and (self.below is None or high < self.below)
            and (self.at_most is None or high <= self.at_most)
        )


def parameter(default: Value, *facts: Any, **more_facts: Any) -> Value:
    """Return a dataclass field with a default and `Facts`, e.g. `parameter(0.1, "m", "Radius of the rod", above=0.0)`."""
    field: Value = dataclasses.field(default=default, metadata={"facts": Facts(*facts, **more_facts)})
    return field


def per_part(default: Value, *facts: Any, **more_facts: Any) -> Value:
    """Return such a field with one number for all parts or one for each."""
    return parameter(default, *facts, form="per_part", **more_facts)


def per_actuator(default: Value, *facts: Any, **more_facts: Any) -> Value:
    """Return such a field with one number for all parts, one for each, or one for each actuator of the robot."""
    return parameter(default, *facts, form="per_actuator", **more_facts)


def facts_of(robot: Any) -> dict[str, Facts]:
    """Return the facts of the parameters of a robot, or of its class, by name."""
    return {field.name: field.metadata["facts"] for field in dataclasses.fields(robot)}


def check_parameters(robot: Any, parts: str = "parts", lengths: str | None = None) -> int:
    """Check every field of a robot against its facts and store it in its final type; values per part become tuples.

    Those of actuators are left to `check_actuator_parameters`.

    Args:
        robot: A frozen dataclass of fields by `parameter`.
        parts: What links or segments are called, for errors.
        lengths: The field with a length for each of them; None if there is only one.

    Returns:
        Number of links or segments.

    Raises:
        ParameterError: If a value has another type or is out of bounds, or a list has the wrong length; names the field.
    """
    count = 1
    if lengths is not None:
        value = getattr(robot, lengths)
        count = len(numbers(lengths, value, None, "m"))
        if not 0 < count <= MOST_PARTS:
            raise ParameterError(lengths, value, f"at least one length [m], at most {MOST_PARTS}")
    for field in dataclasses.fields(robot):
        value, facts = getattr(robot, field.name), field.metadata["facts"]
        if facts.form not in ("special", "per_actuator") and not (value is None and field.default is None):
            object.__setattr__(robot, field.name, checked_value(field, value, count, parts))
    return count


def check_actuator_parameters(robot: Any, count: int, parts: str, actuators: int) -> None:
    """Check the fields with values per actuator and store them as tuples, of `count` parts or of all actuators.

    Raises:
        ParameterError: If a value is not finite or out of bounds, or a list has neither length; names the field.
    """
    for field in dataclasses.fields(robot):
        value, facts = getattr(robot, field.name), field.metadata["facts"]
        if facts.form == "per_actuator" and not (value is None and field.default is None):
            given = numbers(field.name, value, count, facts.unit, parts, actuators)
            object.__setattr__(robot, field.name, within(field, given))


def refuse_given(robot: Any, names: Sequence[str], requirement: str) -> None:
    """Refuse parameters that have no effect in a robot whose fields are checked: those that differ from their default."""
    for field in dataclasses.fields(robot):
        value, default = np.asarray(getattr(robot, field.name)), np.asarray(field.default)
        same = default.ndim == 0 or value.shape == default.shape
        if field.name in names and not (same and np.all(value == default)):
            raise ParameterError(field.name, getattr(robot, field.name), f"left out {requirement}; it has no effect there")


class _FieldsAsArguments:
    """Signature of a class, which Python would else take from `__new__`."""

    def __get__(self, instance: object, cls: type) -> inspect.Signature:
        whole = inspect.signature(cls.__init__)  # type: ignore[misc]
        return whole.replace(parameters=list(whole.parameters.values())[1:])


@dataclass(frozen=True, kw_only=True)
class XacroRobot(Summarised):
    """Base of a frozen dataclass whose fields (`parameter`) are the arguments of a xacro file."""

    XACRO: ClassVar[str | Path]
    """The file that describes the robot: a name in xacro/, or a path."""
    _text: ClassVar[str | None] = None  # its URDF text, where a robot was made together with it
    _grows: ClassVar[bool] = False  # whether others are to come that differ in their length only
    __signature__ = _FieldsAsArguments()

    def __new__(cls: type[RobotClass], *_: Any, **values: Any) -> RobotClass:
        """Refuse fields that the robot does not have, before its constructor does with less to say."""
        units = {name: facts.unit for name, facts in facts_of(cls).items()}
        for name in values:
            if name not in units:
                known = ", ".join(f"{field} [{unit}]" if unit else field for field, unit in units.items())
                raise FieldNotFound(f"field of {cls.__name__}", name, units, lines=[known, *_ELSEWHERE.get(name, ())])
        return object.__new__(cls)

    @property
    def n_joints(self) -> int:
        """Number of movable joints of the chain; above 300 Pinocchio's workspace is refused."""
        raise NotImplementedError

    def summary_parts(self) -> list[Part]:
        """Return the fields with their units."""
        return [facts(field_facts(self, *facts_of(self)))]

    def xacro_arguments(self) -> dict[str, str]:
        """Return the parameters as arguments of the xacro file: text by name, full precision."""
        arguments = {}
        for name, known in facts_of(self).items():
            value = getattr(self, name)
            if known.form == "colour":
                arguments[name] = ",".join(" ".join(map(repr, colour)) for colour in value)
            elif known.in_xacro:
                arguments[name] = argument_text(value)
        return arguments

    def urdf(self) -> str:
        """Return the robot as URDF text, with its springs, sections and muscles inside.

        Raises:
            DescriptionError: If xacro refuses the parameters, e.g. parts too light to cut tiny links from them.
        """
        if self._text is not None:
            return self._text
        return _expanded(self.XACRO, tuple(self.xacro_arguments().items()), self._grows)

    def _each(self, name: str) -> tuple[Any, ...]:
        """Values of a field, one a part."""
        values: tuple[Any, ...] = getattr(self, name)
        return values


@lru_cache(maxsize=64)
def _expanded(xacro_file: str | Path, arguments: tuple[tuple[str, str], ...], grows: bool) -> str:
    """URDF text; of a robot that grows by a recorded expansion that only its argument `length` distinguishes from this."""
    path, given = xacro_folder() / xacro_file, dict(arguments)
    if grows:
        expansions = _of_lengths(path, tuple(one for one in arguments if one[0] != "length"))
        text = expansions.text([float(given["length"])], given, lambda numbers: given | {"length": str(numbers[0])})
        if text is not None:
            return text
    return expand(path, given)


@lru_cache(maxsize=16)
def _of_lengths(path: Path, others: tuple[tuple[str, str], ...]) -> RecordedExpansions:
    return RecordedExpansions(path)


def default_text(field: Field[Any]) -> str:
    """Return the default of a field as the text of a xacro argument."""
    default: Any = field.default
    return " ".join(map(repr, default)) if field.metadata["facts"].form == "colour" else argument_text(default)


def argument_text(value: Any) -> str:
    """Return a value as the text of a xacro argument, full precision; None is empty."""
    if isinstance(value, str):
        return value
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    if not isinstance(value, tuple):
        return repr(value)
    texts = [item if isinstance(item, str) else repr(item) for item in value]
    return "[" + ",".join(texts) + "]"
