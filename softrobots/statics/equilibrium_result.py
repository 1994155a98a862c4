"""Static equilibrium of a robot with joint springs, as a certified result; `softrobots.statics.equilibrium` finds it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.blas_threads import one_blas_thread
from softrobots.core.checks import FloatArray, instance_of, read_only
from softrobots.core.errors import ParameterError
from softrobots.core.summary import Part, Summarised
from softrobots.model.actuators import slack_tendons
from softrobots.model.link_limits import LinkLimits, link_limits, link_moments
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.contact.certificate import null_space
from softrobots.statics.contact.clearance import Clearance, clearance
from softrobots.statics.contact.contact import Contact, with_contacts
from softrobots.statics.contact.touch import TOUCHING
from softrobots.statics.equilibrium_summary import equilibrium_parts
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.loads import Load
from softrobots.statics.stability import Stability, stability

_LENGTH_ROUNDING = np.array([-1e-12, 1e-12])  # [m], of muscle lengths that are computed from the shape


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(Summarised):
    """A solved static equilibrium; knows its model, load and motors, and can be saved with `softrobots.save_result`.

    The sign of a torque is that of the load: the negative of the torque that the spring or motor exerts.
    """

    model: SoftModel
    """The robot."""
    load: Load
    """The load."""
    method: str
    """The solver."""
    q_motors: FloatArray
    """Motor coordinates, shape (n_motors,) [rad or m]."""
    q_springs: FloatArray
    """Spring coordinates, shape (n_springs,) [rad or m]."""
    q: FloatArray
    """Pinocchio's configuration, shape (nq,)."""
    spring_torques: FloatArray
    """Torque of each spring, `k (q - rest)` if it is linear, shape (n_springs,) [N m or N]."""
    motor_torques: FloatArray
    """Load on each motor, `J_m^T w - g_m`, shape (n_motors,) [N m or N]."""
    tangent_stiffness: FloatArray
    """Derivative of the residual, shape (n_springs, n_springs); in contact the Hessian of the Lagrangian."""
    coupling: FloatArray
    """Derivative of the load on the elastic coordinates with respect to the actuators, shape (n_springs, n_motors).

    In contact at constant contact forces.
    """
    residual: float
    """Norm of the out-of-balance torque [N m]."""
    tolerance: float
    """Largest residual that was accepted [N m]."""
    iterations: int
    """Evaluations of the residual, or steps of the search or estimation that ended here."""
    stable: bool
    """Certified: a small disturbance stays small, see `stability`."""
    contacts: tuple[Contact, ...] = ()
    """Where the robot touches obstacles or itself, pressed or not; empty in free space."""
    contact_gradients: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    """Derivative of the gap of each pressed contact by the springs, shape (k, n_springs); stability is that of motions along
    which these gaps stay zero."""

    def summary_parts(self) -> list[Part]:
        """Return tables of motors, actuators, springs, inflated links and contacts, then tip and certificates."""
        return equilibrium_parts(self)

    @cached_property
    def stability(self) -> Stability:
        """Stable, neutral, divergent or flutter, with the eigenvalues that say so."""
        point = self.model.coordinates.at(self.q_motors, self.q_springs)
        return stability(self.model, point, self.q, self.tangent_stiffness, self._free_motions)

    @cached_property
    def _free_motions(self) -> FloatArray | None:
        """Orthonormal motions of the springs that the pressed contacts leave, shape (n_springs, n); None if all are left."""
        return null_space(self.contact_gradients) if len(self.contact_gradients) else None

    @property
    def contact_forces_unique(self) -> bool:
        """Whether no other normal forces balance the robot: the gradients of the pressed gaps are independent.

        Otherwise `contacts` has those of least norm.
        """
        left = 0 if self._free_motions is None else self._free_motions.shape[1] - self.model.n_springs
        return -left == len(self.contact_gradients)

    @property
    def environment(self) -> Any:
        """Obstacles, a `softrobots.Environment`; None in free space."""
        return self.load.environment

    @property
    def conservative(self) -> bool:
        """Whether the load has a potential (no world-fixed moment), so that the tangent stiffness is symmetric."""
        return self.load.conservative

    @property
    def converged(self) -> bool:
        """Whether the residual meets the tolerance, and in contact pressed gaps are zero, and none is penetrated."""
        largest = TOUCHING * self.model.reach
        gaps = (contact.gap if contact.normal_force > 0.0 else min(contact.gap, 0.0) for contact in self.contacts)
        return self.residual <= self.tolerance and all(abs(gap) <= largest for gap in gaps)

    @property
    def transform_tip_to_world(self) -> Any:
        """Pose of the tip, a `pinocchio.SE3` of the caller's own [m]."""
        return frame_placement(self.model, self.q, self.model.tip)

    @cached_property
    def tip_pose(self) -> FloatArray:
        """Pose of the tip in the world as a homogeneous matrix: rotation, position in the last column, shape (4, 4) [m]."""
        return read_only(np.array(self.transform_tip_to_world.homogeneous))

    @cached_property
    def tip_position(self) -> FloatArray:
        """Position of the tip in the world, shape (3,) [m]."""
        return read_only(np.array(self.transform_tip_to_world.translation))

    def frame_jacobian(self, frame: str | None = None) -> FloatArray:
        """Geometric Jacobian of a frame, the tip by default: its velocity per velocity of each joint of `model.pinocchio`.

        Shape (6, nv), linear rows first [m/rad; rad/rad], world axes, [Troise 2021] (4). How the loaded tip follows the motors
        is `elastostatic_jacobian`.

        Raises:
            NameNotFound: If there is no such frame.
        """
        return frame_jacobian(self.model, self.q, self.model.tip if frame is None else frame)

    def clearance(self, environment: Any) -> Clearance:
        """Smallest gap between the robot in this pose and obstacles, of which the equilibrium need not know; and where it is.

        Raises:
            ParameterError: If `environment` is none, an obstacle moves, or there is nothing that the robot could touch.
            DescriptionError: If the robot has no shapes that can touch.
        """
        return clearance(self.model, self.q, environment)

    @cached_property
    def link_moments(self) -> FloatArray:
        """Moment at each inflated link, both springs combined (Euclidean norm), shape (n_links,) [N m].

        Of a link with two hinges it is the larger of theirs. Empty if the model names no inflated links. The springs of a
        section carry the moment at its middle; its entry is the largest along it, with the moment linear between the middles
        of the sections of a segment, and beyond them.
        """
        return read_only(np.array([moments.max() for moments in link_moments(self.model, self.spring_torques)]))

    @cached_property
    def link_limits(self) -> LinkLimits:
        """What each inflated link has left until its wall goes slack and until it wrinkles, with its axial force."""
        parts = {"q": self.q, "torques": self.spring_torques, "tensions": self.muscle_forces}
        return link_limits(self.model, with_contacts(self.load.wrenches, self.contacts), self.load.gravity, **parts)

    @cached_property
    def muscle_lengths(self) -> FloatArray:
        """Length of each muscle, shape (n_muscles,) [m]."""
        structure = self.model.structure
        strains = structure.strains(self.q_motors, self.q_springs)
        return read_only(structure.muscle_paths.rest + structure.muscle_paths.at(strains).change)

    @property
    def muscle_forces(self) -> FloatArray:
        """Tension that each muscle must exert, negative where it pushes, shape (n_muscles,) [N]."""
        return self.motor_torques[len(self.motor_torques) - len(self.model.muscles) :]

    @property
    def muscle_slack(self) -> tuple[bool, ...]:
        """Which muscles are slack: elastic tendons without tension."""
        return slack_tendons(self.model.muscles, self.muscle_forces)

    @cached_property
    def strains(self) -> FloatArray:
        """Strains of each section, base to tip, shape (n_sections, 4): kx, ky, twist [rad/m], stretch [-]."""
        structure = self.model.structure
        lengths = np.array([section.length for section in structure.section_table]).reshape(-1, 1)
        return read_only(structure.section_coordinates(self.q_motors, self.q_springs) / lengths + (0.0, 0.0, 0.0, 1.0))

    @cached_property
    def saturated(self) -> tuple[bool, ...]:
        """Which inflated links are on the plateau of their moment; none of those with linear springs."""
        beyond = self.model.springs.saturated(self.q_springs)
        return tuple(not beyond.isdisjoint(group.springs) for group in self.model.spring_groups)

    @property
    def wrinkled(self) -> bool:
        """Whether a link carries its wrinkling moment (3) or more, with its axial force, or is on its plateau.

        Linear springs are no longer valid there; a slack wall has softened from `link_limits.slack_margins` of zero on.
        """
        return bool(np.any(self.link_limits.wrinkling_margins <= 0.0)) or any(self.saturated)

    @property
    def within_limits(self) -> bool:
        """Whether every actuator and every elastic joint is within its limits; statics does not clip.

        Muscles must be within both their lengths and their tensions, whichever is given.
        """
        structure = self.model.structure
        joints = self.model.coordinates.at(self.q_motors, self.q_springs).joints
        return (
            _within(self.q_motors, self.model.motor_limits)
            and _within(joints, structure.elastic_limits)
            and _within(self.muscle_lengths, self.model.actuators.muscle_lengths + _LENGTH_ROUNDING)
            and _within(self.muscle_forces, self.model.actuators.muscle_forces)
        )

    @cached_property
    def eigenvalues(self) -> FloatArray:
        """Real parts of the eigenvalues of the tangent stiffness, ascending, shape (n_springs,) [N m/rad].

        In contact those along the motions that the pressed contacts leave, which are as many fewer.
        """
        solver = np.linalg.eigvalsh if self.conservative else np.linalg.eigvals
        left, tangent = self._free_motions, self.tangent_stiffness
        with one_blas_thread(len(tangent)):
            return read_only(np.sort(solver(tangent if left is None else left.T @ tangent @ left).real))


def check_same_model(model: SoftModel, equilibrium: Any, name: str = "equilibrium") -> None:
    """Check that an argument of a name is an equilibrium of a model.

    Raises:
        ParameterError: If it is something else.
    """
    check_model(model)
    instance_of(name, equilibrium, Equilibrium, "an Equilibrium of the model")
    if equilibrium.model != model:
        raise ParameterError(name, equilibrium.model, f"an equilibrium of the model given, {model!r}")


def _within(values: FloatArray, limits: FloatArray) -> bool:
    return bool(np.all((values >= limits[:, 0]) & (values <= limits[:, 1])))
