"""What pulls on a robot: dead wrenches at its frames, and gravity; and what they do in joint coordinates."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.checks import FloatArray, finite_array, read_only
from softrobots.errors import ParameterError
from softrobots.joint_loads import JointLoad
from softrobots.model import SoftModel, check_model

EARTH_GRAVITY = (0.0, 0.0, -9.81)
"""Gravity on the ground, world axes [m/s^2]."""

_AXES = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED


class LoadTerm(NamedTuple):
    """One wrench of a load."""

    frame: str
    """Name of the frame."""
    wrench: FloatArray
    """Wrench, shape (6,) [N, N m]."""
    force: FloatArray
    """Its force, shape (3,) [N]."""
    force_cross_transposed: FloatArray
    """Transpose of the cross matrix of the force, shape (3, 3) [N]."""
    moment_cross: FloatArray | None
    """Cross matrix of the moment, shape (3, 3) [N m]; None without a moment."""
    norms: tuple[float, float]
    """Norms of force [N] and moment [N m]."""

    @classmethod
    def of(cls, frame: str, wrench: FloatArray) -> LoadTerm:
        """Prepare a wrench, shape (6,), at a frame."""
        force, moment = wrench[:3], wrench[3:]
        norms = (math.hypot(*force.tolist()), math.hypot(*moment.tolist()))
        return cls(frame, wrench, force, cross_matrix(force).T, cross_matrix(moment) if norms[1] > 0.0 else None, norms)


@dataclass(frozen=True, eq=False)
class Load:
    """A load case: dead wrenches (fixed in the world, they do not follow the robot) and gravity.

    A force has a potential; a world-fixed *moment* has none.
    """

    wrenches: Mapping[str, FloatArray]
    """Wrench by frame name, shape (6,): force [N] then moment [N m], world axes, at the origin of the frame; read-only."""
    gravity: tuple[float, float, float] | None
    """Gravity, world axes [m/s^2]; None: weightless."""

    def __post_init__(self) -> None:
        """Keep a read-only copy of the wrenches."""
        kept = {name: read_only(np.array(wrench)) for name, wrench in self.wrenches.items()}
        object.__setattr__(self, "wrenches", MappingProxyType(kept))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle with a plain dictionary."""
        return Load, (dict(self.wrenches), self.gravity)

    @classmethod
    def of(
        cls, model: SoftModel, force: Any = None, *, wrench: Any = None, frame: str | None = None, gravity: Any = None
    ) -> Load:
        """Check a load against a model.

        Args:
            model: The robot.
            force: Force at `frame`, shape (3,) [N], world axes.
            wrench: Wrench at `frame`, shape (6,) [N, N m], or `{frame: (6,)}` for several; added to `force`.
            frame: Name of the frame; the tip by default.
            gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.

        Returns:
            The load.

        Raises:
            ParameterError: If a shape differs or a number is not finite.
            NameNotFound: If a frame does not exist.
        """
        check_model(model)
        at = model.tip if frame is None else frame
        model.frame_id(at)
        total: dict[str, FloatArray] = {}
        if force is not None:
            total[at] = np.concatenate([finite_array("force", force, (3,), "N"), np.zeros(3)])
        if wrench is not None:
            several = wrench if isinstance(wrench, Mapping) else {at: wrench}
            for name, value in several.items():
                model.frame_id(name)
                field = f"wrench[{name!r}]" if isinstance(wrench, Mapping) else "wrench"
                total[name] = total.get(name, 0.0) + finite_array(field, value, (6,), "N, N m")
        if gravity is None:
            return cls(total, None)
        x, y, z = finite_array("gravity", gravity, (3,), "m/s^2").tolist()
        return cls(total, (x, y, z))

    @cached_property
    def conservative(self) -> bool:
        """Whether the load has a potential: no moment in it."""
        return all(term.moment_cross is None for term in self.terms)

    @cached_property
    def terms(self) -> tuple[LoadTerm, ...]:
        """The wrenches with the matrices that the statics needs of them."""
        return tuple(LoadTerm.of(frame, wrench) for frame, wrench in self.wrenches.items())

    def same_as(self, other: Load) -> bool:
        """Whether another load has the same wrenches and gravity."""
        return self is other or (
            self.gravity == other.gravity
            and self.wrenches.keys() == other.wrenches.keys()
            and all(np.array_equal(wrench, other.wrenches[name]) for name, wrench in self.wrenches.items())
        )

    def scaled(self, factor: float) -> Load:
        """Return the load with every wrench and gravity multiplied by `factor`."""
        gravity = None if self.gravity is None else tuple(factor * g for g in self.gravity)
        return Load({name: factor * value for name, value in self.wrenches.items()}, gravity)  # type: ignore[arg-type]

    def plus(self, frame: str, wrench: FloatArray) -> Load:
        """Return the load with one more wrench, shape (6,) [N, N m], at a frame."""
        return Load({**self.wrenches, frame: self.wrenches.get(frame, 0.0) + wrench}, self.gravity)


def distributed_force(model: SoftModel, force_per_length: Any) -> dict[str, FloatArray]:
    """A uniform dead force along the sections of a robot, as wrenches at its sections.

    Each half of a section passes its share to the nearer end (lumped: each section to its hinge), an approximation of second
    order in the length of a section, like the chain. The half at the base loads nothing that moves.

    Args:
        model: A robot with sections.
        force_per_length: Force per rest length, shape (3,) [N/m], world axes.

    Returns:
        Wrench, shape (6,) [N, N m], by frame: for `wrench=` of `solve_equilibrium`.

    Raises:
        ParameterError: If the robot has no sections, the shape differs or a number is not finite.
    """
    rows = check_model(model).structure.section_table
    if not rows:
        raise ParameterError("model", model, "a robot with sections (a PccArm or a HelixTube)")
    force = finite_array("force_per_length", force_per_length, (3,), "N/m")
    lengths = np.array([row.length for row in rows])
    if model.structure.sections is not None:
        lengths = 0.5 * (lengths + np.append(lengths[1:], 0.0))
    return {row.name: np.concatenate([share * force, np.zeros(3)]) for row, share in zip(rows, lengths.tolist(), strict=True)}


def generalised_load(model: SoftModel, q: FloatArray, load: Load) -> JointLoad:
    """Torque of a load in joint coordinates, with its exact derivative (see `softrobots.joint_loads`).

    (Closed form of the kinematic Hessian; Pinocchio's own static derivatives take the load as a follower.)

    Args:
        model: The robot.
        q: Configuration, shape (nq,), finite.
        load: The load.

    Returns:
        Torque, derivative, potential and size.
    """
    pin_model, data = model.workspace(load.gravity)
    nv = pin_model.nv
    if nv == 0:  # nothing moves; Pinocchio's frame Jacobian crashes without columns
        return JointLoad(np.zeros(0), np.zeros((0, 0)), np.zeros((0, 0)), None, None, 0.0, 0.0)
    pin.computeJointJacobians(pin_model, data, q)
    torque: FloatArray = np.zeros(nv)
    potential = scale = 0.0
    angular, by_force, by_moment = [], [], []
    for term in load.terms:
        frame = model.frame_id(term.frame)
        jacobian = pin.getFrameJacobian(pin_model, data, frame, _AXES).reshape(6, nv)
        torque += term.wrench @ jacobian
        scale += term.norms[0] * model.reach + term.norms[1]
        potential -= float(term.force @ pin.updateFramePlacement(pin_model, data, frame).translation)
        angular.append(jacobian[3:])
        by_force.append(term.force_cross_transposed @ jacobian[:3])
        if not load.conservative:
            by_moment.append(np.zeros((3, nv)) if term.moment_cross is None else term.moment_cross @ jacobian[3:])
    gravity_derivative: FloatArray | None = None
    if load.gravity is not None:
        gravity_derivative = -pin.computeGeneralizedGravityDerivatives(pin_model, data, q)
        gravity_torque: FloatArray = data.g
        torque -= gravity_torque
        scale += math.sqrt(float(gravity_torque @ gravity_torque))
        potential += pin.computePotentialEnergy(pin_model, data)
    moments = None if load.conservative else _stacked(by_moment, nv)
    return JointLoad(torque, _stacked(angular, nv), _stacked(by_force, nv), moments, gravity_derivative, potential, scale)


def _stacked(rows: list[FloatArray], columns: int) -> FloatArray:
    return rows[0] if len(rows) == 1 else np.concatenate([np.zeros((0, columns)), *rows])


def cross_matrix(vector: FloatArray) -> FloatArray:
    """Matrix `[v]` with `[v] u = v x u`, shape (3, 3)."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
