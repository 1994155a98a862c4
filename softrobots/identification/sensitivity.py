"""Derivatives of an equilibrium, or of an estimated load, by parameters of the robot, its actuators and its loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, instance_of, read_only
from softrobots.core.errors import ParameterError, short
from softrobots.core.summary import Part, Summarised, Table
from softrobots.dynamics.vibration import VibrationModes
from softrobots.identification.derivatives.contact_derivatives import ContactDerivatives
from softrobots.identification.derivatives.frequency_derivatives import frequency_slopes
from softrobots.identification.derivatives.friction_derivatives import friction_loads
from softrobots.identification.derivatives.rows_and_states import Outputs, States
from softrobots.identification.model_change import ModelChange, present_change
from softrobots.identification.parameters import ParameterSet
from softrobots.identification.residual_derivatives import AdjointRows, EquilibriumDerivatives
from softrobots.model.friction_coordinates import memory_of
from softrobots.model.soft_model import SoftModel
from softrobots.statics.equilibrium import Equilibrium, check_same_model
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.load_estimation import LoadEstimate
from softrobots.statics.loads import check_no_contact
from softrobots.statics.tip_force.force_search import OBSERVABLE


@dataclass(frozen=True, eq=False, repr=False)
class Sensitivity(Summarised):
    """Derivatives by P parameters at an equilibrium, exact; made by `softrobots.sensitivity`.

    Loads are constant in the world, actuators as commanded, elastic coordinates follow. Each derivative is computed when it is
    asked for; how the model changes, which takes most of the time, once for a robot and its parameters.
    """

    equilibrium: Equilibrium
    """The equilibrium; of an estimate, that under the estimated force."""
    parameters: ParameterSet
    """The parameters."""
    estimate: LoadEstimate | None = None
    """The estimate, if the force follows the measured motor torques."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each parameter, P of them."""
        return self.parameters.names

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter."""
        return self.parameters.units

    def __repr__(self) -> str:
        """What is derived by which parameters."""
        return f"Sensitivity({self.equilibrium.model.pinocchio.name!r} by {short(', '.join(self.names))})"

    def summary_parts(self) -> list[Part]:
        """Return the derivatives of the position of the tip, a line a parameter."""
        rows: list[tuple[str, ...]] = [("parameter", "unit", "tip x [m per unit]", "y", "z")]
        for name, unit, moved in zip(self.names, self.units, self.tip_position.T, strict=True):
            rows.append((name, unit, *(f"{number:.4g}" for number in moved)))
        return [Table(rows, right=(2, 3, 4))]

    @cached_property
    def q_springs(self) -> FloatArray:
        """Derivative of the elastic coordinates, shape (n_springs, P) [rad or m per unit].

        With given lengths they are combinations of strains that depend on the stiffness: those of the present robot.
        """
        held = self.equilibrium.model.structure.muscle_lengths
        return self._strains if held is None else read_only(held.elastic @ self._strains)

    @cached_property
    def _strains(self) -> FloatArray:
        """Derivative of the strains, shape (n_strains, P)."""
        return self._of(Outputs(strains=np.eye(self._at.strains.shape[1])[None]))

    @cached_property
    def motor_torques(self) -> FloatArray:
        """Derivative of the load on each actuator, shape (n_motors, P) [N m or N per unit]."""
        return self._of(Outputs(loads=np.eye(self.equilibrium.model.n_motors)[None]))

    @cached_property
    def tip_pose(self) -> FloatArray:
        """Derivative of the pose of the tip, translation, then rotation vector, world axes, shape (6, P) [m, rad per unit]."""
        return self.frame(self.equilibrium.model.tip)

    @property
    def tip_position(self) -> FloatArray:
        """Derivative of the position of the tip, shape (3, P) [m per unit]."""
        return self.tip_pose[:3]

    def frame(self, name: str) -> FloatArray:
        """Derivative of the pose of a frame or of a marker among the parameters, as `tip_pose`, shape (6, P).

        Raises:
            NameNotFound: If there is no such frame.
        """
        at = self.parameters.markers.get(name, name)
        slopes = np.array(self._of(Outputs(frame=at, pose=np.eye(6)[None])))
        for place, one in self.parameters.places("marker"):
            if one.place.names[0] == name:
                slopes[:3, place] += self._frame_axes(at)[:, one.place.parts[0]]
        return read_only(slopes)

    def gradient(self, weights: Any) -> FloatArray:
        """Derivative of a weighted sum of components of the pose of the tip by all parameters, shape (P,).

        In reverse: one linear solve, whatever the number of parameters.

        Args:
            weights: Weights of the position, shape (3,), or of position and rotation vector, shape (6,), world axes.

        Raises:
            ParameterError: If the shape differs or a number is not finite.
        """
        size = 6 if np.shape(weights) == (6,) else 3
        row = np.zeros((1, 1, 6))
        row[0, 0, :size] = finite_array("weights", weights, (size,))
        return np.asarray(self._of(Outputs(frame=self.equilibrium.model.tip, pose=row))[0])

    @cached_property
    def force(self) -> FloatArray:
        r"""Derivative of the estimated force at the same measured torques, shape (3, P) [N per unit].

        :math:`df/dp = -(d\tau_m/df)^+\, \partial\tau_m/\partial p`, zero along unobservable directions. Where more than three
        torques leave a residual that no force explains, terms of its size are left out.

        Raises:
            ParameterError: If it is the sensitivity of an equilibrium.
        """
        if self.estimate is None:
            raise ParameterError("force", None, "asked of the sensitivity of a LoadEstimate")
        model = self.equilibrium.model
        slopes, by_force = self._at_constant_load(Outputs(loads=np.eye(model.n_motors)[None]))
        felt = model.actuators.feels[:, None]
        left, values, right = np.linalg.svd(by_force * felt, full_matrices=False)
        inverse = np.where(values > OBSERVABLE * model.reach, 1.0 / np.maximum(values, 1e-300), 0.0)
        return read_only(-(right.T * inverse) @ left.T @ (slopes * felt))

    @cached_property
    def normal_forces(self) -> FloatArray:
        """Derivative of the normal force of each contact of the equilibrium, in their order, shape (k, P) [N per unit]."""
        count = len(self.equilibrium.contacts)
        return self._of(Outputs(forces=np.eye(count)[None])) if count else np.zeros((0, len(self.names)))

    def frequencies(self, modes: VibrationModes) -> FloatArray:
        """Derivatives of natural frequencies, shape (n_modes, P) [Hz per unit].

        Of frequencies that are the same, those of round robots, they are the slopes with which these part, ascending.

        Args:
            modes: The modes of the equilibrium, `vibration_modes(model, equilibrium)`.

        Raises:
            ParameterError: If the modes are those of another equilibrium, or of one in contact.
        """
        check_no_contact(self.equilibrium, "a derivative of frequencies")
        instance_of("modes", modes, VibrationModes, "VibrationModes of the equilibrium")
        mine, other = self.equilibrium, modes.equilibrium
        if not (
            other.model == mine.model and other.load.same_as(mine.load) and np.array_equal(other.q_springs, mine.q_springs)
        ):
            raise ParameterError("modes", modes, "the modes of the equilibrium of the sensitivity")
        return read_only(frequency_slopes(modes, self.parameters, self._at.strains[0], self._strains, self._tip))

    def check(self) -> None:
        """Prepare what all derivatives need; see `sensitivity` for what it raises."""
        present_change(self.parameters)
        _ = self._at.compliance if self._at.contact is None else None

    def _of(self, outputs: Outputs) -> FloatArray:
        """Derivatives of rows of outputs, shape (L, P); in an estimate with the change of the force."""
        slopes, by_force = self._at_constant_load(outputs)
        return read_only(slopes if self.estimate is None else slopes + by_force @ self.force)

    def _at_constant_load(self, outputs: Outputs) -> tuple[FloatArray, FloatArray]:
        """Derivatives of rows of outputs by the parameters, shape (L, P), and by the force at the tip, shape (L, 3)."""
        rows = AdjointRows(self._at, outputs)
        slopes, by_force = self._without_friction(rows)
        if self.equilibrium.model.structure.friction is not None:
            slopes = slopes + rows.virtual[0] @ self._friction
        return slopes, by_force

    @cached_property
    def _friction(self) -> FloatArray:
        """Change of the load of friction on the strains at the same strains, shape (n_strains, P).

        What friction remembers stays, but for a robot that nothing has moved: that remembers its shape at rest.
        """
        friction, memory = self.equilibrium.model.structure.friction, memory_of(self.equilibrium.model)
        change = present_change(self.parameters)
        if friction is not None and not np.array_equal(memory.bending, friction.untouched.bending):
            change = ModelChange(len(self.names), {name: one for name, one in change.by_number.items() if name != "rest"})
        loads = friction_loads(self._at, memory.bending[None], change, lambda rows: self._without_friction(rows)[0][None])
        return np.asarray(loads[0])

    def _without_friction(self, rows: AdjointRows) -> tuple[FloatArray, FloatArray]:
        """The same while the load of friction stays."""
        kinds, by_load = self.parameters.direct_slopes.keys(), rows.by_loads() if self._loaded else {}
        by_force = by_load.get(self._tip, np.zeros((*rows.virtual.shape[:2], 6)))
        direct = {"motor": rows.by_actuators, "wrench": by_force, "gravity": by_load.get("", by_force[..., :3])}
        if "base" in kinds:
            direct["base"] = rows.by_base()
        slopes = rows.by_numbers(present_change(self.parameters), {name: direct[name] for name in kinds})[0]
        if self._at.contact is not None:
            slopes += rows.by_contacts(self.parameters)[0]
        return slopes, by_force[0, :, :3]

    @property
    def _tip(self) -> str:
        """The frame of the force: that of the estimate, or the tip."""
        return self.equilibrium.model.tip if self.estimate is None else self.estimate.frame

    @cached_property
    def _loaded(self) -> set[str]:
        """Kinds of loads that derivatives are needed by."""
        kinds = self.parameters.direct_slopes.keys() & {"wrench", "gravity"}
        return kinds if self.estimate is None else kinds | {"wrench"}

    @cached_property
    def _at(self) -> EquilibriumDerivatives:
        states = States.of([self.equilibrium])
        loads = dict(states.loads)
        if "wrench" in self._loaded:
            loads.setdefault(self._tip, np.zeros((1, 6)))
        if "gravity" in self._loaded:
            loads.setdefault("", np.zeros((1, 3)))
        contact = ContactDerivatives(self.equilibrium) if self.equilibrium.contacts else None
        return EquilibriumDerivatives(self.equilibrium.model, states._replace(loads=loads), contact)

    def _frame_axes(self, frame: str) -> FloatArray:
        return np.array(frame_placement(self.equilibrium.model, self.equilibrium.q, frame).rotation)


def sensitivity(
    model: SoftModel, equilibrium: Equilibrium | LoadEstimate, parameters: str | Sequence[str] | ParameterSet
) -> Sensitivity:
    """Differentiate an equilibrium, or an estimated load, by parameters of the robot, of its actuators and of its loads.

    By implicit differentiation at the state (`softrobots.identification.residual_derivatives`): exact to 1e-8, without solving
    for another equilibrium. The first call for a robot and names loads four robots for each name, which is kept. After that the
    `gradient` of a new equilibrium, with all that is prepared for it, takes as long as 1.3 to 1.8 equilibria of an arm,
    0.4 to 0.6 of arms and tubes with sections, by 1 to 60 parameters; a further one of the same equilibrium 0.7 and 0.1.

    At a knee (the end of a plateau, a tendon that goes slack) they are the derivatives of the side that the state is on.
    Friction of sections that bend slips or sticks as it does, and what it remembers stays. Pressed contacts stay pressed.

    Args:
        model: The robot.
        equilibrium: An equilibrium of it, or an estimate of its load; then the force follows the measured torques.
        parameters: Names as in `softrobots.identification.parameters`, e.g. `("stiffness", "link[1].density", "force")`, or a
            set of them with markers.

    Returns:
        The derivatives. They are cheap to compute and are not saved.

    Raises:
        ParameterError: If the equilibrium belongs to another model, its robot has friction of guides, or friction of segments
            whose muscle lengths are given, a name is that of several parts whose values differ, or the structure of the robot
            changes with a parameter. In contact also if a contact has friction, touches without a force, or holds what another
            one holds, the robot has dry friction or given muscle lengths, or it is an estimate.
        NameNotFound: If there is no such parameter; with all that there are.
        NeutralEquilibrium: If the tangent stiffness is singular: a neutral equilibrium has no derivative.
    """
    estimate, at = (equilibrium, equilibrium.equilibrium) if isinstance(equilibrium, LoadEstimate) else (None, equilibrium)
    check_same_model(model, at)
    if estimate is not None:
        check_no_contact(at, "a derivative of an estimate")
    friction = model.structure.friction
    if at.contacts and (friction is not None or model.structure.muscle_lengths is not None):
        required = "one without contacts, of a robot with dry friction or given muscle lengths"
        raise ParameterError("equilibrium", list(at.contacts), required)
    if friction is not None and (friction.guided or model.structure.muscle_lengths is not None):
        requirement = "a robot without friction of guides, and without friction of segments whose muscle lengths are given"
        raise ParameterError("model", model.pinocchio.name, f"{requirement}, for derivatives by parameters")
    if not isinstance(parameters, ParameterSet):
        names = (parameters,) if isinstance(parameters, str) else tuple(parameters)
        parameters = _named(model, model.robot is not None, names)
    elif parameters.present != model:
        raise ParameterError("parameters", parameters.present, f"those of the model given, {model!r}")
    found = Sensitivity(at, parameters, estimate)
    found.check()
    return found


@lru_cache(maxsize=32)
def _named(model: SoftModel, with_robot: bool, names: tuple[str, ...]) -> ParameterSet:
    """Parameters by name, looked up once."""
    return ParameterSet.of(model, names)
