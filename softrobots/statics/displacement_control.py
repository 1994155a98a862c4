r"""Displacement control: springs and reaction of a robot that a frictionless probe displaces, along the path from rest.

The probe moves along a straight world line of direction `n` and touches the robot

- at a *point* of it, free to move across the line: the displacement is `g = n . (p - p_0)`, the force is along `n`; or
- on a *face* of it, along which it slides: the plane through the point that is fixed in the frame, with the normal `m`.
  The probe is where its line meets the plane, :math:`g = m \cdot (p - p_0) / (m \cdot n)`, and the force is along `m`.

`p_0` is the position of the point without the probe. With the reaction `F` along the line and the springs `y` as unknowns the
conditions are :math:`r(y) - F \nabla g = 0` and `g(y) = v`. Newton solves

.. math:: \begin{pmatrix} K_t & -a \\ a^T & 0 \end{pmatrix} \begin{pmatrix} dy \\ dF \end{pmatrix}
          = \begin{pmatrix} -r + F a \\ v - g \end{pmatrix}

with :math:`a = \nabla g` and `K_t` the tangent stiffness of springs, load and :math:`-F \nabla^2 g`. The equilibrium is stable
under the imposed displacement if `K_t` is positive definite on the motions that `a` leaves free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.model.springs import POSITIVE
from softrobots.statics.elastic_state import ElasticState, elastic_state, largest_residual, scaled
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.loads import Load

GAP = 1e-12
"""Tolerance of the displacement of a probe, relative to the reach."""

_FLAT = 1e-3  # least cosine between the probe's line and the normal of the face
_SAME = 1e-9  # numbers of two probes that differ by no more are the same [m or -]
_LARGEST_STEP = 0.5  # [rad], norm of one Newton step
_NEWTON_STEPS = 20
_SHORTEST = 1e-6  # least share of the displacement in one step
_SMALL_MOVE = 0.01  # [rad or m] of a spring: other paths are farther away


@dataclass(frozen=True, eq=False)
class Probe:
    """A frictionless probe: its contact with the robot and the line along which it moves."""

    frame: str
    """Frame of the robot that it touches."""
    point: FloatArray
    """The point that it touches, in that frame, shape (3,) [m]."""
    direction: FloatArray
    """Direction of the line, shape (3,), world axes, of length 1."""
    origin: FloatArray
    """Where the line starts: the point without the probe, shape (3,) [m], world axes."""
    normal: FloatArray | None
    """Normal of the face that the probe slides on, in the frame, shape (3,), of length 1; None: it touches the point."""

    def same_as(self, other: Probe) -> bool:
        """Whether another probe touches the same place and moves along the same line."""
        if self.frame != other.frame or (self.normal is None) != (other.normal is None):
            return False
        mine, its = (
            np.concatenate([p.point, p.direction, p.origin, np.zeros(3) if p.normal is None else p.normal])
            for p in (self, other)
        )
        return bool(np.allclose(mine, its, rtol=0.0, atol=_SAME))


class Contact(NamedTuple):
    """A probe on the robot in one pose."""

    displacement: float
    """Position of the probe along its line [m]."""
    place: FloatArray
    """Point of contact, shape (3,) [m], world axes."""
    wrench: FloatArray
    """Wrench on the frame for a reaction of 1 N along the line, shape (6,) [N, N m]."""
    gradient: FloatArray
    """Derivative of the displacement with respect to the elastic coordinates, shape (n,)."""
    turning: FloatArray
    """Second derivative of the displacement beyond that of a dead wrench, shape (n, n)."""


def touch(probe: Probe, pose: Any, jacobian: FloatArray) -> Contact:
    """Evaluate the contact of a probe at a pose of its frame, a `pinocchio.SE3`, with its Jacobian, shape (6, n).

    The Jacobian is geometric, per elastic coordinate, in world axes, linear rows first. The displacement is NaN where the face
    runs along the probe's line or has turned away from it.
    """
    linear, angular = jacobian[:3], jacobian[3:]
    lever, n = pose.rotation @ probe.point, probe.direction
    offset = pose.translation + lever - probe.origin
    if probe.normal is None:
        wrench = np.concatenate([n, pin.skew(lever) @ n])
        lever_moved = -pin.skew(lever) @ angular
        turning = angular.T @ (pin.skew(n).T @ lever_moved)
        return Contact(float(n @ offset), probe.origin + offset, wrench, wrench @ jacobian, turning)
    m = pose.rotation @ probe.normal
    slope = float(m @ n)
    displacement = float(m @ offset) / slope if slope > _FLAT else math.nan
    slope = max(slope, _FLAT)
    force, arm = m / slope, lever + displacement * n - offset  # arm: from the frame to the probe
    wrench = np.concatenate([force, pin.skew(arm) @ force])
    gradient = wrench @ jacobian
    turned = -pin.skew(m) @ angular  # derivative of the normal
    force_turned = turned / slope - np.outer(m, n @ turned) / slope**2
    arm_moved = np.outer(n, gradient) - linear
    moment_turned = pin.skew(force).T @ arm_moved + pin.skew(arm) @ force_turned
    return Contact(
        displacement, probe.origin + displacement * n, wrench, gradient, linear.T @ force_turned + angular.T @ moment_turned
    )


def face_normal(line: FloatArray, axis: FloatArray, along: Any) -> FloatArray:
    """Unit normal of the face that contains a unit axis and faces a line, a unit vector, most; all in the frame, shape (3,).

    Raises:
        ParameterError: If the axis runs along the line; it names `along`, the argument as given.
    """
    across = line - float(line @ axis) * axis
    length = float(np.linalg.norm(across))
    if length < _FLAT:
        raise ParameterError("along", along, "an axis that does not run along the probe's line")
    return np.asarray(across / length)


class ProbedState(NamedTuple):
    """The robot and the probe at given springs and reaction."""

    state: ElasticState
    """The robot under load and reaction."""
    contact: Contact
    """The contact with the probe."""
    reaction: float
    """Force along the line of the probe [N]."""
    tangent: FloatArray
    """Tangent stiffness, shape (n, n) [N m/rad or N/m]: including the change of direction of the reaction."""

    def step(self, torque: FloatArray, way: float) -> FloatArray | None:
        """Newton step of springs and reaction for a torque, shape (n,) [N m or N], and a change of displacement [m].

        Shape (n + 1,); None where the matrix is singular (the path turns back).
        """
        gradient = self.contact.gradient
        matrix = np.block([[self.tangent, -gradient[:, None]], [gradient, 0.0]])
        try:
            return np.asarray(np.linalg.solve(matrix, np.append(torque, way)))
        except np.linalg.LinAlgError:
            return None


@dataclass(frozen=True, eq=False)
class DisplacementControl:
    """A robot, its load and a probe: the equations of one imposed displacement."""

    model: SoftModel
    """The robot."""
    motors: FloatArray
    """Motor coordinates, shape (n_motors,) [rad or m]."""
    load: Load
    """The load without the probe."""
    probe: Probe
    """The probe."""
    tolerance: float
    """Largest residual, relative to the scale of the load."""

    @property
    def largest_gap(self) -> float:
        """Tolerance of the displacement [m]."""
        return GAP * self.model.reach

    def at(self, q_springs: FloatArray, reaction: float) -> ProbedState:
        """Evaluate at springs, shape (n_springs,), and a reaction [N]."""
        point = self.model.coordinates.at(self.motors, q_springs)
        q = self.model.embed(point.joints)
        jacobian = point.columns(frame_jacobian(self.model, q, self.probe.frame))[1]
        contact = touch(self.probe, frame_placement(self.model, q, self.probe.frame), jacobian)
        state = elastic_state(self.model, self.motors, q_springs, self.load.plus(self.probe.frame, reaction * contact.wrench))
        return ProbedState(state, contact, reaction, state.tangent - reaction * contact.turning)

    def newton(self, here: ProbedState, wanted: float, most: int) -> tuple[ProbedState | None, int]:
        """Newton to a displacement nearby; the state, None if it does not converge in `most`, and the evaluations spent."""
        n = self.model.n_springs
        for iteration in range(1, most + 1):
            gap = wanted - here.contact.displacement
            if not math.isfinite(here.state.error) or not math.isfinite(gap):
                return None, iteration
            balanced = here.state.error <= largest_residual(self.model, here.state.scale, self.tolerance)
            if balanced and abs(gap) <= self.largest_gap:
                return here, iteration
            step = here.step(-here.state.residual, gap)
            if step is None or not np.linalg.norm(step[:n]) <= _LARGEST_STEP:
                return None, iteration
            here = self.at(here.state.q_springs + step[:n], here.reaction + float(step[n]))
        return None, most


def follow(problem: DisplacementControl, here: ProbedState, wanted: float, most: int) -> tuple[ProbedState, int]:
    """Follow the path from a point of it to a displacement [m], in one step if possible, in at most `most` evaluations.

    Returns:
        The farthest point reached, and the evaluations spent.
    """
    origin = here.contact.displacement
    reached, step, spent = 0.0, 1.0, 0
    with one_blas_thread(problem.model.n_springs):
        while reached < 1.0 and step > _SHORTEST and spent < most:
            aim = min(1.0, reached + step)
            part = wanted if aim == 1.0 else origin + aim * (wanted - origin)
            there, used = problem.newton(here, part, min(_NEWTON_STEPS, most - spent))
            spent += used
            if there is None or not _same_path(problem, here, there):
                step *= 0.5
            else:
                here, reached, step = there, aim, 2.0 * step
    return here, spent


def _same_path(problem: DisplacementControl, here: ProbedState, there: ProbedState) -> bool:
    """Whether a step stayed on the path: a short step, or one close to the prediction along the path.

    A long step from a stable to an unstable state did not: beyond the knee of a link, Newton finds the path on which a
    second link yields, too, as easily as the one on which it unloads.
    """
    moved = there.state.q_springs - here.state.q_springs
    if np.abs(moved).max() <= _SMALL_MOVE:
        return True
    model = problem.model
    stable = [stable_under_constraint(model, probed.tangent, probed.contact.gradient) for probed in (here, there)]
    if stable[0] and not stable[1]:
        return False
    predicted = here.step(np.zeros(len(moved)), there.contact.displacement - here.contact.displacement)
    if predicted is None:
        return False
    missed, expected = np.abs(moved - predicted[:-1]).max(), np.abs(predicted[:-1]).max()
    return bool(missed <= max(0.5 * expected, _SMALL_MOVE))


def stable_under_constraint(model: SoftModel, tangent: FloatArray, gradient: FloatArray) -> bool:
    """Whether a symmetric tangent stiffness, shape (n, n), is positive definite on the null space of a gradient, shape (n,)."""
    softness = 1.0 / np.sqrt(model.stiffness)
    free = np.linalg.qr((softness * gradient)[:, None], mode="complete")[0][:, 1:]
    on_free = free.T @ scaled(tangent, model.stiffness) @ free
    return bool(np.linalg.eigvalsh(on_free).min(initial=math.inf) > POSITIVE)
