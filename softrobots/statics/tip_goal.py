"""Task of the tip (position, direction, orientation): error and Jacobian on a loaded robot in Pinocchio, for `tip_search`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray, finite_array
from softrobots.core.errors import NeutralEquilibrium, ParameterError
from softrobots.model.assembly import with_given_forces
from softrobots.model.friction_coordinates import slipping
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.pressed_gaps import PressedGaps, motor_slopes, pressed_gaps
from softrobots.statics.elastic_state import ElasticState, elastic_state
from softrobots.statics.elastostatics import balanced_state
from softrobots.statics.kinematics import frame_jacobian, frame_placement
from softrobots.statics.loads import Load
from softrobots.statics.sensitivity import inverse_in_contact, tip_motion
from softrobots.statics.tip_search import LEVER, LocalSolution, search
from softrobots.statics.tip_steps import Pull, TipModel, given_tensions, keeps_muscles, muscle_room, taken_up

_MOST_OPENED = 4  # pressed contacts beyond which each opens alone, or all of them


class Goal(NamedTuple):
    """Target position of the tip, and optionally its orientation or direction."""

    position: FloatArray
    """Position, shape (3,) [m], world axes."""
    rotation: FloatArray | None = None
    """Orientation of the tip, shape (3, 3), or the direction of its z axis, shape (3,), of length 1; None: any."""
    offset: FloatArray | None = None
    """The point that shall be at the position, in the axes of the tip, from its origin, shape (3,) [m]; None: the origin."""

    @classmethod
    def of(cls, target: Any, orientation: Any = None, name: str = "target") -> Goal:
        """Return the goal of a target: a position, shape (3,) [m], or a pose, `pinocchio.SE3` or shape (4, 4), in world axes.

        Args:
            target: The target.
            orientation: For a position only: a rotation matrix, shape (3, 3), the direction of the tip's z axis, shape (3,), or
                None for any.
            name: What the target is called in errors.

        Raises:
            ParameterError: If one of them is something else.
        """
        given = target.homogeneous if isinstance(target, pin.SE3) else target
        if np.shape(given) != (4, 4):
            return cls(finite_array(name, given, (3,), "m"), checked_orientation(orientation))
        if orientation is not None:
            raise ParameterError("orientation", orientation, "None where the target is a pose, which has one")
        pose = finite_array(name, given, (4, 4))
        if not np.array_equal(pose[3], (0.0, 0.0, 0.0, 1.0)) or not _is_rotation(pose[:3, :3]):
            raise ParameterError(name, target, "a pose: rotation and translation above a last row (0, 0, 0, 1)")
        return cls(pose[:3, 3], checked_orientation(pose[:3, :3]))

    @classmethod
    def path(cls, targets: Any) -> list[Goal]:
        """Return the goals of a path: positions, shape (n, 3) [m], or poses, shape (n, 4, 4) or a sequence of `pinocchio.SE3`.

        Raises:
            ParameterError: If it is something else, or empty.
        """
        if isinstance(targets, list | tuple) and targets and all(isinstance(one, pin.SE3) for one in targets):
            targets = [one.homogeneous for one in targets]
        if isinstance(getattr(targets, "targets", None), np.ndarray):
            raise ParameterError("targets", targets, "the positions or poses of the path: its .targets")
        rows = finite_array("targets", targets, None, "m")
        if len(rows) == 0 or rows.shape[1:] not in ((3,), (4, 4)):
            requirement = "at least one target position, shape (n, 3), or pose, shape (n, 4, 4) [m]"
            raise ParameterError("targets", targets, f"{requirement}; it has shape {rows.shape}")
        return [cls.of(row) for row in rows]

    def between(self, other: Goal, share: float) -> Goal:
        """Return the goal at a share of the line between the positions, and of the turn between two orientations."""
        position = (1.0 - share) * self.position + share * other.position
        if self.rotation is None or other.rotation is None or other.rotation.ndim == 1:
            return other._replace(position=position)
        return Goal(position, self.rotation @ pin.exp3(share * pin.log3(self.rotation.T @ other.rotation)))

    @property
    def rows(self) -> int:
        """Number of conditions: 3 for a position, 2 more for a direction, 3 more for an orientation."""
        return 3 if self.rotation is None else 5 if self.rotation.ndim == 1 else 6

    def missing(self, model: SoftModel, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return translation [m] and rotation vector [rad] from the tip to the goal, shape (3,) each, world axes."""
        pose = frame_placement(model, q, model.tip)
        reached = pose.translation if self.offset is None else pose.act(self.offset)
        return self.position - reached, self._turn(pose.rotation)

    def difference(self, model: SoftModel, q: FloatArray) -> FloatArray:
        """Return the difference from the tip to the goal, shape (3 or 6,), rotations times the lever [m]."""
        translation, turn = self.missing(model, q)
        return translation if self.rotation is None else np.concatenate([translation, LEVER * model.reach * turn])

    def _turn(self, rotation: FloatArray) -> FloatArray:
        if self.rotation is None:
            return np.zeros(3)
        if self.rotation.ndim == 2:
            return np.asarray(pin.log3(self.rotation @ rotation.T))
        pointing = rotation[:, 2]
        axis = np.cross(pointing, self.rotation)
        sine, cosine = float(np.linalg.norm(axis)), float(pointing @ self.rotation)
        if sine > 0.0:
            return np.asarray(axis * (np.arctan2(sine, cosine) / sine))
        return np.zeros(3) if cosine > 0.0 else np.pi * rotation[:, 0]  # opposite: any axis

    def jacobian(self, model: SoftModel, q: FloatArray) -> FloatArray:
        """Return the tip Jacobian in the components of the goal, shape (3 or 6, nv), rotations times the lever [m/rad]."""
        columns = frame_jacobian(model, q, model.tip)
        if self.offset is not None:
            lever = frame_placement(model, q, model.tip).rotation @ self.offset
            columns[:3] -= pin.skew(lever) @ columns[3:]
        if self.rotation is None:
            return columns[:3]
        turning = columns[3:]
        if self.rotation.ndim == 1:
            pointing = frame_placement(model, q, model.tip).rotation[:, 2]
            turning = turning - np.outer(pointing, pointing @ turning)
        return np.concatenate([columns[:3], LEVER * model.reach * turning])


@dataclass(frozen=True, eq=False)
class LoadedTip:
    """A robot under a load, and the goal of its tip; a `tip_search.SoughtTip`."""

    model: SoftModel
    """The robot."""
    goal: Goal
    """The goal."""
    load: Load
    """The load."""
    method: str = "newton"
    """Solver of the springs, one of `elastostatics.METHODS`."""
    home: FloatArray | None = None
    """Actuators to which given tensions that pull and push return, shape (n_motors,); None: they move least."""

    @property
    def rows(self) -> int:
        """Number of conditions of the goal."""
        return self.goal.rows

    def towards(self, target: Goal) -> LoadedTip:
        """Return a copy with another goal."""
        return replace(self, goal=target)

    def solve(self, q_motors: FloatArray, start: FloatArray) -> LocalSolution[ElasticState] | None:
        """Solve for the elastic coordinates from a start, shape (n_springs,); None if they do not converge."""
        if not self.model.actuators.admit(q_motors):
            return None
        state = balanced_state(self.model, q_motors, self.load, start, method=self.method)
        if state is None:
            return None
        taut, excess = taken_up(self.model, q_motors, state)
        if not np.array_equal(taut, q_motors):
            return self.solve(taut, state.q_springs)
        if self.model.structure.friction is not None:  # where it sticks, the tip would not move at all
            state = elastic_state(slipping(state.model), q_motors, state.q_springs, self.load)
        translation, turn = self.goal.missing(self.model, state.q)
        return LocalSolution(q_motors, state, float(np.linalg.norm(translation)), float(np.linalg.norm(turn)), excess)

    def begin(self, q_motors: FloatArray, start: FloatArray, tolerance: float) -> tuple[FloatArray, FloatArray]:
        """Return actuators and elastic coordinates to search from, shapes (n_motors,) and (n_springs,).

        Redundant tendons of given length begin at the least tensions near `q_motors` that put the tip at the goal. Which
        tensions hold a pose does not depend on what is given, and only among tensions their limits are flat: those of given
        lengths change with the stiffness of the backbone, and a search among lengths creeps along them. Where given tensions
        find nothing, as where only held lengths are stable, and for all others it is `q_motors` and `start`.
        """
        model, actuators, structure = self.model, self.model.actuators, self.model.structure
        redundant = actuators.least_tension and actuators.basis.shape[1] > self.rows
        held = self.solve(q_motors, start) if redundant and structure.muscle_lengths else None
        if held is None or structure.muscle_lengths is None:
            return q_motors, start
        pulled, count = with_given_forces(model), len(structure.motor_joints)
        tensions = np.clip(np.concatenate([q_motors[:count], held.state.load.motors[count:]]), *pulled.motor_limits.T)
        strains = structure.strains(q_motors, held.state.q_springs)
        found = search(replace(self, model=pulled), tensions, strains, tolerance=tolerance)
        if found is None or not found.arrived(tolerance):
            return q_motors, start
        motors, elastic = structure.muscle_lengths.held(found.q_motors[:count], found.state.q_springs)
        return actuators.go(q_motors, motors - q_motors), elastic

    def missing(self, state: ElasticState) -> FloatArray:
        """Return the difference from the tip to the goal, shape (3 or 6,), rotations times the lever [m]."""
        return self.goal.difference(self.model, state.q)

    def motion(self, state: ElasticState) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of tip and elastic coordinates by the actuators; see `sensitivity.tip_motion`."""
        motors, springs = state.point.columns(self.goal.jacobian(self.model, state.q))
        return tip_motion(self.model, motors, springs, state.tangent, state.load.coupling, pressed_gaps(state))

    def released(self, here: LocalSolution[ElasticState], held: TipModel, damping: float) -> list[TipModel]:
        """Return the models in which pressed contacts open, see `softrobots.statics.tip_goal`."""
        state = here.state
        pressed = pressed_gaps(state)
        if pressed is None:
            if self.model.structure.friction is None:
                return []
            slips = elastic_state(slipping(state.model, always=True), here.q_motors, state.q_springs, self.load)
            return [TipModel(held.missing, *self.motion(slips), held.shift)]
        motors, springs = state.point.columns(self.goal.jacobian(self.model, state.q))
        return released(state, pressed, motors, springs, held, damping)

    def pull(self, state: ElasticState, follow: FloatArray) -> Pull | None:
        """Return the tensions with their derivatives; None of muscles that push, whose tensions are not given."""
        if not keeps_muscles(self.model):
            return None
        model, count = self.model, len(self.model.muscles)
        by_motors, by_elastic = motor_slopes(state, self.load)
        slope = (by_motors + by_elastic @ follow)[-count:]
        rows, rests = given_tensions(model)
        slope[rows, rows - count] = 1.0
        elongations, stretch = np.zeros(count), slope[:0]
        if len(rows):
            paths = model.structure.muscle_paths.at(state.q_springs)
            elongations, stretch = paths.elongation, (paths.arms @ follow)[rows] / rests[:, None]
        tensions, scale = state.load.motors[-count:], model.actuators.tension_scale
        limited = np.concatenate([slope / scale, stretch])
        wanted, own = model.actuators.wanted_tensions, np.full(count, scale)
        if not model.actuators.least_tension:  # they change least instead
            wanted, own[rows] = np.array(tensions), model.motor_scale[-count:][rows]
            wanted[rows] = wanted[rows] if self.home is None else self.home[-count:][rows]
        return Pull((tensions - wanted) / own, slope / own[:, None], muscle_room(model, tensions, elongations), limited)


def checked_orientation(value: Any) -> FloatArray | None:
    """Return a target orientation of the tip: a rotation matrix, shape (3, 3), or a unit direction, shape (3,), or None.

    A matrix that is a rotation to 1e-9 becomes the nearest one, so that the tip can have it exactly.

    Raises:
        ParameterError: If it is something else.
    """
    if value is None:
        return None
    given = finite_array("orientation", value, None)
    if given.shape == (3,) and float(np.linalg.norm(given)) > 0.0:
        return np.asarray(given / np.linalg.norm(given))
    if given.shape == (3, 3) and _is_rotation(given):
        left, _, right = np.linalg.svd(given)
        return given if _is_rotation(given, 1e-13) else np.asarray(left @ right)
    raise ParameterError(
        "orientation", value, "a rotation matrix, shape (3, 3), or a direction different from zero, shape (3,)"
    )


def _is_rotation(matrix: FloatArray, tolerance: float = 1e-9) -> bool:
    return bool(np.allclose(matrix @ matrix.T, np.eye(3), rtol=0.0, atol=tolerance) and np.linalg.det(matrix) > 0.0)


def released(
    state: ElasticState, pressed: PressedGaps, motors: FloatArray, springs: FloatArray, held: TipModel, damping: float
) -> list[TipModel]:
    """Return the models of the tip in which some of the pressed contacts open: how a robot follows once it leaves an obstacle.

    While contacts stay pressed the tip moves along the obstacle only. To leave it, the actuators first take over the force of
    the contact: without it the springs would be elsewhere by `-P G^T lambda`, with `P` the inverse of the stiffness beside the
    contacts that stay. From there the robot follows as without the contact. The linear model is that of a complementarity
    problem on the branch on which those contacts are open; it holds where its step opens them.

    Args:
        state: The robot in equilibrium.
        pressed: Its pressed contacts.
        motors: Rows of the tip Jacobian, columns per actuator, shape (rows, n_motors).
        springs: The same rows, columns per elastic coordinate, shape (rows, n_springs).
        held: The model in which all stay pressed.
        damping: Damping of the step that must open them [m].

    Returns:
        The models, those that their own step contradicts left out.
    """
    count, models = len(pressed.forces), list[TipModel]()
    sizes = range(1, count + 1) if count <= _MOST_OPENED else (1, count)
    for opened in (list(some) for size in sizes for some in combinations(range(count), size)):
        kept = np.setdiff1d(np.arange(count), opened)
        try:
            inverse = inverse_in_contact(state.model, state.tangent, pressed.by_springs[kept])
        except NeutralEquilibrium:  # these contacts keep the robot from buckling
            continue
        follow = inverse.springs_by_load @ state.load.coupling - inverse.springs_by_gap @ pressed.by_motors[kept]
        shift = -inverse.springs_by_load @ (pressed.forces[opened] @ pressed.by_springs[opened])
        model = TipModel(held.missing - springs @ shift, motors + springs @ follow, follow, shift)
        step = model.step(state.model.actuators.basis, damping)
        gaps = pressed.by_springs[opened] @ (shift + follow @ step) + pressed.by_motors[opened] @ step
        if gaps.min() > 0.0:
            models.append(model)
    return models
