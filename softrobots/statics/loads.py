"""Load cases: dead wrenches at frames of a robot and gravity, and their torques in joint coordinates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, finite_array, read_only, read_only_mapping
from softrobots.core.errors import FileFormatError, ParameterError
from softrobots.environment.environment import Environment, fixed_environment
from softrobots.model.joint_loads import JointLoad
from softrobots.model.soft_model import SoftModel, check_model

EARTH_GRAVITY = (0.0, 0.0, -9.81)
"""Gravity on the ground, world axes [m/s^2]."""

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


def _rows(wrench: FloatArray) -> FloatArray:
    """`LoadTerm.rows` of a wrench."""
    force, moment = wrench[:3], wrench[3:]
    nothing = np.zeros((3, 3))
    return np.vstack([wrench, np.hstack([pin.skew(force).T, nothing]), np.hstack([nothing, pin.skew(moment)])])


_UNIT_ROWS = np.stack([_rows(unit).ravel() for unit in np.eye(6)], axis=-1)  # (42, 6): rows are linear in the wrench


class LoadTerm(NamedTuple):
    """One wrench of a load."""

    frame: str
    """Name of the frame."""
    force: FloatArray
    """Its force, shape (3,) [N]."""
    rows: FloatArray
    """Factor of the Jacobian of the frame, shape (7, 6): the wrench; `-f x` on linear rows; `mu x` on angular ones."""
    norms: tuple[float, float]
    """Norms of force [N] and moment [N m]."""

    @classmethod
    def of(cls, frame: str, wrench: FloatArray) -> LoadTerm:
        """Compute the rows of a wrench, shape (6,), at a frame."""
        fx, fy, fz, mx, my, mz = wrench.tolist()
        return cls(frame, wrench[:3], _UNIT_ROWS.dot(wrench).reshape(7, 6), (math.hypot(fx, fy, fz), math.hypot(mx, my, mz)))


@dataclass(frozen=True, eq=False)
class Load:
    """A load case: dead wrenches (fixed in the world, they do not follow the robot) and gravity.

    A force has a potential; a world-fixed *moment* has none.
    """

    wrenches: Mapping[str, FloatArray]
    """Wrench by frame name, shape (6,): force [N] then moment [N m], world axes, at the origin of the frame; read-only."""
    gravity: tuple[float, float, float] | None
    """Gravity, world axes [m/s^2]; None: weightless."""
    environment: Environment | None = None
    """Obstacles that the robot may touch, a `softrobots.Environment`; None: free space."""
    terms: tuple[LoadTerm, ...] = field(init=False, repr=False)
    """The wrenches with the matrices of their derivatives."""
    conservative: bool = field(init=False, repr=False)
    """Whether the load has a potential: it has no moment."""

    def __post_init__(self) -> None:
        """Copy the wrenches, read-only, and compute their terms."""
        copies = {frame: read_only(np.array(wrench)) for frame, wrench in self.wrenches.items()}
        terms = tuple(LoadTerm.of(frame, wrench) for frame, wrench in copies.items())
        object.__setattr__(self, "wrenches", read_only_mapping(copies))
        object.__setattr__(self, "terms", terms)
        object.__setattr__(self, "conservative", all(term.norms[1] == 0.0 for term in terms))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle with a plain dictionary."""
        return Load, (dict(self.wrenches), self.gravity, self.environment)

    @classmethod
    def of(
        cls,
        model: SoftModel,
        force: Any = None,
        *,
        wrench: Any = None,
        frame: str | None = None,
        gravity: Any = None,
        environment: Environment | None = None,
    ) -> Load:
        """Check a load, given as in `solve_equilibrium`, against a model; `wrench` is added to `force`.

        Raises:
            ParameterError: If a shape differs or a number is not finite, or an obstacle moves.
            NameNotFound: If a frame does not exist.
        """
        check_model(model)
        at = model.tip if frame is None else frame
        model.frame_id(at)
        total: dict[str, FloatArray] = {}
        if force is not None:
            total[at] = np.zeros(6)
            total[at][:3] = finite_array("force", force, (3,), "N")
        if wrench is not None:
            several = wrench if isinstance(wrench, Mapping) else {at: wrench}
            for name, value in several.items():
                model.frame_id(name)
                field = f"wrench[{name!r}]" if isinstance(wrench, Mapping) else "wrench"
                total[name] = total.get(name, 0.0) + finite_array(field, value, (6,), "N, N m")
        if environment is not None:
            fixed_environment(environment)
        if gravity is None:
            return cls(total, None, environment)
        x, y, z = finite_array("gravity", gravity, (3,), "m/s^2, world axes; EARTH_GRAVITY is (0, 0, -9.81)").tolist()
        return cls(total, (x, y, z), environment)

    def same_as(self, other: Load) -> bool:
        """Whether another load has the same wrenches, gravity and obstacles."""
        return self is other or (
            self.gravity == other.gravity
            and self.environment == other.environment
            and self.wrenches.keys() == other.wrenches.keys()
            and all(np.array_equal(wrench, other.wrenches[name]) for name, wrench in self.wrenches.items())
        )

    def scaled(self, factor: float) -> Load:
        """Return the load with every wrench and gravity multiplied by `factor`."""
        gravity = None if self.gravity is None else tuple(factor * g for g in self.gravity)
        wrenches = {name: factor * value for name, value in self.wrenches.items()}
        return Load(wrenches, gravity, self.environment)  # type: ignore[arg-type]

    def with_moments(self, factor: float) -> Load:
        """Return the load with every moment multiplied by `factor`, forces and gravity as they are."""
        share = np.repeat([1.0, factor], 3)
        return Load({name: share * value for name, value in self.wrenches.items()}, self.gravity, self.environment)

    def turned(self, rotation: FloatArray) -> Load:
        """Return the load turned by a rotation matrix, shape (3, 3), acting at the same frames."""
        gravity = None if self.gravity is None else tuple((rotation @ self.gravity).tolist())
        return Load({name: (rotation @ one.reshape(2, 3).T).T.ravel() for name, one in self.wrenches.items()}, gravity)

    def plus(self, frame: str, wrench: FloatArray) -> Load:
        """Return the load with one more wrench, shape (6,) [N, N m], at a frame."""
        return Load({**self.wrenches, frame: self.wrenches.get(frame, 0.0) + wrench}, self.gravity, self.environment)


def distributed_force(model: SoftModel, force_per_length: Any) -> dict[str, FloatArray]:
    """A uniform dead force along the sections of a robot, as wrenches at its sections.

    The force on each half of a section acts at the nearer end (lumped: that of a section at its hinge), an approximation of
    second order in the length of a section, like the chain. The half at the base has no effect.

    Args:
        model: A robot with sections.
        force_per_length: Force per rest length, shape (3,) [N/m], world axes.

    Returns:
        Wrench, shape (6,) [N, N m], by frame, for `solve_equilibrium(wrench=...)`.

    Raises:
        ParameterError: If the robot has no sections, the shape differs or a number is not finite.
    """
    rows = check_model(model).structure.section_table
    if not rows:
        raise ParameterError("model", model, "a robot with sections (a PccArm or a HelixTube)")
    force = finite_array("force_per_length", force_per_length, (3,), "N/m")
    lengths = np.array([row.length for row in rows])
    if model.structure.constant_strain:
        lengths = 0.5 * (lengths + np.append(lengths[1:], 0.0))
    return {row.name: np.concatenate([share * force, np.zeros(3)]) for row, share in zip(rows, lengths.tolist(), strict=True)}


def load_of_data(model: SoftModel, data: Any) -> Load:
    """Return the load of plain data of a result file: wrenches, gravity and, if there is one, the environment.

    Raises:
        FileFormatError: If an obstacle names another file; other exceptions of readers mean that the data is none.
    """
    environment = None
    if "environment" in data:
        if any(isinstance(one.get("vertices"), str) for one in data["environment"]["obstacles"]):
            raise FileFormatError("an obstacle of it is another file")
        environment = Environment.from_dict(data["environment"])
    return Load.of(model, wrench=data["wrenches"], gravity=data["gravity"], environment=environment)


def check_no_contact(subject: Any, what: str) -> None:
    """Check that a load or an equilibrium has no obstacles; `what` cannot take them, in words.

    Raises:
        ParameterError: If it has.
    """
    if subject.environment is not None:
        raise ParameterError("environment", subject.environment, f"None: {what} takes no obstacles")


class AppliedLoad:
    """A load on a robot as joint torques; belongs to the thread that created it.

    The derivatives are the closed form of the kinematic Hessian, because Pinocchio's own static derivatives are those of a
    follower load.
    """

    def __init__(self, model: SoftModel, load: Load) -> None:
        """Look up the frames and the scale of the load."""
        self._model, self._data = model.workspace(load.gravity)
        self._load, self._nv, self._terms, self._scale = load, self._model.nv, [], 0.0
        for term in load.terms:
            self._terms.append((model.frame_id(term.frame), term))
            self._scale += term.norms[0] * model.reach + term.norms[1]
        self._heavy, self.nothing = load.gravity is not None and any(load.gravity), None
        """The load where there is no wrench and no gravity; it is the same everywhere."""
        if not (self._terms or self._heavy):
            no_rows = np.zeros((0, self._nv))
            self.nothing = JointLoad(np.zeros(self._nv), no_rows, no_rows, None, None, 0.0, 0.0)

    def at(self, q: FloatArray) -> JointLoad:
        """Torque, derivative, potential and size of the load at a finite configuration, shape (nq,)."""
        model, data, nv = self._model, self._data, self._nv
        if nv == 0:  # Pinocchio's frame Jacobian crashes without columns
            return JointLoad(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), None, None, 0.0, 0.0)
        torques, angular, by_force, by_moment = [], [], [], []
        potential, scale = 0.0, self._scale
        for frame, term in self._terms:
            jacobian = pin.computeFrameJacobian(model, data, q, frame, _AXES)
            if nv == 1:  # Pinocchio returns one column as a vector
                jacobian = jacobian.reshape(6, 1)
            products = term.rows.dot(jacobian)
            torques.append(products[0])
            angular.append(jacobian[3:])
            by_force.append(products[1:4])
            if not self._load.conservative:
                by_moment.append(products[4:])
            potential -= float(term.force.dot(pin.updateFramePlacement(model, data, frame).translation))
        gravity_derivative: FloatArray | None = None
        if self._heavy:
            gravity_derivative = -pin.computeGeneralizedGravityDerivatives(model, data, q)
            torques.append(-data.g)
            scale += math.hypot(*data.g.tolist())
            potential += pin.computePotentialEnergy(model, data)
        if len(angular) != 1:  # no wrench, or several: stacked
            angular, by_force, by_moment = (
                [np.concatenate([np.zeros((0, nv)), *rows])] for rows in (angular, by_force, by_moment)
            )
        torque = sum(torques[1:], start=torques[0]) if torques else np.zeros(nv)
        moments = None if self._load.conservative else by_moment[0]
        return JointLoad(torque, angular[0], by_force[0], moments, gravity_derivative, potential, scale)
