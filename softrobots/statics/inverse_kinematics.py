"""Elastostatic inverse kinematics: actuator coordinates that put the loaded, deformed tip at a target.

This module has the starts and the choice among the solutions; the search from one start is in
`softrobots.statics.tip_search`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from softrobots.core.checks import FloatArray, choice, positive_integer, positive_number, read_only
from softrobots.core.errors import EquilibriumNotFound, ParameterError, TargetUnreachable
from softrobots.core.summary import Part, Summarised, facts, formatted
from softrobots.environment.environment import Environment
from softrobots.model.actuators import joined_units
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.elastic_state import ElasticState
from softrobots.statics.elastostatics import METHODS, solve_springs
from softrobots.statics.equilibrium import Equilibrium, advice, equilibrium_from_state
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import Load
from softrobots.statics.spherical_wrist import spherical_wrist
from softrobots.statics.tip_goal import Goal, LoadedTip
from softrobots.statics.tip_search import POSITION_TOLERANCE, SAME, LocalSolution, search

ELBOWS = ("up", "down")
"""Choices of `solve_ik(elbow=...)`."""

_SEED = 20210312  # of the random starts


@dataclass(frozen=True, eq=False, repr=False)
class IkSolution(Summarised):
    """Actuator coordinates for a target; can be saved with `softrobots.save_result`."""

    target: FloatArray
    """The target, shape (3,) [m]."""
    orientation: FloatArray | None
    """Target orientation of the tip, shape (3, 3), or direction of its z axis, shape (3,); None: any."""
    equilibrium: Equilibrium
    """The loaded robot at these motor coordinates."""
    error: float
    """Distance of the tip from the target [m]."""
    orientation_error: float
    """Angle between the tip and its target orientation [rad]; 0 without one."""
    iterations: int
    """Steps from the start of the search; of redundant tendons of given length those after the search among tensions."""
    alternatives: tuple[FloatArray, ...]
    """Actuator coordinates of the other solutions found, each shape (n_motors,), by their distance from the start; whole turns
    of a motor count as the same solution."""

    @property
    def q_motors(self) -> FloatArray:
        """Actuator coordinates, shape (n_motors,) [rad, m or N]."""
        return self.equilibrium.q_motors

    @property
    def tip_pose(self) -> FloatArray:
        """Pose of the loaded tip in the world as a homogeneous matrix, shape (4, 4) [m]."""
        return self.equilibrium.tip_pose

    @property
    def wrist_singularity(self) -> str | None:
        """What is singular of the wrist, with the names of its motors; None if nothing is, or there is no spherical wrist.

        There, two of its motors turn the tip alike: many angles of both give the same pose, and the solution is one of them.
        """
        wrist = spherical_wrist(self.equilibrium.model)
        return None if wrist is None else wrist.singularity(self.equilibrium.q)

    def summary_parts(self) -> list[Part]:
        """Return the equilibrium, then target, errors and motors."""
        turned = f", {self.orientation_error:.2g} rad" if self.orientation is not None else ""
        rows = [
            ("target", f"{formatted(self.target)} m"),
            ("tip error", f"{self.error:.2g} m{turned}, {self.iterations} steps"),
            ("motors", f"{formatted(self.q_motors)} {joined_units(self.equilibrium.model.actuators.units)}"),
            *(("another solution", formatted(other)) for other in self.alternatives),
            *([("NOTE", self.wrist_singularity)] if self.wrist_singularity else []),
        ]
        return [*self.equilibrium.summary_parts(), facts(rows)]


def solve_ik(
    model: SoftModel,
    target: Any,
    force: Any = None,
    *,
    orientation: Any = None,
    wrench: Any = None,
    frame: str | None = None,
    gravity: Any = None,
    q_motors0: Any = None,
    elbow: str | None = None,
    method: str = "newton",
    tolerance: float = POSITION_TOLERANCE,
    starts: int = 24,
    environment: Environment | None = None,
) -> IkSolution:
    """Find actuator coordinates (motor angles, muscle lengths) that put the loaded tip at a target position.

    Searches from `q_motors0` and from random coordinates within the limits (always the same ones), and returns, of the
    solutions found, the one that changes `q_motors0` least. Of a robot with more actuators than the target has conditions
    the change is minimal; if it has muscles, the first search that succeeds decides, as it does among obstacles. Where
    muscles cannot both pull and push (a least tension of zero or more), the limits of all tensions and lengths are kept,
    too, and redundant ones get the least tension instead: a minimum of the sum of squares beyond their pretension
    (`statics.tip_steps`), also where lengths are given (`statics.tip_goal.LoadedTip.begin`). Given tensions that pull and push
    keep the limits of lengths, and change least.

    For full poses of a robot with a spherical wrist the arm first puts the centre of the wrist in place, and the wrist starts
    in the orientation, with both of its solutions (`statics.spherical_wrist`).

    Args:
        model: The robot, with at least one actuator.
        target: Target of the tip, world axes: a position, shape (3,) [m], or a pose, `pinocchio.SE3` or shape (4, 4).
        force: Force at `frame`, shape (3,) [N], world axes.
        orientation: Target orientation beside a position, for robots with enough actuators: a rotation matrix (tip axes in
            world axes), shape (3, 3), or the direction of the tip's z axis, shape (3,), any length but zero; None: any.
        wrench: Wrench at `frame`, shape (6,) [N, N m], or `{frame: (6,)}` for several.
        frame: Frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        q_motors0: Start of the search, shape (n_motors,) [rad, m or N]; `SoftModel.relaxed_motors` by default.
        elbow: "up" or "down": only solutions whose last motor joint (without those of a spherical wrist) lies above or below
            the line from the first motor joint to the tip; None: any.
        method: Solver of the springs, "newton" or "fixed_point".
        tolerance: Largest distance of the tip from the target [m].
        starts: Number of searches, the one from `q_motors0` included.
        environment: Obstacles that the robot may lean on without friction, only with "newton"; None: free space.

    Returns:
        The solution.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or the robot has no actuators, or not
            enough of them for an orientation.
        NameNotFound: If a frame does not exist.
        TargetUnreachable: If no search succeeds; the error names the nearest point reached and carries that solution.
        EquilibriumNotFound: If none of the starts has an equilibrium.
    """
    check_model(model)
    goal = Goal.of(target, orientation)
    load = Load.of(model, force, wrench=wrench, frame=frame, gravity=gravity, environment=environment)
    choice("method", method, METHODS if environment is None else METHODS[:1])
    if elbow is not None:
        choice("elbow", elbow, ELBOWS)
    positive_number("tolerance", tolerance, "m")
    first = start_motors(model, q_motors0)
    if elbow is not None and not _has_elbow(model):
        raise ParameterError("elbow", elbow, "None for this robot: its last motor joint is where its first one is")
    freedom = model.actuators.basis.shape[1]
    if goal.rotation is not None and freedom < goal.rows:
        requirement = f"left out for this robot: it has {freedom} freedoms, {goal.rows} are needed"
        raise ParameterError("orientation", goal.rotation.tolist(), requirement)

    def allowed(local: LocalSolution[ElasticState]) -> bool:
        return elbow is None or elbow_side(model, local.state.q) == elbow

    tip = LoadedTip(model, goal, load, method, first)
    ended: list[LocalSolution[ElasticState]] = []
    begins = _starts(model, first, positive_integer("starts", starts, 10_000))
    first_decides = environment is not None or bool(model.muscles and freedom > goal.rows)
    wrist = spherical_wrist(model) if goal.rows == 6 else None
    for tried in [begins] if wrist is None else [[first, *wrist.starts(tip, begins)], begins[1:]]:
        for start in tried:
            local = search(tip, *tip.begin(start, model.rest, tolerance), home=first, tolerance=tolerance)
            if local is not None:
                ended.append(local)
                if first_decides and local.arrived(tolerance) and allowed(local):
                    break
        if any(local.arrived(tolerance) and allowed(local) for local in ended):
            break
    if not ended:
        _raise_unsolved(model, first, load, method, starts)
    sided = [local for local in ended if allowed(local)]
    found: list[LocalSolution[ElasticState]] = []
    for local in sorted(sided, key=lambda local: float(np.linalg.norm((local.q_motors - first) / model.motor_scale))):
        if local.arrived(tolerance) and not any(_same_pose(model, local, other) for other in found):
            found.append(local)
    best = found[0] if found else min(sided or ended, key=lambda local: local.miss(model))
    solution = IkSolution(
        target=read_only(goal.position),
        orientation=None if goal.rotation is None else read_only(goal.rotation),
        equilibrium=equilibrium_from_state(model, best.q_motors, load, best.state, method=method, iterations=best.iterations),
        error=best.error,
        orientation_error=best.angle,
        iterations=best.iterations,
        alternatives=tuple(read_only(other.q_motors) for other in found[1:]),
    )
    if not found:
        side = (f" with the elbow {elbow}" if elbow else "") + (
            " in the target orientation" if goal.rotation is not None else ""
        )
        unsolved = sum(local.unsolved for local in ended)
        raise TargetUnreachable(
            f"the tip cannot reach {goal.position.tolist()} m{side}: the nearest of {starts} starts (seed {_SEED}) comes "
            f"within {best.error:.6g} m{'' if goal.rotation is None else f' and {best.angle:.6g} rad'}, "
            f"at {solution.equilibrium.tip_position.round(9).tolist()} m with motors {best.q_motors.round(6).tolist()}"
            + ("" if sided else ", with the elbow on the other side")
            + (f"; its reach is {model.reach:.4g} m" if np.linalg.norm(goal.position) > 2.0 * model.reach else "")
            + (f"; {solution.wrist_singularity}" if goal.rows == 6 and solution.wrist_singularity else "")
            + (f"; {method!r} found no equilibrium at {unsolved} of the motor coordinates tried" if unsolved else ""),
            best=solution,
            residual=best.error,
            iterations=best.iterations,
        )
    return solution


def start_motors(model: SoftModel, q_motors0: Any) -> FloatArray:
    """Check the start of a search; by default relaxed, or as near to it as the limits allow.

    Raises:
        ParameterError: If the robot has no actuators, or the start has the wrong shape, is not finite or beyond the limits.
    """
    if model.n_motors == 0:
        raise ParameterError("model", model, "a robot with at least one motor or muscle")
    low, high = model.motor_limits.T
    if q_motors0 is None:
        return np.array(model.relaxed_motors)
    motors = model.actuators.checked(q_motors0, "q_motors0")
    if np.any((motors < low) | (motors > high)):
        raise ParameterError("q_motors0", q_motors0, f"within the motor limits: {', '.join(model.actuators.described)}")
    return motors


def elbow_side(model: SoftModel, q: FloatArray) -> str:
    """Whether the last motor joint, without a wrist, is above or below the line from the first to the tip: "up" or "down"."""
    first, last, tip = (frame_placement(model, q, name).translation for name in (*_ends(model), model.tip))
    along = tip - first
    length = float(along @ along)
    offset = last - first - (along * float(along @ (last - first)) / length if length > 0.0 else 0.0)
    return "up" if offset[2] >= 0.0 else "down"


def _ends(model: SoftModel) -> tuple[str, str]:
    joints = model.structure.motor_joints
    return joints[0], joints[-1 if len(joints) < 4 or spherical_wrist(model) is None else -4]


def _has_elbow(model: SoftModel) -> bool:
    """Whether the last motor joint, without a wrist, is away from the first one."""
    if len(model.structure.motor_joints) < 2:
        return False
    q = model.embed(model.coordinates.at(model.relaxed_motors, model.rest).joints)
    first, last = (frame_placement(model, q, name).translation for name in _ends(model))
    return float(np.linalg.norm(last - first)) > SAME * model.reach


def _same_pose(model: SoftModel, one: LocalSolution[ElasticState], other: LocalSolution[ElasticState]) -> bool:
    """Whether two solutions are the same, up to whole turns of a motor."""
    apart = one.q_motors - other.q_motors
    apart = np.where(model.actuators.turning, apart - 2.0 * np.pi * np.rint(apart / (2.0 * np.pi)), apart)
    return float(np.abs(apart / model.motor_scale).max()) <= SAME


def _raise_unsolved(model: SoftModel, motors: FloatArray, load: Load, method: str, starts: int) -> NoReturn:
    state, spent, _ = solve_springs(model, motors, load, model.rest, method=method)
    best = equilibrium_from_state(model, motors, load, state, method=method, iterations=spent)
    raise EquilibriumNotFound(
        f"no equilibrium under this load by {method!r} at any of {starts} starts{advice(best, state)}",
        best=best,
        residual=best.residual,
        iterations=spent,
    )


def _starts(model: SoftModel, first: FloatArray, count: int) -> list[FloatArray]:
    random = np.random.default_rng(_SEED)
    starts = [first]
    for _ in range(20 * count):  # some muscle lengths are inconsistent, or bend a segment too far
        if len(starts) == count:
            break
        start = model.actuators.draw(random)
        if start is not None:
            starts.append(start)
    return starts
