r"""Errors of measurement in an estimated load: noise of the torques, errors of the stiffness and of the motor angles.

An estimated force solves :math:`\tau_m(f, q_m, k) = \tau`, springs in equilibrium. An error of the robot's stiffness or of the
measured angles acts like an error of the torques,

.. math:: \delta\tau_k = C^T K_t^{-1} \frac{\partial \tau_s}{\partial k} \delta k, \qquad
   \delta\tau_q = -\left( \frac{\partial (J_m^T f - g_m)}{\partial q_m} + C^T K_t^{-1} C \right) \delta q_m

with the derivative `C` of the load on the springs with respect to the motors (`Equilibrium.coupling`); in contact the pressed
contacts stay pressed (`softrobots.statics.sensitivity.held_motion`). And an error of the
torques moves the force by the pseudo-inverse of :math:`d\tau_m/df`. Each moment law depends on stiffness times angle only, so
that :math:`k \, \partial\tau_s/\partial k` is the tangent of the springs times their angles from rest.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softrobots.core.checks import FloatArray, one_each, read_only
from softrobots.core.errors import ParameterError
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.pressed_gaps import motor_slopes, pressed_gaps
from softrobots.statics.elastic_state import ElasticState
from softrobots.statics.loads import Load
from softrobots.statics.sensitivity import held_motion

FIVE = 5.0
"""Standard deviations of the torques that may stay unexplained."""


class MeasurementErrors(NamedTuple):
    """Standard deviations of what an estimate is computed from; None where unknown, and not counted."""

    torque_std: FloatArray | None
    """Of the motor torques, shape (n_motors,) [N m or N]."""
    stiffness_std: FloatArray | None
    """Of the stiffness of each spring, as a share of it, shape (n_springs,) [-]; one error for all springs that bend a link."""
    motor_angle_std: FloatArray | None
    """Of the motor coordinates, shape (n_motors,) [rad or m; N or Pa of a tension or pressure]."""

    @classmethod
    def of(cls, model: SoftModel, torque_std: Any, stiffness_std: Any, motor_angle_std: Any) -> MeasurementErrors:
        """Check standard deviations, one number each or one for each motor or spring; None: unknown.

        Raises:
            ParameterError: If a shape differs, a number is not positive, or stiffness is given for a robot with muscles.
        """
        if model.muscles and stiffness_std is not None:
            available = "left out for a robot with muscles; torque_std and motor_angle_std are available"
            raise ParameterError("stiffness_std", stiffness_std, available)
        return cls(
            _spread("torque_std", torque_std, model.n_motors, "N m"),
            _spread("stiffness_std", stiffness_std, model.n_springs, "-"),
            _spread("motor_angle_std", motor_angle_std, model.n_motors, "rad"),
        )

    def as_torques(self, model: SoftModel, load: Load, state: ElasticState) -> dict[str, FloatArray]:
        """Return independent errors of the motor torques by source: "torques", "stiffness", "motor_angles".

        Args:
            model: The robot.
            load: The load with the force.
            state: The equilibrium under it.

        Returns:
            For each source that is known one standard deviation of each independent error, as torques: shape (n_motors, n).
        """
        parts: dict[str, FloatArray] = {}
        if self.torque_std is not None:
            parts["torques"] = np.diag(self.torque_std)
        if self.stiffness_std is None and self.motor_angle_std is None:
            return parts
        follow, followed = held_motion(model, state.tangent, state.load.coupling, pressed_gaps(state))
        if self.stiffness_std is not None:
            bent = model.springs.at(state.q_springs)[2] * (self.stiffness_std * (state.q_springs - model.rest))
            parts["stiffness"] = follow.T @ bent @ _shared(model)
        if self.motor_angle_std is not None:
            direct, by_springs = motor_slopes(state, load)
            by_law = (by_springs - state.load.coupling.T) @ follow  # of a tension by law, not conjugate to its input
            parts["motor_angles"] = -(direct + followed + by_law) * self.motor_angle_std
        return parts


def _shared(model: SoftModel) -> FloatArray:
    """Which springs have an error in common: those that bend one link, of one wall; shape (n_springs, n), ones and zeros."""
    groups = [list(group.springs) for group in model.spring_groups]
    grouped = {place for group in groups for place in group}
    groups += [[place] for place in range(model.n_springs) if place not in grouped]
    return np.stack([np.isin(np.arange(model.n_springs), group) for group in groups], axis=1).astype(np.float64)


def _spread(name: str, value: Any, count: int, unit: str) -> FloatArray | None:
    if value is None:
        return None
    return read_only(one_each(name, value, count, unit, positive=True))
