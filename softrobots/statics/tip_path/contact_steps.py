r"""Steps along a path of targets in contact with friction: in each, the motors for which it ends with the tip at its target.

Between two waypoints the target goes straight, in the quasi-static steps of `follow_contact`: each from the state that the last
one left, halved where contacts change. In a step the motors `u` are unknown beside springs `y` and contact forces, with the
condition that the tip is at the target of the step. Springs and forces follow the motors by the linear equations of Newton's
change (`statics.contact.newton_in_contact`), so that the motors are found as without friction (`statics.tip_search`).

Where a contact begins to slip, or slips back, its friction turns while the tip hardly moves: motors turn by a finite angle for
a small way of the tip. They are then turned in small steps first. Where the tip jams, since the motors that change least press
it ever harder on its obstacle, they first let it press less where it sticks.
"""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray, read_only
from softrobots.core.errors import EquilibriumNotFound, NeutralEquilibrium, TargetUnreachable
from softrobots.core.progress import with_progress
from softrobots.environment.environment import check_environment
from softrobots.environment.standing import standing_among
from softrobots.model.soft_model import SoftModel
from softrobots.statics.contact.contact_laws import Balance
from softrobots.statics.contact.contact_path import ContactPath
from softrobots.statics.contact.contact_walk import ContactWalk
from softrobots.statics.contact.last_state import Given, Sliding
from softrobots.statics.contact.newton_in_contact import ByMotors, followed
from softrobots.statics.contact.quasi_static import FAR, Rest, at_rest, change, may_have_passed, obstructed, settle, step
from softrobots.statics.equilibrium import Equilibrium
from softrobots.statics.loads import Load
from softrobots.statics.tip_goal import Goal
from softrobots.statics.tip_path.press_less import press_less
from softrobots.statics.tip_search import SAME, WARM_DAMPING, LocalSolution, advance, search, tip_models
from softrobots.statics.tip_steps import TipModel

_MOST_TURNS = 100  # small steps of the motors before one of the tip
_MOST_IDLE, _IDLE = 10, 1e-3  # of them after which neither tip nor motors are nearer, by that share of the way that was left
_MOST_EASED = 8  # times that a jammed tip is let press less
_MOST_NEARER = 5  # corrections of motors that turn more than they must
_FORCED = 1e-4  # sliding in a step of a contact that sticks, over the reach, until the motors have been found that prevent it
_NO_MOTION = 1e-6  # of the tip, relative to the largest


@dataclass(frozen=True, eq=False)
class RubbingTip:
    """A robot in a step with friction, and the goal of its tip; a `tip_search.SoughtTip`."""

    given: Given
    """The robot, its load and the surfaces around it; its motors are ignored."""
    last: Sliding
    """The last state."""
    goal: Goal
    """The goal."""

    @property
    def model(self) -> SoftModel:
        """The robot."""
        return self.given.model

    @property
    def rows(self) -> int:
        """Number of conditions of the goal."""
        return self.goal.rows

    def towards(self, target: Goal) -> RubbingTip:
        """Return a copy with another goal."""
        return replace(self, goal=target)

    def solve(self, q_motors: FloatArray, start: FloatArray) -> LocalSolution[Rest] | None:
        """Solve the step from elastic coordinates, shape (n_springs,); None if it does not converge to a state that holds."""
        if not self.model.actuators.admit(q_motors):
            return None
        rest = settle(self.given._replace(q_motors=q_motors), self.last, start, forced=_FORCED)
        if rest is None:
            return None
        translation, turn = self.goal.missing(self.model, rest.robot.at.q)
        return LocalSolution(q_motors, rest, float(np.linalg.norm(translation)), float(np.linalg.norm(turn)))

    def missing(self, state: Rest) -> FloatArray:
        """Return the difference from the tip to the goal, shape (3 or 6,), rotations times the lever [m]."""
        return self.goal.difference(self.model, state.robot.at.q)

    def motion(self, state: Rest) -> tuple[FloatArray, FloatArray]:
        """Return the derivatives of tip and elastic coordinates by the actuators in the step."""
        held = self._model(state, state.found, self.last.friction, state.robot.by_motors(state.found))
        if held is None:
            raise NeutralEquilibrium("the equations of the step are singular")
        return held.slope, held.follow

    def released(self, here: LocalSolution[Rest], held: TipModel, damping: float) -> list[TipModel]:
        """Return the models in which contacts begin to slip towards the goal, or slip back, or open; each alone, or all.

        A contact slips the way that it would take without friction.
        """
        state = here.state
        found, by_motors, mu = state.found, state.robot.by_motors(state.found), self.last.friction
        laws, near = found.laws, found.contacts
        pressed = np.flatnonzero(laws.pressed)
        smooth = self._model(state, _slipping(found, pressed, np.zeros_like(found.friction), 0.0), 0.0, by_motors)
        if smooth is None or not len(pressed):
            return []
        motors = smooth.step(self.model.actuators.basis, _NO_MOTION * self.model.reach)
        slid = near.sliding + near.jacobian @ (smooth.shift + smooth.follow @ motors) + by_motors.sliding @ motors
        way = -slid / np.maximum(np.linalg.norm(slid, axis=1), 1e-300)[:, None]
        turned = [one for one in pressed.tolist() if not laws.slips[one] or float(way[one] @ laws.way[one]) < 0.0]
        begin = [turned, *([one] for one in turned if len(turned) > 1)] if turned else []
        others = [_slipping(found, which, way, mu) for which in begin]
        for which in [pressed.tolist(), *([one] for one in pressed.tolist() if len(pressed) > 1)]:
            kept = laws.pressed.copy()
            kept[which] = False
            others.append(found._replace(laws=laws._replace(pressed=kept, sticks=laws.sticks & kept, slips=laws.slips & kept)))
        models = (self._model(state, other, mu, by_motors) for other in others)
        return [model for model in models if model is not None]

    def pull(self, state: Rest, follow: FloatArray) -> None:
        """No limits of tensions: robots whose muscles cannot push are refused."""

    def _model(self, state: Rest, assumed: Balance, friction: float, by_motors: ByMotors) -> TipModel | None:
        """How tip and springs follow the actuators near a state, if its contacts do what is assumed."""
        found = followed(assumed, friction, by_motors)
        if found is None:
            return None
        shift, follow, *_ = found
        motors, springs = state.robot.at.point.columns(self.goal.jacobian(self.model, state.robot.at.q))
        return TipModel(self.missing(state) - springs @ shift, motors + springs @ follow, follow, shift)


def _slipping(found: Balance, which: Any, way: FloatArray, friction: float) -> Balance:
    """Return a state whose contacts `which` slip under friction along `way`, shape (m, 2), a direction that stays."""
    laws = found.laws
    slips, ways, held, broken = laws.slips.copy(), laws.way.copy(), laws.held.copy(), laws.broken.copy()
    slips[which], ways[which], held[which] = True, way[which], 0.0
    broken[which] = found.friction[which] - friction * found.normal[which][:, None] * way[which]
    return found._replace(laws=laws._replace(slips=slips, sticks=laws.sticks & ~slips, way=ways, held=held, broken=broken))


class TargetWay:
    """The way of a tip through waypoints; a `contact_walk.Way`."""

    def __init__(self, model: SoftModel, goals: list[Goal], times: FloatArray, load: Load, tolerance: float) -> None:
        """Take the robot, the waypoints with their times, shape (n,), the load with the obstacles, and the tolerance [m]."""
        self._model, self._goals, self._times, self._load, self._tolerance = model, goals, times, load, tolerance
        self._environment = check_environment(load.environment)
        self._surroundings = standing_among(model, self._environment)

    def parameter(self, place: float) -> float:
        """Time at a place [s]."""
        return float(np.interp(place, np.arange(len(self._times)), self._times))

    def begin(self, first: Equilibrium, friction: float) -> Rest | None:
        """Return the robot at rest at the first waypoint; None if it is not."""
        return at_rest(Given(self._model, first.q_motors, self._load, self._environment, self._surroundings), first, friction)

    def step(self, place: float, here: Rest, small: bool = True) -> Rest | None:
        """Put the tip to the target of a place; None if no small step of the robot does."""
        number, work, idle, least, nearest = min(int(place), len(self._goals) - 2), 0.0, 0, np.inf, np.inf
        goal = self._goals[number].between(self._goals[number + 1], place - number)
        for _ in range(_MOST_TURNS):
            tip = RubbingTip(here.given, here.sliding, goal)
            found = tip.solve(here.q_motors, here.q_springs)
            far = 0.0
            if found is not None and not found.arrived(self._tolerance):
                wanted = self._wanted(tip, found)
                if wanted is None:
                    return None
                turn, far = wanted
                if far <= 1.0:
                    found = advance(tip, goal, goal, found, self._tolerance, 0)
                    if found is not None:
                        found = self._least(tip, here.q_motors, found)
                        turn, far = found.q_motors - here.q_motors, self._far(found.state.q_springs - here.q_springs)
            if found is None:
                return None
            if far <= 1.0:
                passed = may_have_passed(found.state.robot, here)
                return None if passed else found.state._replace(work=work + found.state.work)
            idle = 0 if far < (1.0 - _IDLE) * least or found.error < (1.0 - _IDLE) * nearest else idle + 1
            least, nearest = min(least, far), min(nearest, found.error)
            part = self._model.actuators.go(here.q_motors, min(0.5, 0.5 / far) * turn)
            turned = step(here.given._replace(q_motors=part), here)
            if turned is None or idle > _MOST_IDLE or not np.any(part != here.q_motors):
                return None
            here, work = turned, work + turned.work
        return None

    def _far(self, moved: FloatArray) -> float:
        """Size of a change of the springs over that of a small step."""
        return change(self._model, moved, np.zeros_like(moved)) / FAR

    def _wanted(self, tip: RubbingTip, here: LocalSolution[Rest]) -> tuple[FloatArray, float] | None:
        """What the motors turn to the goal by the first linear model that leads there, and how far the springs then move."""
        basis, scale = self._model.actuators.basis, self._model.motor_scale.max()
        with contextlib.suppress(NeutralEquilibrium):
            for model in tip_models(tip, here):
                left, sizes, right = np.linalg.svd(model.slope @ basis * scale, full_matrices=False)
                moves = sizes > _NO_MOTION * self._model.reach
                turn = scale * basis @ (right[moves].T @ ((left[:, moves].T @ model.missing) / sizes[moves]))
                if np.linalg.norm(model.missing - model.slope @ turn) <= 0.5 * np.linalg.norm(model.missing):
                    return turn, self._far(model.shift + model.follow @ turn)
        return None

    def _least(self, tip: RubbingTip, motors: FloatArray, found: LocalSolution[Rest]) -> LocalSolution[Rest]:
        """Return the solution nearest to motors, of those that press the tip harder or less hard against its obstacle."""
        actuators, inverse = self._model.actuators, np.linalg.pinv(self._model.actuators.basis)
        for _ in range(_MOST_NEARER):
            slope, follow = tip.motion(found.state)
            _, sizes, right = np.linalg.svd(slope @ actuators.basis)
            beside = right[int(np.sum(sizes > _NO_MOTION * sizes[0])) :]
            back = -actuators.basis @ (beside.T @ (beside @ (inverse @ (found.q_motors - motors))))
            if float(np.abs(back / self._model.motor_scale).max()) <= SAME:
                break
            moved = actuators.go(found.q_motors, back)
            springs = found.state.q_springs + follow @ (moved - found.q_motors)
            nearer = search(tip, moved, springs, tolerance=self._tolerance, damping=WARM_DAMPING)
            if nearer is None or not nearer.arrived(self._tolerance):
                break
            found = nearer
        return found

    def blocked(self, place: float, here: Rest) -> Rest | None:
        """Let a tip that jams press less, and go on.

        Raises:
            TargetUnreachable: If it does not move then either.
        """
        work, eased = 0.0, here
        for _ in range(_MOST_EASED):
            less = press_less(eased) if eased.statuses else None
            if less is None:
                break
            eased, work = less, work + less.work
            there = self.step(place, eased)
            if there is not None:
                return there._replace(work=work + there.work)
        number, best = min(int(place), len(self._goals) - 2) + 2, here.equilibrium()
        left = float(np.linalg.norm(self._goals[number - 1].position - best.tip_position))
        held = [f"{one.link!r} {one.status} on {one.obstacle!r} with {one.normal_force:.3g} N" for one in best.contacts]
        raise TargetUnreachable(
            f"waypoint {number} of {len(self._goals)}: with friction no small step leads nearer from where the tip is "
            f"{left:.6g} m from it, with motors {best.q_motors.round(6).tolist()}"
            + (f"; {', '.join(held)}, also when pressed less" if held else obstructed(here.robot.given, here)),
            best=best,
            residual=left,
            iterations=best.iterations,
        )


def follow_targets(
    model: SoftModel,
    goals: list[Goal],
    times: FloatArray,
    load: Load,
    first: Equilibrium,
    friction: float,
    *,
    tolerance: float,
    progress: bool | str,
) -> ContactPath:
    """Move the tip of a robot in contact from waypoint to waypoint, with friction from the first one on.

    Args:
        model: The robot.
        goals: The waypoints.
        times: Their times, shape (n,) [s].
        load: Its load, with the obstacles.
        first: The robot at the first waypoint; friction has nothing to remember of how it came there.
        friction: Friction coefficient [-].
        tolerance: Largest distance of the tip from a waypoint [m].
        progress: See `follow_trajectory`.

    Returns:
        The path, as far as it was followed if it is interrupted (Ctrl-C).

    Raises:
        TargetUnreachable: If a waypoint cannot be reached from the last one.
        EquilibriumNotFound: If the robot is not at rest at the first one.
    """
    way = TargetWay(model, goals, times, load, tolerance)
    walk, begin = ContactWalk(way), way.begin(first, friction)
    if begin is None:
        raise EquilibriumNotFound(
            "the robot does not rest at the first waypoint", best=first, residual=first.residual, iterations=first.iterations
        )
    rows, worked, ended = list[Equilibrium](), list[float](), ""
    steps = with_progress(walk.rows(begin, len(goals)), progress, label="waypoints in contact", unit="wp", total=len(goals))
    try:
        for rest in steps:
            rows.append(rest.equilibrium())
            worked.append(walk.work)
    except KeyboardInterrupt:
        if not rows:
            raise
        ended = "interrupted"
    return ContactPath(
        read_only(times[: len(rows)].copy()), tuple(rows), friction, read_only(np.array(worked)), tuple(walk.events), (), ended
    )
