r"""Search for an equilibrium in contact without friction: the energy is least under gaps of zero or more.

.. math:: r(y) = \sum_i \lambda_i \frac{dg_i}{dy}, \qquad g_i \ge 0,\quad \lambda_i \ge 0,\quad \lambda_i g_i = 0

Sequential quadratic programming with the exact Hessian of the Lagrangian (Nocedal and Wright, Numerical Optimization, 2006,
chapter 18): each step solves a quadratic programme over the linearised gaps, and is halved until the energy plus a price on the
deepest penetration has decreased; a step that leaves the surface is first brought back to it. Near the solution, where the
pressed contacts no longer change, these are Newton's steps on the equations above.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from eigenpy import LDLT

from softrobots.core.checks import FloatArray
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.certificate import softest_motion
from softrobots.statics.contact.convex_step import Step, contact_step, nearest_step, repairing_step
from softrobots.statics.contact.touch import NEAR, NO_FORCES, TOUCHING, ForceTable, Touch, unmoved
from softrobots.statics.elastic_state import ElasticProblem, ElasticState, contact_softening, largest_residual, norm
from softrobots.statics.stability import is_positive

BALANCED = 1.0
"""Error of an equilibrium, see `Near.error`."""

_LARGEST_STEP = 0.5  # [rad], norm of one step; the linear model of a revolute chain is inaccurate beyond
_ARMIJO = 1e-4  # share of the predicted decrease that a step must reach
_SHORTEST = 1e-10  # share of a step below which it is not halved again
_DEEP = 1e-2  # penetration that is repaired before energies count, and that no step leads into, relative to the reach
_EXACT = 1e-12  # gap of a pressed contact that is zero, relative to the reach
_ROUNDING = 1e-15  # of a gap, relative to how far away the centre of an obstacle is
_LEAST_DAMPING = 0.02  # of the step after one that was cut, relative to the springs
_LEAST_SEEN = 0.01  # gaps below this share of the reach are always seen
_ESCAPE = 0.1  # [rad], step out of an unstable equilibrium


class Near(NamedTuple):
    """A state among surfaces, and how far it is from equilibrium."""

    state: ElasticState
    """The state."""
    touch: Touch
    """The surfaces near it."""
    error: float
    """Largest of residual, penetration and gaps of forces, relative to what is required; 1 or less at an equilibrium."""
    seen: float
    """Gaps below this share of the reach are seen."""
    load: FloatArray
    """Out-of-balance load without the contact forces, shape (n_springs,)."""

    @property
    def table(self) -> ForceTable:
        """Its contact forces."""
        return ForceTable.of(self.touch.gaps, self.touch.forces)


class ContactSearch:
    """Steps of a robot towards an equilibrium in contact; belongs to the thread that created it."""

    def __init__(self, problem: ElasticProblem, most: int) -> None:
        """Take the robot under a load, with an environment, and a limit of evaluations."""
        self.problem, self.most, self.spent = problem, most, 0
        """The robot under its load, the limit, and the evaluations spent."""
        self._stiffness, self._reach = problem.model.stiffness, problem.model.reach
        self._soft = 1.0 / np.sqrt(self._stiffness)
        self._factors, self._price, self._damping = LDLT(len(self._stiffness)), 0.0, 0.0

    def near(self, springs: FloatArray, forces: ForceTable = NO_FORCES, seen: float = NEAR) -> Near | None:
        """Evaluate elastic coordinates, shape (n_springs,), under contact forces; None beyond the range of a section.

        Gaps below `seen` times the reach are seen.
        """
        self.spent += 1
        state = self.problem.state(springs, forces, seen)
        touch = state.touch
        if touch is None or not math.isfinite(state.energy):
            return None
        gap = touch.penetration
        for value, force in zip(touch.gaps.values.tolist(), touch.forces.tolist(), strict=True):
            gap = max(gap, value) if force else gap
        allowed = largest_residual(self.problem.model, state.scale, self.problem.tolerance)
        error, apart = state.error / allowed, gap / (_EXACT * self._reach)
        if error <= BALANCED < apart:
            apart = gap / (_EXACT * self._reach + _ROUNDING * float(np.abs(touch.gaps.transforms).max(initial=0.0)))
        return Near(state, touch, max(error, apart), seen, state.residual + touch.forces.dot(touch.rows))

    def descend(self, here: Near) -> tuple[Near, bool]:
        """Descend to an equilibrium; it leaves unstable ones.

        Returns:
            The last state; and whether it is a stable equilibrium.
        """
        while self.spent < self.most:
            stable, step = False, None
            if here.error > BALANCED:
                step = self.step(here)
                if step is not None and here.seen < min(NEAR, _moved(step.step)):  # further than was looked
                    wider = self.near(here.state.q_springs, here.table)
                    here, step = (here, None) if wider is None else (wider, self.step(wider))
            else:
                stable, step = self._way_out(here)
            found = None if step is None else self._along(here, step)
            if found is None:
                return here, stable
            here = found
        return here, False

    def step(self, here: Near) -> Step | None:
        """Step of the quadratic programme over the gaps that are seen."""
        touch, tangent, limits = here.touch, here.state.tangent, (_LARGEST_STEP, self._damping)
        gaps, held = touch.gaps.values, touch.forces > 0.0
        found = contact_step(tangent, here.load, gaps, touch.rows, held, self._soft, limits, self._factors)
        if found is None or np.count_nonzero(touch.forces) or not np.count_nonzero(found.forces):
            return found
        tangent = tangent - contact_softening(here.state, found.forces)  # the first forces: how they soften counts, too
        held = found.forces > 0.0
        return contact_step(tangent, here.load, gaps, touch.rows, held, self._soft, limits, self._factors) or found

    def repaired(self, here: Near) -> Near:
        """Bring a robot that starts deep inside of obstacles towards their surface, bending it little."""
        longest = _LARGEST_STEP
        while here.touch.penetration > _DEEP * self._reach and longest > _SHORTEST and self.spent < self.most:
            touch = here.touch
            step = None if self.blocked(here) else repairing_step(touch.gaps.values, touch.rows, self._soft, longest)
            if step is None:
                break
            promised = touch.penetration - max(0.0, -float((touch.gaps.values + touch.rows @ step).min()))
            if promised < 1e-3 * touch.penetration:  # no way out to first order
                break
            trial = self.near(here.state.q_springs + step)
            if trial is None or touch.penetration - trial.touch.penetration < 0.1 * promised:
                longest *= 0.25
            else:
                here = trial
        return here

    def blocked(self, here: Near) -> bool:
        """Whether something penetrates that no spring moves."""
        deep = here.touch.gaps.values < -TOUCHING * self._reach
        return bool((deep & unmoved(here.touch, here.state.point)).any())

    def _way_out(self, here: Near) -> tuple[bool, Step | None]:
        """Certify an equilibrium; or step out of an unstable one along its softest motion that the contacts leave.

        Of two signs that are free the one with the positive largest component is taken, so that results repeat.
        """
        state, touch = here.state, here.touch
        if is_positive(self.problem.model, state.tangent, self._factors, times=2.0):  # on all motions
            return True, None
        allowed = largest_residual(self.problem.model, state.scale, self.problem.tolerance)
        curvature, motion = softest_motion(state.tangent, self._stiffness, touch, self._reach, allowed)
        if curvature > -POSITIVE or not math.isfinite(curvature):
            return curvature > POSITIVE, None
        motion = motion / norm(motion)
        if motion[np.argmax(np.abs(motion))] < 0.0:
            motion = -motion
        gaps = touch.gaps.values
        for wanted in (motion, -motion):
            closing = np.where(gaps > TOUCHING * self._reach, -(touch.rows @ wanted), 0.0)
            longest = float((gaps[closing > 0.0] / closing[closing > 0.0]).min(initial=np.inf))
            size = min(_ESCAPE, 0.5 * longest)
            step = nearest_step(size * wanted, gaps, touch.rows, self._soft)
            if step is not None and float(step @ state.tangent @ step) < 0.0 and norm(step) > 0.1 * size:
                return False, Step(step, touch.forces, False)
        return False, None

    def _along(self, here: Near, step: Step) -> Near | None:
        """Go along a step as far as energy and penetration allow; None where nothing is gained any more."""
        state, touch = here.state, here.touch
        length = norm(step.step)
        whole, change = step.step, step.forces - touch.forces
        if length > _LARGEST_STEP:
            whole, change = whole * (_LARGEST_STEP / length), change * (_LARGEST_STEP / length)
        deep, first, share = touch.penetration, self.spent, 1.0
        deepest = max(deep, _DEEP * self._reach)
        seen = min(NEAR, max(_LEAST_SEEN, 2.0 * _moved(whole)))  # steps shrink: what the next one may touch
        table = ForceTable.of(touch.gaps, touch.forces + change)
        trial = self.near(state.q_springs + whole, table, seen)
        self._price = max(2.0 * sum(step.forces.tolist()), 0.5 * self._price)
        exact = step.exact and length <= _LARGEST_STEP and trial is not None and trial.touch.penetration <= deepest
        if trial is not None and exact and trial.error <= 0.5 * here.error:
            self._damp(False)
            return trial
        closes = deep - max(0.0, -float((touch.gaps.values + touch.rows @ whole).min())) if deep > 0.0 else 0.0
        downhill = float(here.load @ whole)
        price = self._price = max(self._price, 2.0 * downhill / closes if closes > 0.0 else 0.0)
        predicted = downhill - price * closes
        rounding = self.problem.rounding(state) + 1e-15 * price * self._reach
        if predicted > -rounding:
            predicted = min(0.0, 0.5 * float(whole @ state.tangent @ whole))
        below = predicted > -rounding  # rounding of the energy: it says nothing, the error must shrink

        def better(trial: Near | None, share: float) -> bool:
            if trial is None or trial.touch.penetration > deepest:
                return False
            if below:
                return BALANCED < here.error > trial.error
            merit = trial.state.energy + price * trial.touch.penetration
            return merit <= state.energy + price * deep + _ARMIJO * share * predicted + rounding

        if trial is not None and not better(trial, share):
            back = _back_to_surface(trial.touch, self._soft)
            if back is not None and norm(back) <= norm(whole):
                trial = self.near(trial.state.q_springs + back, table, seen)
        while not better(trial, share):
            share *= 0.5
            if below or self.spent >= self.most or share <= _SHORTEST:
                return None
            table = ForceTable.of(touch.gaps, touch.forces + share * change)
            trial = self.near(state.q_springs + share * whole, table, seen)
        self._damp(self.spent > first + 2)
        return trial

    def _damp(self, cut: bool) -> None:
        """Damp the next step more after one that was cut, else less."""
        self._damping = _LEAST_DAMPING + 4.0 * self._damping if cut else 0.25 * self._damping
        self._damping *= self._damping >= _LEAST_DAMPING


def _moved(step: FloatArray) -> float:
    """How far a step of the springs moves the robot at most, relative to the reach."""
    return float(sum(map(abs, step.tolist())))


def _back_to_surface(touch: Touch, soft: FloatArray) -> FloatArray | None:
    """Shortest step that closes the gaps with a force and opens penetrations."""
    return nearest_step(np.zeros(len(soft)), touch.gaps.values, touch.rows, soft, touch.forces > 0.0)
