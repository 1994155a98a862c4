"""Equilibrium of a robot that a probe displaces by a given distance; the reaction force is part of the result.

A displacement can be imposed where no dead load has an equilibrium: a link on the plateau of its moment. The equations and the
solver are in `softrobots.statics.displacement_control`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, finite_array, finite_number, positive_integer, read_only, unit_vector
from softrobots.core.errors import EquilibriumNotFound, ParameterError
from softrobots.core.summary import Part, Summarised, facts, field_facts
from softrobots.model.friction_coordinates import check_frictionless
from softrobots.model.soft_model import SoftModel
from softrobots.statics.displacement_control import (
    GAP,
    DisplacementControl,
    Probe,
    ProbedState,
    face_normal,
    follow,
    stable_under_constraint,
)
from softrobots.statics.elastic_state import TOLERANCE
from softrobots.statics.equilibrium import Equilibrium, equilibrium_from_state, solve_equilibrium
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import Load


@dataclass(frozen=True, eq=False, repr=False)
class ImposedDisplacement(Summarised):
    """Equilibrium of a robot that a probe displaces; can be saved with `softrobots.save_result`."""

    probe: Probe
    """The probe."""
    displacement: float
    """Position of the probe along its line [m]."""
    reaction: float
    """Force on the robot along that line [N], the reading of a load cell behind the probe; negative: it would have to pull."""
    load: Load
    """The load without the probe."""
    equilibrium: Equilibrium
    """The robot with the reaction as a wrench at the probe's frame. *Its* certificate is for that wrench as a dead load;
    `stable` is for the imposed displacement."""
    force: FloatArray
    """Force on the robot at `contact`, shape (3,) [N], world axes; a frictionless probe has no moment there."""
    contact: FloatArray
    """Point of contact, shape (3,) [m], world axes."""
    tangent_stiffness: FloatArray
    """Derivative of the residual at constant reaction, which turns with a face, shape (n_springs, n_springs)."""
    gradient: FloatArray
    """Derivative of the displacement with respect to the springs, shape (n_springs,) [m/rad or m/m]."""
    gap: float
    """Error of the displacement [m]."""
    stable: bool
    """Certified: the tangent stiffness is positive definite on the motions of the springs that do not move the probe."""

    def summary_parts(self) -> list[Part]:
        """Return the equilibrium, then what the probe does."""
        held = ("stable at this place", "yes, certified" if self.stable else "NO")
        probe = field_facts(self, "displacement", "reaction", "force", "contact", "gap")
        pulling = ("the probe has to pull", "YES: what the robot only touches cannot" if self.pulls else "no")
        return [*self.equilibrium.summary_parts(), facts([*probe, pulling, held])]

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self.equilibrium.model

    @property
    def q_springs(self) -> FloatArray:
        """Spring coordinates, shape (n_springs,) [rad or m]."""
        return self.equilibrium.q_springs

    @property
    def pulls(self) -> bool:
        """Whether the reaction would have to pull at the robot, as nothing does that the robot only touches."""
        return self.reaction * self.model.reach < -self.equilibrium.tolerance

    @property
    def residual(self) -> float:
        """Norm of the out-of-balance torque [N m]."""
        return self.equilibrium.residual

    @property
    def q(self) -> FloatArray:
        """Pinocchio's configuration, shape (nq,)."""
        return self.equilibrium.q


def solve_imposed_displacement(
    model: SoftModel,
    q_motors: Any,
    displacement: float,
    *,
    direction: Any,
    frame: str | None = None,
    point: Any = (0.0, 0.0, 0.0),
    along: Any = None,
    force: Any = None,
    wrench: Any = None,
    gravity: Any = None,
    start: ImposedDisplacement | None = None,
    tolerance: float = TOLERANCE,
    max_iterations: int = 400,
) -> ImposedDisplacement:
    """Find the springs and the reaction of a frictionless probe that displaces a point of the robot by a given distance.

    The displacement is counted from the equilibrium without the probe. It is imposed at once, or in steps where Newton does not
    converge: the result is on the path from that equilibrium, or from `start`. The probe holds the point from both sides, so
    the reaction can pull (`ImposedDisplacement.pulls`). A wall that only pushes, and that the robot touches wherever it gets
    there, is an obstacle: `solve_equilibrium(..., environment=Environment([HalfSpace(...)]))`.

    Args:
        model: The robot, with at least one spring.
        q_motors: Motor coordinates, shape (n_motors,) [rad or m].
        displacement: Distance that the probe has moved along its line [m].
        direction: Direction of that line, shape (3,), any length but zero, world axes.
        frame: Frame that the probe touches; the tip by default.
        point: The point that the probe touches, in the axes of the frame, shape (3,) [m]; the origin of the frame by default.
        along: Axis of the frame, shape (3,), any length but zero, along which the probe slides on the robot: on the face that
            contains this axis and, without the probe, faces the line most. None: the probe stays at its point, which is free
            to move across the line.
        force: Force on the tip beside that of the probe, shape (3,) [N], world axes.
        wrench: Wrenches on the robot beside that of the probe, as in `solve_equilibrium`, at the tip or by frame.
        gravity: Gravity, shape (3,) [m/s^2], world axes; None: weightless.
        start: A solution with the same model, motors, probe and load to start from, e.g. the last one of a sequence.
        tolerance: Largest residual, relative to `max(|f| reach + |g|, 1e-3 N m)`.
        max_iterations: Most evaluations.

    Returns:
        The displaced robot with its certificate.

    Raises:
        ParameterError: If an argument has the wrong shape, is not finite or out of range, the springs cannot move the point
            along the line, or `start` is of another probe, load or robot.
        NameNotFound: If the frame does not exist.
        EquilibriumNotFound: If the displacement cannot be reached; carries the farthest `ImposedDisplacement` on the way.
    """
    check_frictionless(model, "imposed displacements")
    motors = model.checked_motors(q_motors)
    wanted = finite_number("displacement", displacement, "m")
    if model.n_springs == 0:
        raise ParameterError("model", model, "a robot with springs")
    line = unit_vector("direction", direction)
    touched = finite_array("point", point, (3,), "m")
    axis = None if along is None else unit_vector("along", along)
    most = positive_integer("max_iterations", max_iterations)
    at = model.tip if frame is None else frame
    model.frame_id(at)
    free = solve_equilibrium(model, motors, force, wrench=wrench, gravity=gravity, tolerance=tolerance)
    pose = frame_placement(model, free.q, at)
    origin = pose.translation + pose.rotation @ touched
    normal = None if axis is None else read_only(face_normal(pose.rotation.T @ line, axis, along))
    probe = Probe(at, read_only(touched), read_only(line), read_only(origin), normal)
    problem = DisplacementControl(model, motors, free.load, probe, tolerance)
    here = problem.at(free.q_springs, 0.0)
    if not np.linalg.norm(here.contact.gradient) > GAP * model.reach:
        raise ParameterError(
            "direction", direction, f"one in which the springs can move the point; it is at {origin.tolist()} m"
        )
    if start is not None:
        _check_start(problem, start)
        here = problem.at(start.q_springs, start.reaction)
    here, spent = follow(problem, here, wanted, most)
    reached = here.contact.displacement
    if abs(reached - wanted) <= problem.largest_gap:
        return imposed_result(problem, here, wanted, spent)
    best = imposed_result(problem, here, reached, spent)
    raise EquilibriumNotFound(
        f"a displacement of {wanted:g} m was not reached in {spent} evaluations: the path was followed to {reached:.6g} m, "
        f"where the reaction is {best.reaction:.6g} N",
        best=best,
        residual=best.equilibrium.residual,
        iterations=spent,
    )


def imposed_result(problem: DisplacementControl, probed: ProbedState, wanted: float, iterations: int) -> ImposedDisplacement:
    """Result at a state of robot and probe, in equilibrium or not."""
    model, probe, contact = problem.model, problem.probe, probed.contact
    pressed = problem.load.plus(probe.frame, probed.reaction * contact.wrench)
    equilibrium = equilibrium_from_state(
        model, problem.motors, pressed, probed.state, method="newton", iterations=iterations, tolerance=problem.tolerance
    )
    return ImposedDisplacement(
        probe=probe,
        displacement=wanted,
        reaction=probed.reaction,
        load=problem.load,
        equilibrium=equilibrium,
        force=read_only(probed.reaction * contact.wrench[:3]),
        contact=read_only(contact.place),
        tangent_stiffness=read_only(probed.tangent),
        gradient=read_only(contact.gradient),
        gap=abs(contact.displacement - wanted),
        stable=stable_under_constraint(model, probed.tangent, contact.gradient),
    )


def _check_start(problem: DisplacementControl, start: Any) -> None:
    if not isinstance(start, ImposedDisplacement):
        raise ParameterError("start", start, "an ImposedDisplacement")
    same = start.probe.same_as(problem.probe) and start.load.same_as(problem.load)
    if not (same and start.model == problem.model):
        raise ParameterError("start", start.probe, "a solution with the same model, probe and load")
