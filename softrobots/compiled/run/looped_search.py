"""Load estimation and inverse kinematics of looped chains.

The searches of `statics.tip_force.force_search` and `statics.tip_search`, as in the solvers on Pinocchio, with equilibria and
Jacobians of generated code (`softrobots.compiled.chain.looped_tip`). A step costs some tens of microseconds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from softrobots.compiled.run.actuation import Actuation
from softrobots.compiled.run.friction_states import StatesBefore, gripping, remembered, state_after
from softrobots.compiled.run.results import MotorBatch
from softrobots.compiled.settings import HIDDEN, LEAST_SIZE, SEARCH_STEPS
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray, positive_integer
from softrobots.model.soft_model import SoftModel
from softrobots.statics.elastic_state import ElasticState, elastic_state
from softrobots.statics.loads import Load
from softrobots.statics.tip_force.force_search import Directions, search_force, torque_tolerance
from softrobots.statics.tip_goal import Goal, LoadedTip
from softrobots.statics.tip_search import LocalSolution, advance, search
from softrobots.statics.tip_steps import Pull, TipModel, keeps_muscles, taken_up

_ROUNDING = 1e-9  # by which a motor may be beyond its limits [rad, m or N]


class ChainState(NamedTuple):
    """Result of `LoopedSearch.settle`."""

    w: Any
    """The workspace, not shared."""
    q_springs: FloatArray
    """Elastic coordinates, shape (n_springs,) [rad or m]."""
    pulled: ElasticState | None = None
    """The robot there in Pinocchio, where its tensions are sought, too."""


class LoopedSearch:
    """Searches for the force or the actuators, like the functions in `motor_drivers`."""

    def __init__(self, model: SoftModel, actuation: Actuation, run: Any, before: StatesBefore | None = None) -> None:
        """Use the functions of a program with the response of the tip; `before`: where a robot with dry friction comes from."""
        self.model, self.actuation, self.run, self._before = model, actuation, run, before
        self._start, self._given = model.rest, dict[str, Any]()
        if before is not None:
            self._start, self._given = before.springs[0], {"sliders": before.sliders[0], "anchors": before.anchors[0]}
            self.model = remembered(actuation, before)

    def after(self, w: Any) -> LoopedSearch:
        """Return the searches from a state that was found; the same ones without dry friction."""
        return LoopedSearch(self.model, self.actuation, self.run, state_after(self.actuation, self.run.layout, w))

    def settle(
        self, q_motors: FloatArray, force: FloatArray, gravity: FloatArray, start: FloatArray
    ) -> tuple[Status, ChainState]:
        """Find the equilibrium from given elastic coordinates."""
        unknowns = self.actuation.unknowns(q_motors, start)
        given = self._given | {"force": force, "gravity": gravity, "unknown": unknowns}
        w = self.actuation.workspace(self.run, q_motors, **given)
        status = Status(self.run.settle_from(w))
        return status, ChainState(w, self.actuation.elastic(self.unknowns(w)))

    def unknowns(self, w: Any) -> FloatArray:
        """Return the unknown strains, shape (n,)."""
        return self._part(w, self.run.layout.unknown, self.run.layout.unknowns)

    def tip(self, w: Any) -> FloatArray:
        """Return the loaded tip, shape (3,) [m]."""
        return self._part(w, self.run.layout.tip, 3)

    def residual(self, w: Any) -> float:
        """Return the norm of the out-of-balance torque [N m]."""
        return math.sqrt(w[self.run.layout.single("error")])

    def jacobian(self, w: Any) -> FloatArray:
        """Return the elastostatic Jacobian of all actuators, shape (3, n_motors)."""
        self.run.look_at_tip(w)
        return self.actuation.jacobian(self.run, w)

    def estimate(self, q_motors: FloatArray, torques: FloatArray, gravity: FloatArray) -> tuple[Status, Any]:
        """Find the force that explains motor torques; return the status, and a workspace as of `motor_drivers.estimate`."""
        problem = _MeasuredTorques(self, q_motors, torques, gravity)
        status, state = self.settle(q_motors, np.zeros(3), gravity, self._start)
        single = self.run.layout.single
        if status != Status.CERTIFIED:
            return status, state.w
        tolerance = torque_tolerance(torques)
        _, state, iterations = search_force(
            problem, problem.looked_at(state), SEARCH_STEPS, reach=self.model.reach, tolerance=tolerance
        )
        left, values, _, observable = problem.directions(state)
        unexplained = problem.unexplained(state)
        missing = float(np.linalg.norm(left[:, : len(values)].T @ unexplained))
        size = max(float(np.linalg.norm(torques)), LEAST_SIZE)
        state.w[single("unexplained")], state.w[single("missing")] = float(unexplained @ unexplained), missing**2
        whole = len(values) == 3  # with fewer actuators a force is never observable
        state.w[single("observed")] = float(values[-1]) ** 2 if whole else 0.0
        state.w[single("iterations")] = float(iterations)
        if not (whole and observable.all()) and missing <= HIDDEN * size:
            return Status.UNOBSERVABLE, state.w
        return Status.CERTIFIED if missing <= tolerance else Status.NOT_REACHED, state.w

    def reach(
        self,
        target: FloatArray,
        force: FloatArray,
        gravity: FloatArray,
        q_motors: FloatArray,
        start: FloatArray,
        tolerance: float,
    ) -> tuple[Status, LocalSolution[ChainState]]:
        """Find actuators that put the tip within the tolerance [m] of a target, from given ones and elastic coordinates."""
        first = self.model.actuators.go(q_motors, np.zeros(len(q_motors)))  # within the limits
        tip = _SoughtTip(self, force, gravity, target, first)
        first, start = tip.loaded.begin(first, start, tolerance)
        status, state = self.settle(first, force, gravity, start)
        found = search(tip, first, start, tolerance=tolerance) if status == Status.CERTIFIED else None
        if found is None:
            return status, LocalSolution(first, state, float(np.linalg.norm(tip.missing(state))))
        return self._arrived(found, tolerance), found

    def follow(
        self, targets: FloatArray, force: FloatArray, gravity: FloatArray, q_motors: FloatArray, tolerance: float
    ) -> tuple[MotorBatch, int]:
        """Move the tip through targets, shape (n, 3) [m], each step from the last; see `reach`.

        Returns:
            One row a waypoint, with the last reached pose where no continuous motion leads further; and the number of steps to
            the first waypoint.
        """
        status, here = self.reach(targets[0], force, gravity, q_motors, self._start, tolerance)
        tip, last, first = _SoughtTip(self.after(here.state.w), force, gravity, targets[0]), targets[0], here
        poses, statuses = [here], [status]
        for target in targets[1:] if status == Status.CERTIFIED else ():
            there = advance(tip, Goal(last), Goal(target), here, tolerance)
            if there is None:
                distance = float(np.linalg.norm(target - self.tip(here.state.w)))
                poses.append(replace(here, error=distance))
                statuses.append(Status.NOT_REACHED)
            else:
                here, last = there, target
                poses.append(here)
                tip = replace(tip, chain=tip.chain.after(here.state.w))
                statuses.append(self._arrived(here, tolerance))
        batch = MotorBatch(
            np.array([one.state.q_springs for one in poses]),
            np.array(statuses, dtype=np.uint8),
            np.array([self.residual(one.state.w) for one in poses]),
            np.array([one.q_motors for one in poses]),
            np.array([one.error for one in poses]),
        )
        return batch, first.iterations

    def estimate_batch(
        self, motors: FloatArray, torques: FloatArray, gravity: FloatArray, threads: int
    ) -> tuple[Any, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Find the forces of many cases, one after the other whatever the number of threads.

        Returns:
            Status, unknowns, force, residual, unexplained torque and observability of each case.

        Raises:
            ParameterError: If the number of threads is not positive.
        """
        positive_integer("threads", threads)
        count, layout = len(motors), self.run.layout
        statuses, unknowns, forces = np.zeros(count, dtype=np.uint8), np.zeros((count, layout.unknowns)), np.zeros((count, 3))
        norms = np.zeros((3, count))
        for row in range(count):
            one = self if self._before is None else LoopedSearch(self.model, self.actuation, self.run, self._before.row(row))
            statuses[row], w = one.estimate(motors[row], torques[row], gravity)
            unknowns[row], forces[row] = self.unknowns(w), self._part(w, layout.force, 3)
            norms[:, row] = [math.sqrt(w[layout.single(name)]) for name in ("error", "unexplained", "observed")]
        return statuses, unknowns, forces, norms[0], norms[1], norms[2]

    def reach_batch(
        self,
        targets: FloatArray,
        forces: FloatArray,
        gravity: FloatArray,
        motors: FloatArray,
        unknowns: FloatArray,
        tolerance: float,
        threads: int,
    ) -> tuple[Any, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Put the tips at their targets, one after the other; see `reach` and `estimate_batch`.

        Returns:
            Status, actuators, unknowns, residual, distance from the target and angle (here of positions, zero) of each case.
        """
        positive_integer("threads", threads)
        statuses, motors, unknowns = np.zeros(len(motors), dtype=np.uint8), motors.copy(), unknowns.copy()
        norms = np.zeros((2, len(motors)))
        for row in range(len(motors)):
            start = self.actuation.elastic(unknowns[row])
            statuses[row], found = self.reach(targets[row], forces[row], gravity, motors[row], start, tolerance)
            motors[row], unknowns[row] = found.q_motors, self.unknowns(found.state.w)
            norms[:, row] = self.residual(found.state.w), found.error
        return statuses, motors, unknowns, norms[0], norms[1], np.zeros(len(motors))

    def _arrived(self, found: LocalSolution[ChainState], tolerance: float) -> Status:
        if not found.arrived(tolerance):
            return Status.NOT_REACHED
        low, high = self.model.motor_limits.T
        outside = np.any((found.q_motors < low - _ROUNDING) | (found.q_motors > high + _ROUNDING))
        return Status.BEYOND_LIMITS if outside else Status.CERTIFIED

    def _part(self, w: Any, place: int, count: int) -> FloatArray:
        return np.array(w[place : place + count], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _MeasuredTorques:
    """Problem of `search_force`; its states have the response of the tip."""

    chain: LoopedSearch
    motors: FloatArray
    torques: FloatArray
    gravity: FloatArray

    def looked_at(self, state: ChainState) -> ChainState:
        self.chain.run.look_at_tip(state.w)
        return state

    def equilibrium(self, force: FloatArray, is_near: ChainState) -> ChainState | None:
        status, state = self.chain.settle(self.motors, force, self.gravity, is_near.q_springs)
        return self.looked_at(state) if status == Status.CERTIFIED else None

    def unexplained(self, state: ChainState) -> FloatArray:
        loads = self.chain.actuation.loads(self.chain.run, state.w)
        return np.where(self.chain.model.actuators.feels, self.torques - loads, 0.0)

    def directions(self, state: ChainState) -> Directions:
        return Directions.of(self.chain.actuation.feeling(self.chain.run, state.w), self.chain.model.reach)


@dataclass(frozen=True, eq=False)
class _SoughtTip:
    """Problem of `tip_search`, see `tip_search.SoughtTip`."""

    chain: LoopedSearch
    force: FloatArray
    gravity: FloatArray
    target: FloatArray
    home: FloatArray | None = None

    @property
    def model(self) -> SoftModel:
        return self.chain.model

    @property
    def rows(self) -> int:
        return 3

    def towards(self, target: Goal) -> _SoughtTip:
        return replace(self, target=target.position)

    def solve(self, q_motors: FloatArray, start: FloatArray) -> LocalSolution[ChainState] | None:
        if not self.model.actuators.admit(q_motors):
            return None
        status, state = self.chain.settle(q_motors, self.force, self.gravity, start)
        if status != Status.CERTIFIED:
            return None
        excess = 0.0
        if keeps_muscles(self.model) or self.model.structure.friction is not None:
            rubbing = gripping(self.model, self.chain.run.layout, state.w)
            pulled = elastic_state(rubbing, q_motors, state.q_springs, self.loaded.load)
            taut, excess = taken_up(self.model, q_motors, pulled)
            if not np.array_equal(taut, q_motors):
                return self.solve(taut, state.q_springs)
            state = state._replace(pulled=pulled)
        return LocalSolution(q_motors, state, float(np.linalg.norm(self.missing(state))), excess=excess)

    @property
    def loaded(self) -> LoadedTip:
        """The same on Pinocchio, for the derivatives of tensions."""
        return LoadedTip(self.model, Goal(self.target), Load.of(self.model, self.force, gravity=self.gravity), home=self.home)

    def missing(self, state: ChainState) -> FloatArray:
        return np.asarray(self.target - self.chain.tip(state.w))

    def released(self, here: LocalSolution[ChainState], held: TipModel, damping: float) -> list[TipModel]:
        """Return the model in which all slips, of a robot with dry friction; there are no obstacles."""
        pulled = here.state.pulled
        return [] if pulled is None else self.loaded.released(LocalSolution(here.q_motors, pulled, here.error), held, damping)

    def pull(self, state: ChainState, follow: FloatArray) -> Pull | None:
        """Return the tensions with their derivatives; None of muscles that push, whose tensions are not given."""
        return None if state.pulled is None else self.loaded.pull(state.pulled, follow)

    def motion(self, state: ChainState) -> tuple[FloatArray, FloatArray]:
        """Return the Jacobian of the tip, and how the springs follow; zeros without tensions: their first Newton step tells."""
        if state.pulled is not None:
            return self.loaded.motion(state.pulled)
        return self.chain.jacobian(state.w), np.zeros((len(state.q_springs), self.model.n_motors))
