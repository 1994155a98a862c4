"""Trajectory following: inverse kinematics of the loaded tip along a path of targets, waypoint by waypoint."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from softrobots.core.checks import (
    FloatArray,
    choice,
    finite_array,
    increasing,
    non_negative_number,
    positive_number,
    read_only,
    read_only_mapping,
)
from softrobots.core.errors import ParameterError, TargetUnreachable
from softrobots.core.progress import with_progress
from softrobots.core.summary import Part, Summarised
from softrobots.environment.environment import Environment
from softrobots.model.friction_coordinates import check_frictionless, untouched
from softrobots.model.link_limits import known_margins
from softrobots.model.soft_model import SoftModel, check_model
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.inverse_kinematics import solve_ik, start_motors
from softrobots.statics.loads import Load
from softrobots.statics.tip_goal import Goal, LoadedTip
from softrobots.statics.tip_path.closed_loop import paper_steps
from softrobots.statics.tip_path.contact_steps import follow_targets
from softrobots.statics.tip_path.waypoints import exact_steps, named
from softrobots.statics.tip_search import POSITION_TOLERANCE
from softrobots.statics.trajectory_summary import trajectory_parts

METHODS = ("newton", "fixed_point", "paper")
"""Methods of `follow_trajectory`: exact steps with the springs by Newton or by the recursion of [Troise 2021], or the
closed-loop inverse kinematics of that paper."""


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Summarised):
    """Motor coordinates over a path, with the loaded robot at every waypoint; can be saved with `softrobots.save_result`."""

    times: FloatArray
    """Time of each waypoint, shape (n,) [s]; the number of the waypoint if no times were given."""
    targets: FloatArray
    """Target positions, shape (n, 3) [m]."""
    equilibria: tuple[Equilibrium, ...]
    """The loaded robot at each waypoint."""
    method: str
    """Method of `follow_trajectory`, or a label of the caller for a trajectory from elsewhere."""
    orientations: FloatArray | None = None
    """Target orientations of the tip, shape (n, 3, 3); None: any."""
    contact_path: ContactPath | None = None
    """With friction: its work, and what happened to the contacts, with times for parameters; None without."""

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self.equilibria[0].model

    @cached_property
    def q_motors(self) -> FloatArray:
        """Motor coordinates, shape (n, n_motors) [rad or m]."""
        return read_only(np.array([equilibrium.q_motors for equilibrium in self.equilibria]))

    @cached_property
    def q_springs(self) -> FloatArray:
        """Spring coordinates, shape (n, n_springs) [rad or m]."""
        return read_only(np.array([equilibrium.q_springs for equilibrium in self.equilibria]))

    @cached_property
    def motor_torques(self) -> FloatArray:
        """Load on each motor, shape (n, n_motors) [N m or N]."""
        return read_only(np.array([equilibrium.motor_torques for equilibrium in self.equilibria]))

    @cached_property
    def tip_positions(self) -> FloatArray:
        """Position of the loaded tip, shape (n, 3) [m]."""
        return read_only(np.array([equilibrium.tip_position for equilibrium in self.equilibria]))

    @cached_property
    def tip_error(self) -> FloatArray:
        """Distance of the loaded tip from its target, shape (n,) [m]."""
        return read_only(np.linalg.norm(self.tip_positions - self.targets, axis=1))

    @cached_property
    def orientation_error(self) -> FloatArray | None:
        """Angle between the loaded tip and its target orientation, shape (n,) [rad]; None without target orientations."""
        if self.orientations is None:
            return None
        rows = zip(self.targets, self.orientations, self.equilibria, strict=True)
        return read_only(np.linalg.norm([Goal(*goal).missing(self.model, e.q)[1] for *goal, e in rows], axis=1))

    @cached_property
    def link_moments(self) -> FloatArray | None:
        """Moment at each inflated link, shape (n, n_links) [N m]; None if the model names no inflated links."""
        if not self.model.spring_groups:
            return None
        return read_only(np.array([equilibrium.link_moments for equilibrium in self.equilibria]))

    @property
    def contact_forces(self) -> Mapping[str, FloatArray]:
        """Sum of the normal forces on each obstacle that is touched, or on a link by another one, shape (n,) [N]."""
        contacts = [equilibrium.contacts for equilibrium in self.equilibria]
        names = dict.fromkeys(contact.obstacle for row in contacts for contact in row)
        forces = [[sum(one.normal_force for one in row if one.obstacle == name) for row in contacts] for name in names]
        return read_only_mapping({name: read_only(np.array(row, float)) for name, row in zip(names, forces, strict=True)})

    @property
    def required_pressure(self) -> float | None:
        """Smallest gauge pressure at which no link wrinkles on the path [Pa], [Troise 2021] (3); None without links.

        With the axial forces; see `LinkLimits.required_pressures`.
        """
        if self.link_moments is None:
            return None
        return max(float(equilibrium.link_limits.required_pressures.max()) for equilibrium in self.equilibria)

    def least_margin(self, name: str) -> float | None:
        """Return the least of the margins of a name in `LinkLimits` over all waypoints and links [-]; None without pressure."""
        if self.link_moments is None or any(group.pressure == 0.0 for group in self.model.spring_groups):
            return None
        return known_margins(np.array([min(getattr(one.link_limits, name).min() for one in self.equilibria)]))[0]

    def summary_parts(self) -> list[Part]:
        """Return range and largest load of each motor, and the worst of all waypoints."""
        return trajectory_parts(self)


def follow_trajectory(
    model: SoftModel,
    targets: Any,
    force: Any = None,
    *,
    wrench: Any = None,
    frame: str | None = None,
    gravity: Any = None,
    q_motors0: Any = None,
    elbow: str | None = None,
    method: str = "newton",
    tolerance: float = POSITION_TOLERANCE,
    times: Any = None,
    gain: float = 50.0,
    allow_jumps: bool = False,
    environment: Environment | None = None,
    friction: float = 0.0,
    progress: bool | str = False,
) -> Trajectory:
    """Find motor coordinates that move the loaded tip through target positions, or poses.

    "newton" and "fixed_point" reach every waypoint within `tolerance`, each search starting from the last waypoint and its
    elastostatic Jacobian. "paper" is [Troise 2021] (8, 9) in position form, `dq_m/dt = [J^#]_m (v_d + K e)` with the springs
    by the fixed point at every step: it follows with a lag that depends on the gain. (With the 6 x 7 Jacobian that the paper
    prints it diverges at useful gains: three motors cannot hold an orientation.) It starts exactly on the first target.

    With friction the target goes straight from waypoint to waypoint in the quasi-static steps of `follow_contact`, and the
    motors are those with which a step ends at its target. At the first one contacts have no friction yet; from there on each
    sticks or slips, so that the answer depends on the way. A tip on an obstacle may press on it more or less: motors change
    least in a step, as without friction; where the tip so jams, it presses less where it sticks before it goes on.

    Args:
        model: The robot, with at least one motor.
        targets: Target positions, shape (n, 3) [m], world axes; or poses of the tip, shape (n, 4, 4) or a sequence of
            `pinocchio.SE3`, not for "paper".
        force: Force at `frame`, shape (3,) [N], constant over the path, world axes.
        wrench: Wrench at `frame`, shape (6,) [N, N m], or `{frame: (6,)}` for several.
        frame: Frame of `force` and `wrench`; the tip by default.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        q_motors0: Motor coordinates near the first waypoint, shape (n_motors,) [rad or m]. By default the solution nearest to
            zero, or, where a motor limit then blocks the path, the next one from which the whole path can be followed.
        elbow: "up" or "down" at the first waypoint; None: the one that changes `q_motors0` least.
        method: "newton", "fixed_point" or "paper".
        tolerance: Largest distance of the tip from a target [m]; not for "paper".
        times: Increasing times of the waypoints, shape (n,) [s]; required by "paper".
        gain: Gain `K` of "paper" [1/s]; intervals longer than half its inverse are integrated in several steps.
        allow_jumps: Where a waypoint cannot be reached from the last one by a continuous motion (a motor limit, a turn of the
            base under a tip that passes over it), go on from the nearest other solution instead of raising; not with friction.
        environment: Obstacles that the robot may lean on, only with "newton"; None: free space.
        friction: Friction coefficient of all contacts [-], for robots whose muscles can push.
        progress: Show a progress bar on stderr; a text is its label.

    Returns:
        The trajectory; with friction as far as it was followed, if it is interrupted (Ctrl-C).

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, or the robot has not enough actuators
            for poses, or friction in its guides with friction of contacts.
        NameNotFound: If a frame does not exist.
        TargetUnreachable: If a waypoint cannot be reached, or not without a jump; names it, the distance that remains, and the
            wrist if it is near a singular pose there: the path then goes past that pose with a faster and faster wrist, while a
            path straight through it is followed.
        EquilibriumNotFound: If a waypoint has no equilibrium.
    """
    choice("method", method, METHODS if environment is None else METHODS[:1])
    model = untouched(check_model(model))
    rubs = non_negative_number("friction", friction) > 0.0
    if rubs and (environment is None or allow_jumps or model.actuators.least_tension):
        requirement = "0 without an environment, with allow_jumps=True, and for a robot whose muscles cannot push"
        raise ParameterError("friction", friction, requirement)
    if rubs and model.structure.guided:  # whose friction follows the tensions, and so the motors that are sought
        check_frictionless(model, "targets in contact with friction in guides")
    goals = Goal.path(targets)
    points = np.array([goal.position for goal in goals])
    orientations = None if goals[0].rotation is None else read_only(np.array([goal.rotation for goal in goals]))
    if method == "paper" and orientations is not None:
        raise ParameterError("method", method, "'newton' or 'fixed_point' for poses: it follows positions")
    load = Load.of(model, force, wrench=wrench, frame=frame, gravity=gravity, environment=environment)
    positive_number("gain", gain, "1/s")
    start_motors(model, q_motors0)
    if method == "paper" and model.muscles and model.muscle_input == "forces":
        raise ParameterError(
            "method", method, "'newton' or 'fixed_point' where tensions are given: they move nothing by themselves"
        )
    if times is None:
        if method == "paper":
            raise ParameterError("times", times, "given for method='paper', which integrates over time")
        moments: FloatArray = np.arange(len(points), dtype=np.float64)
    else:
        moments = increasing("times", finite_array("times", times, (len(points),), "s"), "s")
    inner = "newton" if method == "newton" else "fixed_point"
    options: dict[str, Any] = {"wrench": dict(load.wrenches), "gravity": gravity, "method": inner, "tolerance": tolerance}
    options |= {"orientation": goals[0].rotation, "environment": environment}
    try:
        begin = solve_ik(model, points[0], q_motors0=q_motors0, elbow=elbow, **options)
    except TargetUnreachable as error:
        raise named(error, 1, len(points)) from error

    def follow_from(first: Equilibrium) -> Trajectory:
        if rubs:
            path = follow_targets(model, goals, moments, load, first, friction, tolerance=tolerance, progress=progress)
            count = len(path.equilibria)
            turned = None if orientations is None else orientations[:count]
            return Trajectory(path.parameters, read_only(points[:count]), path.equilibria, method, turned, path)
        steps = (
            paper_steps(model, points, moments, load, first, gain)
            if method == "paper"
            else exact_steps(LoadedTip(model, goals[0], load, inner), goals, first, tolerance, allow_jumps)
        )
        bar = with_progress(steps, progress, label=f"waypoints ({method})", unit="wp", total=len(points) - 1)
        return Trajectory(read_only(moments), read_only(points), (first, *bar), method, orientations)

    try:
        return follow_from(begin.equilibrium)
    except TargetUnreachable as error:
        if q_motors0 is not None or error.residual > tolerance:  # the start was chosen, or the waypoint is out of reach
            raise
        for motors in begin.alternatives:  # the same tip, another shoulder or elbow: perhaps no limit blocks the path
            with contextlib.suppress(TargetUnreachable):
                return follow_from(solve_ik(model, points[0], q_motors0=motors, starts=1, **options).equilibrium)
        raise
