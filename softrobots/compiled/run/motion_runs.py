"""Runs of the generated code of motion: of one case, of many, with shorter and shorter steps, and once more in Python."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.compiled.run.motion_cases import MotionCases
from softrobots.compiled.run.motion_course import Course, forces_of_steps, motors_of_steps
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.midpoint import MidpointRule, State, Step
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.recorder import Recorder
from softrobots.model.soft_model import SoftModel

_FIRST_STEPS = 400  # of the first of the runs that are compared
_STALLED = 4  # runs in which the error of the tip is to halve at least once
_CHUNK = 2_000  # steps between two looks for Ctrl-C
_SAMPLES = 2_000_000  # of motor positions in memory

MOST_STEPS = 1_000_000
"""Most steps of one run that is refined for a tolerance."""

Given = Sequence[tuple[int, FloatArray]]
"""Places in the workspace, and what stands there."""


def time_grid(end: float, step: float) -> FloatArray:
    """Return times from zero to the end, `step` apart, the last one nearer if need be, shape (n,) [s]."""
    return np.append(step * np.arange(math.ceil(end / step - 1e-9)), end)


@dataclass(frozen=True)
class Taken:
    """Steps that were taken by one case or many."""

    grid: FloatArray
    """Ends of the steps, the first included, shape (m,) [s]."""
    rows: FloatArray
    """Unknowns, rates and tip at the times looked at, NaN where they were not reached, shape (n, t, 2 N + 3)."""
    status: Any
    """Status of each case, shape (n,)."""
    interrupted: bool = False
    """Whether Ctrl-C ended it."""
    errors: FloatArray | None = None
    """Measured error of the tip, the largest of all times looked at, shape (n,) [m]."""
    is_within: bool = True
    """Whether that is within the tolerance; so are fixed steps."""


def finer_and_finer(
    take: Callable[[FloatArray], Taken], end: float, breaks: FloatArray, tolerance: float, bad: Any = False
) -> Taken:
    """Halve all steps until the tips of the valid cases are known to a tolerance; return the last run.

    As the scheme is of second order, the finer of two runs has a third of the difference of their tips as its error. `bad`
    marks cases that do not count.
    """
    stops = np.unique([0.0, *(time for time in breaks.tolist() if 1e-9 * end < time < end * (1.0 - 1e-9)), end])
    counts = np.ceil(np.diff(stops) / end * _FIRST_STEPS)
    ends = zip(stops[:-1], stops[1:], counts.astype(int) + 1, strict=True)
    grid = np.append(np.concatenate([np.linspace(one, other, count)[:-1] for one, other, count in ends]), end)
    before, history = take(grid), [math.inf]
    while not before.interrupted:
        finer = np.zeros(2 * len(grid) - 1)
        finer[::2], finer[1::2] = grid, 0.5 * (grid[1:] + grid[:-1])
        now, grid = take(finer), finer
        errors = np.linalg.norm(now.rows[..., -3:] - before.rows[..., -3:], axis=2).max(axis=1) / 3.0
        sure = (now.status == Status.CERTIFIED) & (before.status == Status.CERTIFIED) & ~np.asarray(bad)
        now = replace(now, errors=np.where(sure, errors, np.inf))
        history.append(float(errors[sure].max(initial=0.0)))
        stalled = len(history) > _STALLED and history[-1] > 0.5 * history[-1 - _STALLED]
        if history[-1] <= tolerance or stalled or 2 * len(grid) > MOST_STEPS or now.interrupted:
            return replace(now, is_within=history[-1] <= tolerance)
        before = now
    return before


def take_one(run: Any, given: Given, course: Course, grid: FloatArray, times: FloatArray) -> Taken:
    """Take the steps of a grid; `times` are looked at."""
    w, width = run.workspace(), 2 * run.layout.unknowns + 3
    for place, values in given:
        run.put(w, place, values)
    rows, status, interrupted = np.full((1, len(times), width), np.nan), Status.CERTIFIED, False
    try:
        for first in range(0, len(grid) - 1, _CHUNK):
            part = grid[first : first + _CHUNK + 1]
            begin = 0 if first == 0 else int(np.searchsorted(times, part[0], "right"))
            end = len(times) if first + _CHUNK + 1 >= len(grid) else int(np.searchsorted(times, part[-1], "right"))
            motors, forces = motors_of_steps(course.path, part), forces_of_steps(course.load, course.tip, part)
            out = run.flat(rows[0, begin:end])
            paths = run.flat(motors), len(motors), run.flat(forces), len(forces)
            looked = run.flat(times[begin:end]), end - begin, out
            status = Status(run.motion_run(w, *paths, run.flat(part), len(part) - 1, *looked))
            rows[0, begin:end] = np.reshape(out, (end - begin, width))
            if status != Status.CERTIFIED:
                break
    except KeyboardInterrupt:
        interrupted = True
    return Taken(grid, rows, np.array([status]), interrupted)


def take_batch(run: Any, given: Given, cases: MotionCases, grid: FloatArray, times: FloatArray, threads: int) -> Taken:
    """Take the steps of a grid with many cases; a value in `given` has one row a case, or one for all."""
    out = np.full((cases.count, len(times), 2 * run.layout.unknowns + 3), np.nan)
    statuses = np.zeros(cases.count, dtype=np.uint8)
    inputs, places = [np.ascontiguousarray(values) for _, values in given], tuple(place for place, _ in given)
    most = 4096 if cases.stand_still else max(_SAMPLES // (2 * len(grid)), 1)
    size = 16 * math.ceil(min(most, cases.count / threads) / 16)

    def solve(first: int) -> None:
        rows = slice(first, min(first + size, cases.count))
        own = tuple(np.array(values[rows] if len(values) > 1 else values) for values in inputs)  # all of one type for numba
        found = out[rows]
        run.motion_batch(
            own, places, cases.motors(grid, rows), cases.forces(grid, rows), grid, times, found, statuses[rows], 0, len(found)
        )

    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(solve, range(0, cases.count, size)))
    return Taken(grid, out, statuses)


def replay(
    model: SoftModel, course: Course, damping: FloatArray, taken: Taken, rows: FloatArray, facts: dict[str, Any]
) -> Motion:
    """Return the motion with torques and energies, by Pinocchio, from the states at the ends of all steps.

    Args:
        model: The robot.
        course: What drove it.
        damping: Damping of the elastic coordinates, shape (n_springs, n_springs).
        taken: The steps, looked at at their ends; elastic coordinates and rates instead of unknowns and theirs.
        rows: Times of the rows, shape (n,) [s].
        facts: Other fields of the motion, gravity among them.
    """
    equations = EquationsOfMotion(model, facts["gravity"], damping)
    m, k = model.n_motors, model.n_springs
    motors, states = motors_of_steps(course.path, taken.grid), taken.rows[0, :, : 2 * k]
    motors = np.broadcast_to(motors, (2 * len(taken.grid) - 1, m))
    begin = State(0.0, np.concatenate([motors[0], states[0, :k]]), np.concatenate([np.zeros(m), states[0, k:]]))
    recorder = Recorder(MidpointRule(equations, course.path, course.load), begin, rows)
    for step, (time, end) in enumerate(zip(taken.grid[:-1].tolist(), taken.grid[1:].tolist(), strict=True)):
        h, middle_time = end - time, 0.5 * (time + end)
        u0, middle, u1 = motors[2 * step : 2 * step + 3]
        y0, v0, y1, v1 = states[step, :k], states[step, k:], states[step + 1, :k], states[step + 1, k:]
        accelerations = np.concatenate([4.0 * (u1 - 2.0 * middle + u0) / h**2, (v1 - v0) / h])
        rates = np.concatenate([(u1 - u0) / h, 0.5 * (v0 + v1)])
        x, wrenches = np.concatenate([middle, y0 + 0.5 * h * rates[m:]]), course.load(middle_time)
        half = 0.5 * h * accelerations[:m]
        begin = State(time, np.concatenate([u0, y0]), np.concatenate([rates[:m] - half, v0]))
        last = State(end, np.concatenate([u1, y1]), np.concatenate([rates[:m] + half, v1]))
        forces = equations.balance(x, rates, accelerations, wrenches)[:m]
        recorder.add(Step(begin, last, State(middle_time, x, rates), accelerations, forces, wrenches, 1))
    return recorder.motion(**{name: value for name, value in facts.items() if name != "gravity"})
