r"""What contacts hold while springs and actuators move a little: pressed gaps and, where they stick, both ways of sliding.

A contact that sticks holds the velocity of its touching material point, :math:`G \delta y = 0` and :math:`T \delta y = 0`, so
that bodies roll on each other without sliding. It turns its friction with the normal and takes it along over the surface.
Rolling that spins at the same time has no potential (it is nonholonomic): the stiffness of a robot whose sticking contacts
leave both is not symmetric, by about the friction times the radius of the body.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.environment.environment import check_environment
from softrobots.environment.gaps import Surroundings
from softrobots.statics.contact.contact import SLIPS, STICKS
from softrobots.statics.contact.coulomb import balance_of
from softrobots.statics.contact.last_state import MARGIN, Given, Sliding, forces_of
from softrobots.statics.contact.pressed_gaps import PressedGaps, pressed_gaps, whole_stiffness
from softrobots.statics.contact.sliding import SlidingRobot
from softrobots.statics.elastic_state import ElasticState, elastic_state
from softrobots.statics.equilibrium_result import Equilibrium

_RIM = 1e-6  # share of the cone that is left, at least, where friction is taken as within it
_DEPENDENT, _FORCED = 1e-9, 1e-6  # least singular value of independent motions; slip that is none, both relative
_NO_FORCES = np.zeros(0), np.zeros((0, 2))  # nothing is carried but the forces of the equilibrium


def held_contacts(equilibrium: Equilibrium, what: str, *, moves: bool = False) -> PressedGaps | None:
    """Return what the contacts of an equilibrium hold; None if nothing is pressed. `what` asks, in words.

    Raises:
        ParameterError: If a contact slips or is about to; or must, as soon as actuators or obstacles move (`moves`).
    """
    at = _state(equilibrium, what)
    if isinstance(at, ElasticState):
        return pressed_gaps(at)
    rows, by_motors, _ = held = at[1]
    if moves:
        displacements = np.concatenate([by_motors, np.eye(len(rows), len(rows) // 3)], axis=1)
        followed = rows @ np.linalg.lstsq(rows, displacements, rcond=_DEPENDENT)[0]
        if np.abs(followed - displacements).max() > _FORCED * np.abs(displacements).max():
            required = f"one whose springs can follow while its contacts stick: {what} takes none where something must slip"
            raise ParameterError("equilibrium", equilibrium.contacts, required)
    return held


def held_stiffness(equilibrium: Equilibrium, what: str) -> tuple[FloatArray, PressedGaps | None]:
    """Return the stiffness over actuators, then elastic coordinates, shape (n, n), and `held_contacts`; raises as that."""
    at = _state(equilibrium, what)
    if isinstance(at, ElasticState):
        return whole_stiffness(at, equilibrium.load), pressed_gaps(at)
    robot, held = at
    upper = robot.at.point.motor_derivatives(robot.joint_load(*robot.carried(*_NO_FORCES)))
    return -np.block([list(upper), [equilibrium.coupling, -equilibrium.tangent_stiffness]]), held


def _state(equilibrium: Equilibrium, what: str) -> ElasticState | tuple[SlidingRobot, PressedGaps]:
    """The state of an equilibrium without friction; or the robot there, and what its sticking contacts hold."""
    model, motors, springs = equilibrium.model, equilibrium.q_motors, equilibrium.q_springs
    rubbing = tuple(one for one in equilibrium.contacts if one.status in (STICKS, SLIPS))
    if not rubbing:
        return elastic_state(model, motors, springs, equilibrium.load)
    for one in rubbing:
        if one.status == SLIPS or one.cone_share > 1.0 - _RIM:
            does = "slips" if one.status == SLIPS else "is about to slip"
            required = (
                "one whose contacts stick, or have no friction: where one slips its friction follows the normal force, and"
            )
            required = f"{required} the stiffness is not symmetric; {what} takes none"
            raise ParameterError("equilibrium", f"{one.link} on {one.obstacle}, which {does}", required)
    environment = check_environment(equilibrium.environment)
    given = Given(model, motors, equilibrium.load, environment, Surroundings(model, environment))
    gaps = given.surroundings.at(equilibrium.q, MARGIN * model.reach)
    robot = SlidingRobot(given, Sliding(0.0, gaps, forces_of(gaps, rubbing)))
    near: Any = robot.contacts(springs)
    normal, friction = robot.carried(*_NO_FORCES)
    found = balance_of(robot, springs, near, normal, friction, normal > 0.0)
    moved, one = robot.by_motors(found), robot.pressed(found)
    by_motors = np.concatenate([moved.gaps[one], *moved.sliding[one]])
    return robot, PressedGaps(robot.held_rows(found), by_motors, np.concatenate([normal[one], friction[one].ravel()]))
