"""Parameters of a robot by name: what is fitted to measurements, and what derivatives are taken by.

| name | stands for | scalars |
|---|---|---|
| `stiffness` | a numeric field of the dataclass; of one with a value per part, one value for all parts | 1 |
| `link[2].stiffness`, `segment[1].young_modulus`, `tendon[4].tendon_pretension` | the value of one part | 1 |
| `link[1,2].stiffness` | one value for these parts | 1 |
| `link[*].stiffness` | a value for each part | one each |
| `stiffness[2]`, `muscle_azimuths[*]` | entries of a field, whatever its parts are called | 1, one each |
| `joint[spring_1_side].stiffness`, `joint[NAME].rest` | a joint spring of any file; `[A,B]` and `[*]` as above | 1 |
| `base.position`, `base.rotation` | pose of the base in the frame of the measurements, rotation vector | 3 |
| `base.position.x` | one component | 1 |
| `marker.NAME.offset` | place of a marker in the frame that it sits on | 3 |
| `motor[2].offset`, `motor[1,2].offset`, `motor[*].offset` | true minus commanded actuator coordinate | 1, one each |
| `motor[2]`, `force`, `wrench`, `gravity` | one actuator, a load at the tip, gravity: only for derivatives | 1, 3, 6, 3 |

Parts, actuators and entries are counted from 1. Names, units and bounds are those of the fields (`softrobots.robots.fields`).
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, read_only
from softrobots.core.errors import ParameterError
from softrobots.identification.parameter_names import Kind, Parameter, Place, Registry
from softrobots.model.loader import load_arguments, load_model, with_springs
from softrobots.model.numbers import Numbers, model_numbers
from softrobots.model.soft_model import SoftModel
from softrobots.robots import AssumedStiffnessWarning
from softrobots.robots.variants import Variants

OF_MODEL = ("field", "spring")
"""Kinds of parameters that change the model."""


@dataclass(frozen=True, eq=False)
class ParameterSet:
    """Named parameters of a robot, in order, with the robot that has given values of them."""

    present: SoftModel
    """The robot with its present values; it says with which springs, motors, tip and muscles it was loaded."""
    parameters: tuple[Parameter, ...]
    """The scalar parameters."""
    markers: Mapping[str, str]
    """Frame of each marker."""
    members: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Names of the scalars by each name that was asked for."""

    @classmethod
    def of(cls, robot: Any, names: str | Sequence[str], markers: Mapping[str, str] | None = None) -> ParameterSet:
        """Find parameters of a robot.

        Args:
            robot: A dataclass of parameters (a robot of this package or one's own), or a `SoftModel`.
            names: Names as in the table of this module, each number once.
            markers: Frame by name of marker.

        Raises:
            NameNotFound: If there is no such parameter; with all that there are. If a frame does not exist.
            ParameterError: If the robot is neither, no name is given, a number is named twice, or a field has no numbers, or
                none that the robot accepts.
            DescriptionError: If the robot cannot be loaded.
        """
        robot = load_model(robot) if isinstance(robot, str) else robot
        if not isinstance(robot, SoftModel) and not (dataclasses.is_dataclass(robot) and not isinstance(robot, type)):
            raise ParameterError("robot", robot, "a robot (a dataclass of parameters), a name or a SoftModel")
        model = robot if isinstance(robot, SoftModel) else load_model(robot)  # type: ignore[arg-type]
        marked = {} if markers is None else dict(markers)
        for frame in marked.values():
            model.frame_id(frame)
        listed = [names] if isinstance(names, str) else list(names)
        if not listed or not all(isinstance(name, str) for name in listed):
            raise ParameterError("parameters", names, 'names of parameters, e.g. ("stiffness", "hinge_offset")')
        registry = Registry(model.robot, model, marked)
        each = {name.strip(): registry.find(name.strip()) for name in listed}
        if len(each) < len(listed):
            raise ParameterError("parameters", names, "names that are there once")
        members = {name: tuple(one.name for one in some) for name, some in each.items()}
        found = cls(model, tuple(one for some in each.values() for one in some), marked, members)
        found._check()
        return found

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each scalar."""
        return tuple(one.name for one in self.parameters)

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each."""
        return tuple(one.unit for one in self.parameters)

    @cached_property
    def values(self) -> FloatArray:
        """Present values, shape (P,)."""
        return read_only(np.array([one.value for one in self.parameters]))

    @cached_property
    def lower(self) -> FloatArray:
        """Lower bounds, shape (P,)."""
        return read_only(np.array([one.lower for one in self.parameters]))

    @cached_property
    def upper(self) -> FloatArray:
        """Upper bounds, shape (P,)."""
        return read_only(np.array([one.upper for one in self.parameters]))

    @cached_property
    def logarithmic(self) -> Any:
        """Which are fitted by their logarithm, shape (P,), truth values."""
        return np.array([one.logarithmic for one in self.parameters], dtype=bool)

    @cached_property
    def of_model(self) -> Any:
        """Which change the model, shape (P,), truth values; the others change base, markers, actuator offsets or loads."""
        return np.array([one.place.kind in OF_MODEL for one in self.parameters], dtype=bool)

    def coordinates(self, values: FloatArray) -> FloatArray:
        """Return what is fitted at values, shape (P,): the logarithms of positive parameters, and the others."""
        return np.where(self.logarithmic, np.log(np.where(self.logarithmic, values, 1.0)), values)

    def at_coordinates(self, x: FloatArray) -> FloatArray:
        """Return the values at such coordinates, shape (P,); infinite ones too, which the robot refuses."""
        with np.errstate(over="ignore"):
            return np.where(self.logarithmic, np.exp(np.where(self.logarithmic, x, 0.0)), x)

    @cached_property
    def coordinate_bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lower and upper bounds of the coordinates, each shape (P,)."""
        with np.errstate(divide="ignore"):
            lower = self.coordinates(np.where(self.logarithmic, np.maximum(self.lower, 0.0), self.lower))
        return lower, self.coordinates(self.upper)

    @cached_property
    def direct_slopes(self) -> Mapping[str, FloatArray]:
        """Derivatives, 1 or 0, of what is set without changing the model, shape (size, P), by what has parameters.

        "motor": the actuators; "base": its position, then rotation; "wrench": that at the tip; "gravity".
        """
        sizes, slopes = {"motor": self.present.n_motors, "base": 6, "wrench": 6, "gravity": 3}, dict[str, FloatArray]()
        for number, one in enumerate(self.parameters):
            kind = {"offset": "motor", "force": "wrench"}.get(one.place.kind, one.place.kind)
            if kind in sizes:
                rows = np.array(one.place.parts) + 3 * (one.place.names == ("rotation",))
                slopes.setdefault(kind, np.zeros((sizes[kind], len(self.parameters))))[rows, number] = 1.0
        return slopes

    def places(self, kind: Kind) -> list[tuple[int, Parameter]]:
        """Return the parameters of a kind with their numbers, from 0."""
        return [(number, one) for number, one in enumerate(self.parameters) if one.place.kind == kind]

    def robot(self, values: Any, *, described: bool = True) -> Any:
        """Return the dataclass with values, shape (P,), of the fields, `described` by its text; None without a dataclass.

        Raises:
            ParameterError: If the shape differs, or the robot refuses a value.
        """
        numbers = finite_array("values", values, (len(self.parameters),))
        if not self.entries:
            return self.present.robot
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AssumedStiffnessWarning)  # told when the robot was made
            of_fields = numbers[list(self.entries.values())]
            return self.variants.robot(of_fields) if described else self.variants.changed(of_fields)

    def model(self, values: Any) -> SoftModel:
        """Return the robot with values, shape (P,), loaded as the present one was.

        Raises:
            ParameterError: If the shape differs, or the robot refuses a value.
            DescriptionError: If the robot with these values cannot be described, e.g. with parts too light.
        """
        numbers = finite_array("values", values, (len(self.parameters),))
        return self._models(tuple(np.where(self.of_model, numbers, 0.0).tolist()))

    def numbers(self, values: FloatArray) -> Numbers:
        """Return `model_numbers` of the robot with values, shape (P,); raises the same errors."""
        return model_numbers(self.model(values))

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy keeps: all but the last models."""
        return {name: value for name, value in vars(self).items() if name != "_models"}

    @cached_property
    def _models(self) -> Callable[[tuple[float, ...]], SoftModel]:
        """The last models, which stay the same while only the base, markers or offsets change."""
        return lru_cache(maxsize=4)(self._model)

    def _model(self, values: tuple[float, ...]) -> SoftModel:
        robot = self.robot(values)
        model = self.present if robot is self.present.robot else load_model(robot, **self._load_arguments)
        springs = dict(model.spring_table)
        for number, one in self.places("spring"):
            for joint in one.place.names:
                stiffness, rest = springs[joint]
                springs[joint] = (stiffness, values[number]) if one.place.parts[0] else (values[number], rest)
        return with_springs(model, springs) if self.places("spring") else model

    def frictionless(self) -> ParameterSet:
        """The same parameters of the robot without its dry friction, whose own change nothing; itself if no field has any."""
        robot, friction = self.present.robot, ("bending_friction", "guide_friction")
        if self.present.structure.friction is None or not any(hasattr(robot, name) for name in friction):
            return self
        fields = {name: 0.0 for name in friction if hasattr(robot, name)}
        idle = {one.name for _, one in self.places("field") if one.place.names[0] in fields}
        others = [replace(one, place=Place("idle")) if one.name in idle else one for one in self.parameters]
        return replace(self, present=load_model(replace(robot, **fields), **self._load_arguments), parameters=tuple(others))

    def base(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return position [m] and rotation vector [rad] of the base in the frame of the measurements, each shape (3,)."""
        pose = {"position": np.zeros(3), "rotation": np.zeros(3)}
        for number, one in self.places("base"):
            pose[one.place.names[0]][one.place.parts[0]] = values[number]
        return pose["position"], pose["rotation"]

    def marker_offset(self, values: FloatArray, marker: str) -> FloatArray:
        """Return the place of a marker in its frame, shape (3,) [m]."""
        offset = np.zeros(3)
        for number, one in self.places("marker"):
            if one.place.names[0] == marker:
                offset[one.place.parts[0]] = values[number]
        return offset

    def motor_offsets(self, values: FloatArray) -> FloatArray:
        """Return true minus commanded actuator coordinates, shape (n_motors,) [rad, m, N or Pa]."""
        return np.asarray(self.offset_slopes @ values)

    @cached_property
    def offset_slopes(self) -> FloatArray:
        """Derivative of the actuators by the parameters: 1 where one is their offset, else 0, shape (n_motors, P)."""
        slopes = np.zeros((self.present.n_motors, len(self.parameters)))
        for number, one in self.places("offset"):
            slopes[list(one.place.parts), number] = 1.0
        return read_only(slopes)

    @cached_property
    def entries(self) -> dict[tuple[str, int | None], int]:
        """Number of the parameter by each number of the dataclass that it sets."""
        fields = self.places("field")
        return {(one.place.names[0], part): number for number, one in fields for part in one.place.parts or (None,)}

    @cached_property
    def variants(self) -> Variants:
        """The robot with its present values, where it has none with those in force."""
        rows = {one.place.names[0]: one.place.row for _, one in self.places("field") if one.place.row}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", AssumedStiffnessWarning)
            return Variants(replace(self.present.robot, **rows), list(self.entries))

    @cached_property
    def _load_arguments(self) -> dict[str, Any]:
        """Arguments of `load_model` with which the present robot was loaded."""
        model = self.present
        given: dict[str, Any] = dict.fromkeys(name for name in model.structure.tags.springs if name not in model.spring_table)
        given |= {name: model.spring_table[name] for name, role in model.joint_roles.items() if role == "given spring"}
        return load_arguments(model) | {"springs": given or None}

    def _check(self) -> None:
        """Refuse numbers that are named twice, and present values that the robot refuses."""
        rows: dict[str, int] = {}
        for _, one in self.places("field"):
            if rows.setdefault(one.place.names[0], len(one.place.row)) != len(one.place.row):
                raise ParameterError("parameters", one.name, f"of the same parts as the other names of {one.place.names[0]}")
        seen: dict[tuple[Any, ...], str] = {}
        for one in self.parameters:
            for name in one.place.names or ("",):
                for part in one.place.parts or (-1,):
                    first = seen.setdefault((one.place.kind, name, part), one.name)
                    if first != one.name:
                        raise ParameterError("parameters", one.name, f"of numbers that no other names, as {first} does")
        if len(set(self.names)) < len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise ParameterError("parameters", twice, "named once")
        self.robot(self.values, described=False)
