r"""Derivatives of an equilibrium in contact without friction, while its pressed contacts stay pressed.

With the Hessian of the Lagrangian `K`, the gradients `G` of the pressed gaps `g` and their forces :math:`\lambda`, a parameter
`p` changes elastic coordinates `y` and forces by

.. math:: \begin{pmatrix} K & -G^T \\ G & 0 \end{pmatrix} \begin{pmatrix} \delta y \\ \delta\lambda \end{pmatrix} =
   -\begin{pmatrix} \partial (r - G^T \lambda) / \partial p \\ \partial g / \partial p \end{pmatrix} \delta p

(Nocedal and Wright, Numerical Optimization, 2006, section 16.2; Fiacco, Introduction to Sensitivity and Stability Analysis in
Nonlinear Programming, 1983, theorem 3.2.2, which asks for strict complementarity and independent gradients). Gaps and contact
load at the same coordinates and forces are differentiated by differences of robots loaded with other values, as the numbers of
a model are (`softrobots.identification.model_change`).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache, partial
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.core.errors import ParameterError
from softrobots.environment.environment import Environment, check_environment
from softrobots.identification.model_change import differences
from softrobots.identification.parameters import ParameterSet
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.certificate import active_contacts
from softrobots.statics.contact.contact import Contact
from softrobots.statics.contact.pressed_gaps import check_no_rubbing, motor_slopes
from softrobots.statics.contact.touch import NEAR, NO_FORCES, surfaces_of, touch_at
from softrobots.statics.elastic_state import TOLERANCE, elastic_state, largest_residual
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.sensitivity import inverse_in_contact

_INDEPENDENT = 1e-9  # least singular value of gradients over the largest


class ContactDerivatives:
    """An equilibrium in contact, and what the derivatives of all outputs need of its contacts."""

    def __init__(self, equilibrium: Equilibrium) -> None:
        """Evaluate the contacts.

        Raises:
            ParameterError: If a contact has friction or touches without a force, or gradients of gaps depend on each other.
            NeutralEquilibrium: If the stiffness beside the contacts is singular.
        """
        check_no_rubbing(equilibrium, "a derivative by parameters")
        touching = [one for one in equilibrium.contacts if not one.strict]
        if touching:
            requirement = "one whose contacts are pressed: without force one opens or presses, so that there is no derivative"
            raise ParameterError("equilibrium", _named(touching), requirement)
        self._equilibrium, model = equilibrium, equilibrium.model
        self._environment = check_environment(equilibrium.environment)
        state: Any = elastic_state(model, equilibrium.q_motors, equilibrium.q_springs, equilibrium.load)
        rounding = largest_residual(model, state.scale, TOLERANCE)
        pressed = active_contacts(state.touch, model.reach, rounding).pressed
        self._keys = [state.touch.gaps.keys[place] for place in pressed.tolist()]
        self._forces, rows = state.touch.forces[pressed], state.touch.rows[pressed]
        self.by_motors: FloatArray = state.touch.motor_rows[pressed]
        """Derivatives of the pressed gaps by the actuators, shape (k, n_motors)."""
        sizes = np.linalg.svd(rows / np.sqrt(model.stiffness), compute_uv=False)
        if len(sizes) < len(rows) or sizes[-1] <= _INDEPENDENT * sizes[0]:
            requirement = "one whose contacts hold different motions: here forces are not unique"
            raise ParameterError("equilibrium", _named(equilibrium.contacts), requirement)
        self._inverse = inverse_in_contact(model, state.tangent, rows)
        whole = motor_slopes(state, equilibrium.load)
        free = motor_slopes(state._replace(touch=None), equilibrium.load)
        self._loads_by_springs = whole[1] - free[1]
        self.loads_by_motors = whole[0] - free[0]
        """Derivatives of what constant contact forces load the actuators with, by actuators, shape (n_motors, n_motors)."""

    def rows_of(self, elastic: FloatArray, loads: FloatArray, forces: FloatArray | None) -> tuple[FloatArray, FloatArray]:
        """Return the adjoint rows of outputs: derivatives by a load on the springs, and by gaps that the springs must open.

        Args:
            elastic: Derivatives of the outputs by the elastic coordinates without contacts, shape (1, L, n_springs).
            loads: Weights of the loads on the actuators in the outputs, shape (1, L, n_motors).
            forces: Weights of the normal forces, shape (1, L, k); None without any.

        Returns:
            Shapes (1, L, n_springs) and (1, L, k).
        """
        inverse, elastic = self._inverse, elastic + loads @ self._loads_by_springs
        by_forces = loads @ self.by_motors.T + (0.0 if forces is None else forces)
        by_load = elastic @ inverse.springs_by_load + by_forces @ inverse.forces_by_load
        return by_load, elastic @ inverse.springs_by_gap + by_forces @ inverse.forces_by_gap

    def along(self, parameters: ParameterSet, rows: FloatArray, loads: FloatArray, gaps: FloatArray) -> FloatArray:
        """What gaps and contact load at constant coordinates add to derivatives by parameters, shape (1, L, P).

        Args:
            parameters: The parameters; those of the model and of its base count.
            rows: Derivatives of the outputs by a load on the springs, shape (1, L, n_springs).
            loads: Weights of the loads on the actuators, shape (1, L, n_motors).
            gaps: Derivatives of the outputs by gaps that the springs must open, shape (1, L, k).

        Raises:
            ParameterError: If other places of the robot touch at values of a parameter nearby.
        """
        total, here = np.zeros((*rows.shape[:2], len(parameters.names))), self._at(parameters.present, self._environment)
        for place, one in enumerate(parameters.parameters):
            if parameters.of_model[place]:
                slopes = differences(one, float(parameters.values[place]), here, partial(self._changed, parameters, place))
            elif one.place.kind == "base":
                axis = one.place.parts[0] + (3 if one.place.names[0] == "rotation" else 0)
                slopes = differences(one, 0.0, here, partial(self._with_base, axis))
            else:
                continue
            total[..., place] = rows @ slopes["springs"] + loads @ slopes["motors"] - gaps @ slopes["gaps"]
        return total

    def _changed(self, parameters: ParameterSet, place: int, value: float) -> dict[str, FloatArray]:
        return self._at(_changed(parameters, place, value), self._environment)

    def _with_base(self, axis: int, way: float) -> dict[str, FloatArray]:
        """With the base moved along an axis of the world, or turned about it [m or rad]: obstacles move the other way."""
        motion = np.zeros(6)
        motion[axis] = -way
        back = pin.exp6(motion)
        around = replace(self._environment, obstacles=tuple(one.moved(back) for one in self._environment))
        return self._at(self._equilibrium.model, around)

    def _at(self, model: SoftModel, environment: Environment) -> dict[str, FloatArray]:
        """Pressed gaps and contact load of a robot at the same coordinates and forces; of other shape if other places touch."""
        found = self._equilibrium
        point = model.coordinates.at(found.q_motors, found.q_springs)
        q, surfaces = model.embed(point.joints), surfaces_of(model, environment)
        touch = touch_at(surfaces, q, point, NO_FORCES, NEAR * model.reach)
        numbers = {key: place for place, key in enumerate(touch.gaps.keys)}
        places = [numbers[key] for key in self._keys if key in numbers]
        if len(places) < len(self._keys):
            return {"gaps": np.zeros(0), "springs": np.zeros(0), "motors": np.zeros(0)}
        return {
            "gaps": touch.gaps.values[places],
            "springs": self._forces @ touch.rows[places],
            "motors": self._forces @ touch.motor_rows[places],
        }


def _named(contacts: Iterable[Contact]) -> list[str]:
    return [f"{one.link} on {one.obstacle}" for one in contacts]


@lru_cache(maxsize=256)
def _changed(parameters: ParameterSet, place: int, value: float) -> SoftModel:
    """Robot with another value of a parameter, loaded once."""
    values = np.array(parameters.values)
    values[place] = value
    return parameters.model(values)
