"""A compiled motion once more, by Pinocchio: its torques and energies."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from softrobots.compiled.run.motion_course import Course, motors_of_steps
from softrobots.compiled.run.motion_runs import StepsTaken
from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.gauss import GaussRule
from softrobots.dynamics.midpoint import State, Step
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.recorder import Recorder
from softrobots.dynamics.step_control import RULES, NoStep, follow

_WHOLE = 1e-9  # rad or m by which one midpoint step may seem to miss its end; one that was halved does so by h^2


def replay(
    equations: EquationsOfMotion,
    course: Course,
    taken: StepsTaken,
    rows: FloatArray,
    facts: dict[str, Any],
    order: int,
    start: State,
) -> Motion:
    """Return the motion with torques and energies, by Pinocchio, from the states at the ends of all steps.

    Steps of fourth order, and those with dry friction, are taken again, each from where the compiled ones came to; so are those
    that had to be halved.

    Args:
        equations: Equations of motion.
        course: What drove it.
        taken: The steps, with a row at each end of a step; elastic coordinates and rates instead of unknowns and theirs.
        rows: Times of the rows, shape (n,) [s].
        facts: Other fields of the motion.
        order: Order of the steps.
        start: The first state.

    Raises:
        NotConverged: If such a step is not found again.
    """
    m, k, count = equations.n_motors, equations.n - equations.n_motors, 2 * len(taken.grid) - 1
    motors, states = np.broadcast_to(motors_of_steps(course.path, taken.grid), (count, m)), taken.rows[0]

    recorder = Recorder(RULES[order](equations, course.path, course.load), start, rows)
    for step, end in enumerate(taken.grid[1:].tolist()):
        before = recorder.state
        h, middle_time = end - before.time, 0.5 * (before.time + end)
        u0, middle, u1 = motors[2 * step : 2 * step + 3]
        y1, v1, v0 = states[step + 1, :k], states[step + 1, k : 2 * k], before.rates[m:]
        accelerations = np.concatenate([4.0 * (u1 - 2.0 * middle + u0) / h**2, (v1 - v0) / h])
        rates = np.concatenate([(u1 - u0) / h, 0.5 * (v0 + v1)])
        x, half = np.concatenate([middle, before.x[m:] + 0.5 * h * rates[m:]]), 0.5 * h * accelerations[:m]
        last, again = State(end, np.concatenate([u1, y1]), np.concatenate([rates[:m] + half, v1])), None
        if order == GaussRule.order or start.memory is not None:
            again = recorder.rule.step(before, end)
            again = again and again._replace(end=last._replace(memory=again.end.memory))
        elif np.allclose(before.x[m:] + h * rates[m:], y1, rtol=_WHOLE, atol=_WHOLE):
            begin = State(before.time, before.x, np.concatenate([rates[:m] - half, v0]))
            wrenches = course.load(middle_time)
            forces = equations.balance(x, rates, accelerations, wrenches)[:m]
            again = Step(begin, last, State(middle_time, x, rates), accelerations, forces, wrenches)
        kicked = end in course.path.kicks and end < recorder.duration
        if again is None:
            _take_parts(recorder, end)
            recorder.state = recorder.state if kicked else last._replace(memory=recorder.state.memory)
            continue
        recorder.add(again)
        if kicked:
            recorder.kick(course.path.kicks[end])
    return recorder.motion(**facts)


def _take_parts(recorder: Recorder, end: float) -> None:
    """Take a step to a time [s] that does not succeed as a whole."""
    try:
        list(follow(recorder, np.array([recorder.state.time, end])))
    except NoStep as error:
        why = f"the step to {end:g} s has no energies: Pinocchio did not find it again; required shorter steps: {error}"
        raise NotConverged(why, best=None, residual=math.inf, iterations=len(recorder.times)) from error
