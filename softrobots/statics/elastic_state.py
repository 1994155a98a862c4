r"""Elastic coordinates of a robot under a load: residual, tangent stiffness and energy.

The elastic coordinates `y` (springs, sections) are in equilibrium when the residual `r(y) = tau_spring(y) - J_k^T w + g_k`
vanishes; actuators are constrained exactly. Where joints follow sections, `J_k` is Pinocchio's Jacobian times `dm/dz`
(`softrobots.model.coordinates`). The tangent stiffness is `K_t = dr/dy` ([Troise 2021] (5-7) give the weightless, first-order
form of this).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from eigenpy import ComputationInfo

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray
from softrobots.model.coordinates import Point, ReducedLoad
from softrobots.model.friction_coordinates import MOST_ROUNDS, SAME_FRICTION, GuideFriction
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.touch import NEAR, NO_FORCES, ForceTable, Touch, joined, resting_forces, surfaces_of, touch_at
from softrobots.statics.loads import AppliedLoad, Load

TOLERANCE = 1e-10
"""Default residual tolerance, relative to the scale of the load."""

MOMENT_FLOOR = 1e-3
"""Least scale of the residual, for vanishing loads [N m]."""

ENERGY_ROUNDING = 1e-14
"""Energies this close, relative to their terms, cannot be told apart."""


class ElasticState(NamedTuple):
    """Elastic coordinates, in equilibrium or not, and what statics needs there."""

    q_springs: FloatArray
    """Elastic coordinates, shape (n_springs,) [rad or m]."""
    model: SoftModel
    """The robot."""
    point: Point
    """Joint positions and their derivatives."""
    load: ReducedLoad
    """The load in actuator and elastic coordinates."""
    spring_torques: FloatArray
    """Load that the springs carry, shape (n_springs,) [N m or N]."""
    scale: float
    """Size of the load [N m]."""
    residual: FloatArray
    """Out-of-balance load on the elastic coordinates, shape (n_springs,) [N m or N]."""
    tangent: FloatArray
    """Tangent stiffness, shape (n_springs, n_springs)."""
    energy: float
    """Elastic energy plus potential of the load [J]; infinite where a section is beyond its range."""
    error: float
    """Norm of the residual; infinite where a section is beyond its range, or the friction of guides does not settle."""
    touch: Touch | None = None
    """The surfaces around with the contact forces, which residual, tangent stiffness and load contain; None in free space."""

    @property
    def q(self) -> FloatArray:
        """Pinocchio's configuration, shape (nq,)."""
        return self.model.embed(self.point.joints)


class ElasticProblem:
    """The residual of the springs of one robot under one load, as a function of the elastic coordinates."""

    def __init__(self, model: SoftModel, q_motors: FloatArray, load: Load, tolerance: float = TOLERANCE) -> None:
        """Take the robot, its actuators, shape (n_motors,), and the load."""
        self.model, self.q_motors, self.load, self.tolerance = model, q_motors, load, tolerance
        self._coordinates, self._springs, self._reach = model.coordinates, model.springs, model.reach
        self._applied = AppliedLoad(model, load)
        self._surfaces = None if load.environment is None else surfaces_of(model, load.environment)

    def state(self, q_springs: FloatArray, forces: ForceTable = NO_FORCES, near: float = NEAR) -> ElasticState:
        """Evaluate residual, tangent stiffness and energy at elastic coordinates, shape (n_springs,) [rad or m].

        In contact with obstacles with the forces given; the tangent stiffness is the Hessian of the Lagrangian then. Gaps
        below `near` times the reach are seen.
        """
        point = self._coordinates.at(self.q_motors, q_springs)
        if not point.valid:
            return _out_of_range(self.model, q_springs, point)
        touch, q = None, self.model.embed(point.joints)
        joints = self._applied.nothing or self._applied.at(q)
        if self._surfaces is not None:
            touch = touch_at(self._surfaces, q, point, forces, near * self._reach)
            joints = joined(joints, touch.load)
        reduced = point.reduce(joints)
        stored, torques, stiffness = self._springs.at(q_springs)
        residual = torques - reduced.elastic
        tangent = stiffness - reduced.derivative
        energy = stored + joints.potential + reduced.potential
        scale = joints.scale + reduced.scale * self._reach
        return ElasticState(
            q_springs, self.model, point, reduced, torques, scale, residual, tangent, energy, norm(residual), touch
        )

    def balanced(self, state: ElasticState) -> bool:
        """Whether the residual meets the tolerance."""
        return state.error <= largest_residual(self.model, state.scale, self.tolerance)

    def too_high(self, trial: ElasticState, state: ElasticState, change: float) -> bool:
        """Whether the energy of a trial is above that of a state by more than a change and rounding."""
        highest = state.energy + change
        return trial.energy > highest and trial.energy > highest + self.rounding(state)

    def rounding(self, state: ElasticState) -> float:
        """Rounding of the energy [J]: that of its terms, which may cancel (a tip folded back to the base).

        The energy itself counts, too: where weight loads no spring (an upright robot), it is still mass times height.
        """
        elastic = float(self.model.stiffness.dot(state.q_springs * state.q_springs))
        return ENERGY_ROUNDING * (state.scale + elastic + abs(state.energy))


def elastic_state(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray, load: Load) -> ElasticState:
    """Evaluate residual, tangent stiffness and energy at actuator and elastic coordinates; see `ElasticProblem.state`."""
    return rubbing_state(model, q_motors, q_springs, load)[1]


def rubbing_state(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray, load: Load) -> tuple[SoftModel, ElasticState]:
    """Evaluate the same, and return the robot with the friction that its guides have there; the robot itself without guides."""
    with one_blas_thread(model.n_springs):
        state = _evaluated(model, q_motors, q_springs, load)
        rounds, off = GuideFriction(), math.inf if model.structure.guided else 0.0
        for _ in range(MOST_ROUNDS if model.structure.guided else 0):
            model, off = rounds.after(model, q_motors, q_springs, state.load.motors)
            if off <= SAME_FRICTION:
                break
            state = _evaluated(model, q_motors, q_springs, load)
        return model, state if off <= SAME_FRICTION else state._replace(error=math.inf)


def _evaluated(model: SoftModel, q_motors: FloatArray, q_springs: FloatArray, load: Load) -> ElasticState:
    """State at coordinates; in contact with the forces that balance best there."""
    problem = ElasticProblem(model, q_motors, load)
    state = problem.state(q_springs)
    if state.touch is None:
        return state
    forces = resting_forces(state.touch, state.residual, model.reach)
    return problem.state(q_springs, ForceTable.of(state.touch.gaps, forces)) if forces.any() else state


def contact_softening(state: ElasticState, forces: FloatArray) -> FloatArray:
    """Derivative of the load of normal forces, shape (m,) [N], on the surfaces near a state, shape (n_springs, n_springs)."""
    touch: Any = state.touch
    return state.point.reduce(touch.gaps.load(forces)).derivative


def _out_of_range(model: SoftModel, q_springs: FloatArray, point: Point) -> ElasticState:
    """State of infinite energy, which no solver accepts: a section is beyond its range."""
    n, m = model.n_springs, model.n_motors
    load = ReducedLoad(np.zeros(m), np.zeros(n), np.zeros((n, n)), np.zeros((n, m)), 0.0, 0.0)
    _, torques, _ = model.springs.at(q_springs)
    return ElasticState(q_springs, model, point, load, torques, 0.0, np.zeros(n), np.zeros((n, n)), math.inf, math.inf)


def largest_residual(model: SoftModel, scale: float, tolerance: float) -> float:
    """Largest residual that counts as equilibrium: `tolerance * max(|f| reach + |moment| + |g|, 1e-3 N m)` [N m].

    The maximum is that of `ElasticState.scale`. Never below the rounding of the spring torques, which matters for stiff springs
    with rest angles only.
    """
    return max(tolerance * max(scale, MOMENT_FLOOR), model.rounding)


def positive(factors: Any, matrix: FloatArray) -> bool:
    """Factorise a symmetric matrix; whether no pivot is negative.

    Eigen also calls a matrix positive whose diagonal vanishes during the factorisation, but then reports a numerical issue.
    """
    return bool(factors.compute(matrix).isPositive() and factors.info() == ComputationInfo.Success)


def norm(vector: FloatArray) -> float:
    """Euclidean norm."""
    return math.hypot(*vector.tolist())


def scaled(tangent: FloatArray, stiffness: FloatArray) -> FloatArray:
    """Tangent stiffness in coordinates scaled by the springs' own stiffness: 1 on the diagonal without load."""
    softness = 1.0 / np.sqrt(stiffness)
    return np.asarray(softness[:, None] * tangent * softness)
