r"""How far a force that is estimated from motor torques may be off, if nothing is known of dry friction but its limits.

Friction that may have any value is an unknown load :math:`\sum_i \sigma_i c_i` on the strains: for a section that bends it has
two components, together at most of size 1, for a guide one. To first order about the estimate it changes the motor torques at a
given force, springs in equilibrium, by :math:`\sum_i T_i (\sigma_i - \sigma_i^0)`, and so the estimate by

.. math:: \delta f = -\left(\frac{d\tau_m}{df}\right)^+ \sum_i T_i (\sigma_i - \sigma_i^0)

The derivatives are those of the robot that friction does not stiffen.
"""

from __future__ import annotations

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import NeutralEquilibrium
from softrobots.model.friction_coordinates import friction_of, with_given_friction
from softrobots.statics.contact.pressed_gaps import motor_slopes, pressed_gaps
from softrobots.statics.contact.touch import NO_FORCES, ForceTable
from softrobots.statics.elastic_state import ElasticProblem, ElasticState
from softrobots.statics.kinematics import frame_jacobian
from softrobots.statics.loads import Load
from softrobots.statics.sensitivity import inverse_in_contact
from softrobots.statics.tip_force.force_search import Directions


def friction_range(state: ElasticState, motors: FloatArray, load: Load, frame: str, span: FloatArray) -> FloatArray | None:
    """Return the least and largest change of each component of an estimated force, shape (3, 2) [N]; None without friction.

    Infinite where the robot would be in a neutral equilibrium without its friction.

    Args:
        state: The robot under the force.
        motors: Its actuators, shape (n_motors,).
        load: The load with the force.
        frame: Where the force acts.
        span: Orthonormal directions that it may have, shape (k, 3); those that motors do not feel are left out.
    """
    model = state.model
    if model.structure.friction is None:
        return None
    sizes, torques = friction_of(model, model.structure.strains(motors, state.q_springs))
    forces = NO_FORCES if state.touch is None else ForceTable.of(state.touch.gaps, state.touch.forces)

    def carrying(torque: FloatArray) -> ElasticState:
        """The robot at the same coordinates with given torque of friction."""
        constant = 0.0, torque, np.zeros((len(torque), len(torque)))
        return ElasticProblem(with_given_friction(model, lambda _: constant), motors, load).state(state.q_springs, forces)

    here = carrying(sizes @ torques)
    others = [carrying(sizes @ torques + torque) for torque in torques]
    pressed, slope = pressed_gaps(here), motor_slopes(here, load)[1]
    by_motors, by_springs = here.point.columns(frame_jacobian(model, here.q, frame)[:3])
    rows = np.zeros((0, model.n_springs)) if pressed is None else pressed.by_springs
    try:
        inverse = inverse_in_contact(model, here.tangent, rows)
    except NeutralEquilibrium:
        return read_only(np.tile([-np.inf, np.inf], (3, 1)))
    felt = slope @ inverse.springs_by_load
    if pressed is not None:
        felt = felt + pressed.by_motors.T @ inverse.forces_by_load
    left, values, right, keep = Directions.of(by_motors.T + felt @ by_springs.T, model.reach, span)
    count = len(values)
    solve = right[:count][keep].T @ (left[:, :count].T[keep] / values[keep][:, None])
    moved = np.array([other.load.motors - here.load.motors - felt @ (other.residual - here.residual) for other in others])
    by_friction = solve @ np.where(model.actuators.feels, moved, 0.0).T
    n = 2 * len(model.structure.friction.limit)
    together = np.linalg.norm(by_friction[:, :n].reshape(3, -1, 2), axis=2).sum(axis=1) + np.abs(by_friction[:, n:]).sum(axis=1)
    middle = by_friction @ sizes
    return read_only(np.stack([middle - together, middle + together], axis=1))
