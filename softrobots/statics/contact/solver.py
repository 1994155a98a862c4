r"""Equilibrium in contact without friction: the energy is least under gaps of zero or more.

.. math:: r(y) = \sum_i \lambda_i \frac{dg_i}{dy}, \qquad g_i \ge 0,\quad \lambda_i \ge 0,\quad \lambda_i g_i = 0

Sequential quadratic programming with the exact Hessian of the Lagrangian (Nocedal and Wright, Numerical Optimization, 2006,
chapter 18): each step solves a quadratic programme over the linearised gaps, and is halved until the energy plus a price on the
deepest penetration has decreased; a step that penetrates is first brought back to the surface. Near the solution, where the
pressed contacts no longer change, these are Newton's steps on the equations above.
"""

from __future__ import annotations

import math

import numpy as np
from eigenpy import LDLT

from softrobots.core.checks import FloatArray
from softrobots.model.springs import POSITIVE
from softrobots.statics.contact.certificate import softest_motion
from softrobots.statics.contact.convex_step import Step, contact_step, nearest_step, repairing_step
from softrobots.statics.contact.touch import TOUCHING, ForceTable, Touch
from softrobots.statics.elastic_state import ElasticProblem, ElasticState, largest_residual, norm
from softrobots.statics.stability import is_stable

_LARGEST_STEP = 0.5  # [rad], norm of one step; the linear model of a revolute chain is inaccurate beyond
_ARMIJO = 1e-4  # share of the predicted decrease that a step must reach
_SHORTEST = 1e-10  # share of a step below which it is not halved again
_DEEP = 1e-2  # penetration that is repaired before energies count, relative to the reach
_EXACT = 1e-12  # gap of a pressed contact that is zero, relative to the reach
_LEAST_DAMPING = 0.02  # of the step after one that was cut, relative to the springs
_ESCAPE = 0.1  # [rad], step out of an unstable equilibrium


def settle(problem: ElasticProblem, start: FloatArray, most: int) -> tuple[ElasticState, int, bool]:
    """Find an equilibrium in contact by descent from a start.

    Args:
        problem: The robot under a load that has a potential, with an environment.
        start: Elastic coordinates, shape (n_springs,) [rad or m].
        most: Limit of evaluations.

    Returns:
        The last state, whether or not it is an equilibrium; the evaluations spent; and whether it is a stable equilibrium.
    """
    state, spent = _repaired(problem, problem.state(start), most)
    price, damping = 0.0, 0.0
    factors = LDLT(len(start))
    while spent < most and state.touch is not None and not _blocked(state.touch, problem.model.reach):
        if error_of(problem, state) > 1.0:
            step = _step(problem, state, state.touch, damping, factors)
        else:
            step = _way_out(problem, state, state.touch)
        if step is None:
            break
        trial, used, price = _search(problem, state, state.touch, step, price, most - spent)
        spent += used
        if trial is None:
            break
        damping = _LEAST_DAMPING + 4.0 * damping if used > 2 else 0.25 * damping if damping > _LEAST_DAMPING else 0.0
        state = trial
    return state, spent, is_stable(problem.model, problem.load, state, problem.tolerance)


def error_of(problem: ElasticProblem, state: ElasticState) -> float:
    """Largest of residual, penetration and gaps of forces, relative to what is required; 1 or less at an equilibrium."""
    touch = state.touch
    if touch is None or not math.isfinite(state.energy):
        return math.inf
    allowed = largest_residual(problem.model, state.scale, problem.tolerance)
    open_gap = float(np.abs(touch.gaps.values[touch.forces > 0.0]).max(initial=0.0))
    return max(state.error / allowed, max(touch.penetration, open_gap) / (_EXACT * problem.model.reach))


def _repaired(problem: ElasticProblem, state: ElasticState, most: int) -> tuple[ElasticState, int]:
    """Bring a robot that starts deep inside of obstacles towards their surface, bending it little; and the evaluations."""
    reach, spent, longest = problem.model.reach, 1, _LARGEST_STEP
    while spent < most and state.touch is not None and state.touch.penetration > _DEEP * reach and longest > _SHORTEST:
        touch = state.touch
        step = (
            None if _blocked(touch, reach) else repairing_step(touch.gaps.values, touch.rows, problem.model.stiffness, longest)
        )
        if step is None:
            break
        trial = problem.state(state.q_springs + step)
        spent += 1
        promised = touch.penetration - max(0.0, -float((touch.gaps.values + touch.rows @ step).min()))
        if trial.touch is None or touch.penetration - trial.touch.penetration < 0.1 * promised:
            longest *= 0.25
        else:
            state = trial
        if promised < 1e-3 * touch.penetration:  # no way out to first order
            break
    return state, spent


def _blocked(touch: Touch, reach: float) -> bool:
    """Whether something penetrates that no spring moves."""
    deep = touch.gaps.values < -TOUCHING * reach
    return bool(deep.any()) and not touch.rows[deep].any(axis=1).all()


def _step(problem: ElasticProblem, state: ElasticState, touch: Touch, damping: float, factors: LDLT) -> Step | None:
    """Step of the quadratic programme over the gaps that it can close."""
    stiffness, values = problem.model.stiffness, touch.gaps.values
    load = state.residual + touch.pushes
    within = np.flatnonzero(values <= _LARGEST_STEP * np.linalg.norm(touch.rows, axis=1))
    held = touch.forces[within] > 0.0
    found = contact_step(
        state.tangent, load, values[within], touch.rows[within], held, stiffness, _LARGEST_STEP, damping, factors
    )
    if found is None:
        return None
    forces = np.zeros(len(values))
    forces[within] = found.forces
    return found._replace(forces=forces)


def _way_out(problem: ElasticProblem, state: ElasticState, touch: Touch) -> Step | None:
    """Step out of an unstable equilibrium along its softest motion that the contacts leave; None at any other.

    Of two signs that are free the one with the positive largest component is taken, so that results repeat.
    """
    model, allowed = problem.model, largest_residual(problem.model, state.scale, problem.tolerance)
    curvature, motion = softest_motion(state.tangent, model.stiffness, touch, model.reach, allowed)
    if curvature > -POSITIVE or not math.isfinite(curvature):
        return None
    motion = motion * (_ESCAPE / norm(motion))
    if motion[np.argmax(np.abs(motion))] < 0.0:
        motion = -motion
    for wanted in (motion, -motion):
        step = nearest_step(wanted, touch.gaps.values, touch.rows, model.stiffness)
        if step is not None and float(step @ state.tangent @ step) < 0.0 and norm(step) > 0.1 * norm(wanted):
            return Step(step, touch.forces, False)
    return None


def _back_to_surface(touch: Touch, stiffness: FloatArray) -> FloatArray | None:
    """Shortest step that closes the gaps with a force and opens penetrations."""
    return nearest_step(np.zeros(len(stiffness)), touch.gaps.values, touch.rows, stiffness, touch.forces > 0.0)


def _search(
    problem: ElasticProblem, state: ElasticState, touch: Touch, step: Step, price: float, most: int
) -> tuple[ElasticState | None, int, float]:
    """Go along a step as far as energy and penetration allow.

    Returns:
        The next state, or None where nothing is gained any more; the evaluations spent; and the price of penetration [N].
    """
    whole = step.step
    scale = min(1.0, _LARGEST_STEP / max(norm(whole), 1e-300))
    deep = touch.penetration
    closes = deep - max(0.0, -float((touch.gaps.values + scale * (touch.rows @ whole)).min(initial=0.0)))
    downhill = scale * float((state.residual + touch.pushes) @ whole)
    price = max(2.0 * float(step.forces.sum()), 0.5 * price, 2.0 * downhill / closes if closes > 0.0 else 0.0)
    predicted = downhill - price * closes
    rounding = problem.rounding(state) + 1e-15 * price * problem.model.reach
    if predicted > -rounding:
        predicted = min(0.0, 0.5 * scale**2 * float(whole @ state.tangent @ whole))
    error, merit = error_of(problem, state), state.energy + price * deep

    def better(trial: ElasticState, share: float) -> bool:
        if trial.touch is None:
            return False
        if share * scale == 1.0 and step.exact and error_of(problem, trial) <= 0.5 * error:
            return True
        if predicted > -rounding:
            return error > 1.0 and error_of(problem, trial) < error
        return trial.energy + price * trial.touch.penetration <= merit + _ARMIJO * share * predicted + rounding

    share, spent = 1.0, 0
    while spent < most and share > _SHORTEST:
        forces = touch.forces + share * scale * (step.forces - touch.forces)
        table = ForceTable(touch.gaps.keys, forces)
        trial = problem.state(state.q_springs + share * scale * whole, table)
        spent += 1
        if better(trial, share):
            return trial, spent, price
        if share == 1.0 and trial.touch is not None and spent < most:
            back = _back_to_surface(trial.touch, problem.model.stiffness)
            if back is not None and norm(back) <= norm(whole):
                trial = problem.state(trial.q_springs + back, table)
                spent += 1
                if better(trial, share):
                    return trial, spent, price
        if predicted > -rounding:
            break
        share *= 0.5
    return None, spent, price
