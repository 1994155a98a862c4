"""Results of the compiled solvers of statics, of one case or many."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from softrobots.compiled.chain.layout import Layout
from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.motion_batch import CaseResults, table_of_cases
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, read_only
from softrobots.core.result_file import TABLES
from softrobots.core.summary import Part, Summarised, Table, facts, field_facts
from softrobots.model.soft_model import SoftModel


class CompiledEquilibrium(Summarised):
    """An equilibrium, certified stable or neutral.

    For motor torques, tangent stiffness, pictures or files pass its `q_springs` to
    `softrobots.solve_equilibrium(..., q_springs0=...)`, which then only checks them.
    """

    __slots__ = ("_actuation", "_layout", "_motors", "_workspace", "status")

    def __init__(
        self,
        workspace: Any,
        layout: Layout,
        actuation: Actuation,
        motors: FloatArray | None = None,
        status: Status = Status.CERTIFIED,
    ) -> None:
        """Store the workspace of the solver, and the actuators if they are not all in it, without copies, and the status."""
        self._workspace = workspace
        self._layout = layout
        self._actuation = actuation
        self._motors = motors
        self.status = status

    def __repr__(self) -> str:
        """Status, residual, force and tip in a line."""
        force, tip = (", ".join(f"{number:.6g}" for number in vector) for vector in (self.force, self.tip_position))
        status = f"{self.status.name}, residual={self.residual:.3g}"
        return f"{type(self).__name__}({status}, force ({force}) N, tip at ({tip}) m)"

    def summary_parts(self) -> list[Part]:
        """Return actuators, springs, force, tip and certificate."""
        model = self._actuation.model
        numbers = [
            (name, f"{value:.6f}", unit)
            for names, values, units in (
                (model.motor_joints, self.q_motors, model.actuators.units),
                (model.spring_joints, self.q_springs, model.springs.units),
            )
            for name, value, unit in zip(names, values, units, strict=True)
        ]
        rows = field_facts(self, "force", "tip_position", "residual")
        status = ("status", self.status.name.lower().replace("_", " "))
        return [Table([(model.name, "position", ""), *numbers], right=(1,)), facts([*rows, status])]

    @property
    def stable(self) -> bool:
        """Whether it is certified stable; else `status` says what it is."""
        return self.status == Status.CERTIFIED

    @property
    def q_motors(self) -> FloatArray:
        """Actuator coordinates, motor joints and then muscles, shape (n_motors,) [rad, m or N], read-only."""
        if self._motors is not None:
            return read_only(np.array(self._motors))
        layout = self._layout
        return read_only(np.concatenate([self._part(0, layout.motors), self._part(layout.actuators, layout.muscles)]))

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self._actuation.model

    @property
    def friction_bending(self) -> FloatArray | None:
        """Bending that dry friction remembers, of the sliders of its sections, shape (n_sections, 2) [rad]; None without it."""
        if not self._layout.rubbing:
            return None
        return read_only(self._actuation.bending(self._part(self._layout.slid, self._layout.unknowns)[None])[0])

    @property
    def friction_slip(self) -> FloatArray | None:
        """Length of actuators beyond each guide at its slider, from rest, shape (n_guides,) [m]; None without dry friction."""
        return self._part(self._layout.anchored, self._layout.guides) if self._layout.rubbing else None

    @property
    def force(self) -> FloatArray:
        """Force on the tip, shape (3,) [N], world axes, read-only."""
        return self._part(self._layout.force, 3)

    @property
    def q_springs(self) -> FloatArray:
        """Elastic coordinates as `SoftModel.spring_joints` names them, shape (n_springs,) [rad or m], read-only."""
        unknowns = self._part(self._layout.unknown, self._layout.unknowns)
        return read_only(self._actuation.elastic(unknowns))

    @property
    def tip_position(self) -> FloatArray:
        """The loaded tip, shape (3,) [m], world axes, read-only."""
        return self._part(self._layout.tip, 3)

    @property
    def residual(self) -> float:
        """Norm of the out-of-balance torque of the elastic coordinates [N m]."""
        return self._root("error")

    @property
    def iterations(self) -> int:
        """Evaluations that the search took."""
        return int(self._workspace[self._layout.single("iterations")])

    def _root(self, name: str) -> float:
        return math.sqrt(self._workspace[self._layout.single(name)])

    def _part(self, place: int, count: int) -> FloatArray:
        return read_only(np.array(self._workspace[place : place + count], dtype=np.float64))


class CompiledLoadEstimate(CompiledEquilibrium):
    """A force that explains motor torques, with the robot in equilibrium under it."""

    __slots__ = ()

    def summary_parts(self) -> list[Part]:
        """Return the equilibrium under the force, what it leaves unexplained, and how well it is felt."""
        return [*super().summary_parts(), facts(field_facts(self, "unexplained", "observability"))]

    @property
    def unexplained(self) -> float:
        """Norm of the motor torques that the force does not explain [N m]."""
        return self._root("unexplained")

    @property
    def observability(self) -> float:
        """Smallest singular value of the elastostatic Jacobian [m]: least sensitivity of the motor torques to the force."""
        return self._root("observed")


@dataclass(frozen=True, eq=False, repr=False)
class Batch(CaseResults):
    """Common results of all batches, one row a case."""

    q_springs: FloatArray
    """Elastic coordinates, shape (n, n_springs) [rad or m]."""
    status: Any
    """`Status` of each case, shape (n,), small integers; only rows with `Status.CERTIFIED` are valid."""
    residual: FloatArray
    """Norm of the out-of-balance torque, shape (n,) [N m]; infinite for input that is not finite."""

    def summary_parts(self) -> list[Part]:
        """Return how many cases have which status, and the ranges of their numbers."""
        counts = [(f"cases {status.name.lower().replace('_', ' ')}", str(number)) for status, number in self.counts().items()]
        shown = [one.name for one in fields(self) if one.name != "status" and getattr(self, one.name) is not None]
        return [facts([*counts, *field_facts(self, *shown)])]

    def counts(self) -> dict[Status, int]:
        """Return the number of cases by status, without statuses that did not occur."""
        values, numbers = np.unique(self.status, return_counts=True)
        return {Status(value): int(number) for value, number in zip(values.tolist(), numbers.tolist(), strict=True)}


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumBatch(Batch):
    """Equilibria of many cases."""

    tip_positions: FloatArray
    """The loaded tip, shape (n, 3) [m], world axes."""
    friction_bending: FloatArray | None = field(default=None, kw_only=True)
    """Bending that dry friction remembers, of the sliders of its sections, shape (n, n_sections, 2) [rad]; None without it."""
    friction_slip: FloatArray | None = field(default=None, kw_only=True)
    """Length of actuators beyond each guide at its slider, from rest, shape (n, n_guides) [m]; None without dry friction."""


@dataclass(frozen=True, eq=False, repr=False)
class LoadBatch(Batch):
    """Forces that explain motor torques, of many cases."""

    forces: FloatArray
    """Force on the tip, shape (n, 3) [N], world axes."""
    unexplained: FloatArray
    """Norm of the motor torques that the force does not explain, shape (n,) [N m]."""
    observability: FloatArray
    """Smallest singular value of the elastostatic Jacobian, shape (n,) [m]."""


@dataclass(frozen=True, eq=False, repr=False)
class MotorBatch(Batch):
    """Motors that put the loaded tip at targets: many independent ones, or the waypoints of a path."""

    q_motors: FloatArray
    """Motor positions, shape (n, n_motors) [rad or m]."""
    tip_error: FloatArray
    """Distance of the loaded tip from its target, shape (n,) [m]."""
    orientation_error: FloatArray | None = None
    """Angle between the loaded tip and its target orientation, shape (n,) [rad]; None for positions."""


TABLES[Batch] = table_of_cases
