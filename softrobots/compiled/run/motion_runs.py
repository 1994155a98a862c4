"""Runs of the generated code of motion: of one case, of many, with shorter and shorter steps, and once more in Python."""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softrobots.compiled.run.motion_cases import MotionCases
from softrobots.compiled.run.motion_course import Course, SpringKicks, forces_of_steps, motors_of_steps
from softrobots.compiled.statuses import Status
from softrobots.core.checks import FloatArray
from softrobots.core.errors import NotConverged
from softrobots.core.progress import with_progress
from softrobots.dynamics.equations import EquationsOfMotion
from softrobots.dynamics.gauss import GaussRule
from softrobots.dynamics.midpoint import State, Step
from softrobots.dynamics.motion import Motion
from softrobots.dynamics.recorder import Recorder
from softrobots.dynamics.step_control import NoStep, error_share, follow, halved, rule_of_order
from softrobots.dynamics.time_grid import SAME_TIME, grid_of_rows, merged_times

_FIRST_STEPS = 400  # of the first of the runs that are compared
_PARTS_A_STEP = 4  # on average, of a run that is compared: one with shorter steps is cheaper than more
_STALLED = 4  # runs in which the error of the tip is to halve at least once
_CHUNK = 2_000  # steps between two looks for Ctrl-C
_CASE_STEPS = 10_000_000  # steps times cases between two looks for Ctrl-C, a second or so
_SAMPLES = 2_000_000  # of motor positions in memory
_WHOLE = 1e-9  # rad or m by which one midpoint step may seem to miss its end; one that was halved does so by h^2

MOST_STEPS = 1_000_000
"""Most steps of one run that is refined for a tolerance."""

Given = Sequence[tuple[int, FloatArray]]
"""Places in the workspace, and what stands there."""


@dataclass(frozen=True)
class StepsTaken:
    """Steps that were taken by one case or many."""

    grid: FloatArray
    """Ends of the steps, the first included, shape (m,) [s]."""
    rows: FloatArray
    """Unknowns, rates and tip at the times of the rows, NaN where they were not reached, shape (n, t, 2 N + 3)."""
    status: Any
    """Status of each case, shape (n,)."""
    interrupted: bool = False
    """Whether Ctrl-C ended it."""
    errors: FloatArray | None = None
    """Measured error of the tip, the largest of all rows, shape (n,) [m]."""
    is_within: bool = True
    """Whether that is within the tolerance; so are fixed steps."""
    failure: tuple[float, Exception] | None = None
    """Time [s] before which a function of the one case failed, and its error."""


def first_grid(rows: FloatArray, breaks: Sequence[FloatArray], order: int) -> FloatArray:
    """Return the steps of the first of the runs that are compared, which end at `breaks`, or at the rows, shape (n,) [s]."""
    if order == GaussRule.order:
        return grid_of_rows(rows)
    end = float(rows[-1])
    stops = merged_times(SAME_TIME * end, end, *breaks)
    ends = zip(stops[:-1], stops[1:], np.ceil(np.diff(stops) / end * _FIRST_STEPS).astype(int) + 1, strict=True)
    return np.append(np.concatenate([np.linspace(one, other, count)[:-1] for one, other, count in ends]), end)


def halve_to_tolerance(
    take: Callable[[FloatArray], StepsTaken], grid: FloatArray, tolerance: float, order: int, bad: Any = False
) -> StepsTaken:
    """Halve all steps until the tips of the valid cases are known to a tolerance; return the last run.

    The error of the finer of two runs is stated from the difference of their tips by `softrobots.dynamics.step_control`, as in
    `simulate`. `bad` marks cases that do not count.
    """
    before, history, last = take(grid), [math.inf], math.inf
    while not before.interrupted:
        grid = halved(grid)
        now = take(grid)
        if now.interrupted:
            return replace(before, interrupted=True)
        errors = np.linalg.norm(now.rows[..., -3:] - before.rows[..., -3:], axis=2).max(axis=1, initial=0.0)
        errors = np.where(before.status == Status.CERTIFIED, errors, np.inf)
        counts = (now.status == Status.CERTIFIED) & ~np.asarray(bad)
        if not np.any(counts) and not np.all(bad) and len(history) <= _STALLED and 2 * len(grid) <= MOST_STEPS:
            history, before = [*history, math.inf], now  # long steps may fail where shorter ones do not
            continue
        furthest = float(errors[counts].max(initial=0.0))
        errors *= error_share(last, furthest, order)
        now, last = replace(now, errors=np.where(counts, errors, np.inf)), furthest
        history.append(float(errors[counts].max(initial=0.0)))
        stalled = len(history) > _STALLED and history[-1] > 0.5 * history[-1 - _STALLED]
        if history[-1] <= tolerance or stalled or 2 * len(grid) > MOST_STEPS:
            return replace(now, is_within=history[-1] <= tolerance)
        before = now
    return before


def take_one(
    run: Any,
    state: tuple[FloatArray, FloatArray],
    given: Given,
    course: Course,
    grid: FloatArray,
    times: FloatArray,
    progress: bool | str = False,
    compared: bool = False,
) -> StepsTaken:
    """Take the steps of a grid from a state, unknowns and rates; `times` are those of the rows.

    A function that fails ends them before that time; its error is raised if there is no step before it. A run that is
    `compared` fails where it needs far more parts of steps than it has steps.
    """
    w, layout = run.workspace(), run.layout
    n, last = layout.unknowns, len(grid) - 1
    for place, values in [(layout.position, state[0]), (layout.velocity, state[1]), *given, *_bound(run, grid, compared)]:
        run.put(w, place, values)
    rows, status, interrupted = np.full((1, len(times), 2 * n + 3), np.nan), Status.CERTIFIED, False
    rows[0, 0] = np.concatenate([*state, np.zeros(3)])  # even if no step is taken
    failure = None
    parts = list(itertools.pairwise(sorted({*_stops(grid, course.path.kick_times), *range(0, last, _CHUNK)})))[::-1]
    try:
        for first, end in with_progress(
            _taken_off(parts), progress, label=f"motion, {last} steps", unit="part", total=len(parts)
        ):
            part, within = grid[first : end + 1], _times_within(times, grid, first, end)
            try:
                motors, forces = motors_of_steps(course.path, part), forces_of_steps(course.load, part)
            except Exception as error:  # of the caller: anything
                if end - first > 1:
                    middle = (first + end) // 2
                    parts += [(middle, end), (first, middle)]
                    continue
                if first == 0:
                    raise
                failure = float(grid[first]), error
                break
            out = run.flat(rows[0, within])
            paths = run.flat(motors), len(motors), run.flat(forces), len(forces)
            seen = run.flat(times[within]), within.stop - within.start, out
            status = Status(run.motion_run(w, *paths, run.flat(part), len(part) - 1, *seen))
            rows[0, within] = np.reshape(out, (-1, 2 * n + 3))
            if status != Status.CERTIFIED:
                break
            if end < last and grid[end] in course.path.kicks:
                y, v = (np.array(w[place : place + n]) for place in (layout.position, layout.velocity))
                time = float(grid[end])
                run.put(w, layout.velocity, v + course.spring_kicks.at(course.path(time), y, course.path.kicks[time]))
    except KeyboardInterrupt:
        interrupted = True
    return StepsTaken(grid, rows, np.array([status if failure is None else Status.NOT_A_NUMBER]), interrupted, failure=failure)


def _bound(run: Any, grid: FloatArray, compared: bool) -> Given:
    """Return the most parts that the steps of a run that is compared may be halved to; none for given steps."""
    return [(run.layout.most_parts, np.array([float(_PARTS_A_STEP * len(grid))]))] if compared else []


def _taken_off(parts: list[tuple[int, int]]) -> Iterator[tuple[int, int]]:
    """Take the last part off a list, to which more may be added, until it is empty."""
    while parts:
        yield parts.pop()


def take_batch(
    run: Any,
    given: Given,
    cases: MotionCases,
    spring_kicks: SpringKicks,
    grid: FloatArray,
    times: FloatArray,
    threads: int,
    progress: bool | str = False,
    compared: bool = False,
) -> StepsTaken:
    """Take the steps of a grid with many cases; `given` has positions, velocities and what is the same for all cases."""
    n, given = run.layout.unknowns, [*given, *((place, bound[None]) for place, bound in _bound(run, grid, compared))]
    out = np.full((cases.count, len(times), 2 * n + 3), np.nan)
    statuses = np.full(cases.count, Status.UNSETTLED, dtype=np.uint8)  # until a case is at its end
    places = tuple(place for place, _ in given)
    most = min(4096, (_CASE_STEPS if cases.stand_still else _SAMPLES // 2) // len(grid))
    size = 16 * max(math.ceil(min(most, cases.count / threads) / 16), 1)
    stops, stopped = sorted({*_stops(grid, cases.kicks), *range(0, len(grid) - 1, _CHUNK)}), threading.Event()

    def solve(case: int) -> None:
        rows = slice(case, min(case + size, cases.count))
        own = [
            np.array(values[rows] if len(values) > 1 else values, order="C") for _, values in given
        ]  # all of one type for numba
        count = rows.stop - case
        worst = np.zeros(count, dtype=np.uint8)
        for first, end in itertools.pairwise(stops):
            if stopped.is_set():
                return
            part, within = grid[first : end + 1], _times_within(times, grid, first, end)
            seen = np.append(times[within], grid[end])
            found, status = np.full((count, len(seen), 2 * n + 3), np.nan), np.zeros(count, dtype=np.uint8)
            driven = cases.motors(part, rows), cases.forces(part, rows), part, seen
            run.motion_batch(tuple(own), places, *driven, found, status, 0, count)
            out[rows, within] = found[:, :-1]
            worst = np.maximum(worst, status)
            own[:2] = [found[:, -1, :n].copy(), found[:, -1, n : 2 * n].copy()]
            cases.kick(spring_kicks, float(grid[end]), rows, own[0], own[1])
        statuses[rows] = worst

    with ThreadPoolExecutor(threads) as pool:
        try:
            blocks = range(0, cases.count, size)
            done = pool.map(solve, blocks)
            list(with_progress(done, progress, label=f"motions, {len(grid) - 1} steps", unit="block", total=len(blocks)))
        except KeyboardInterrupt:
            stopped.set()
    return StepsTaken(grid, out, statuses, stopped.is_set())


def _stops(grid: FloatArray, kicks: FloatArray) -> set[int]:
    """Places of the grid between which no velocity of a motor jumps."""
    inside = [time for time in kicks.tolist() if 0.0 < time < grid[-1]]
    return {0, *np.searchsorted(grid, inside).tolist(), len(grid) - 1} if inside else {0, len(grid) - 1}


def _times_within(times: FloatArray, grid: FloatArray, first: int, end: int) -> slice:
    """Which of the times are within steps `first` to `end`, without the beginning but of the first."""
    begin = 0 if first == 0 else int(np.searchsorted(times, grid[first], "right"))
    return slice(begin, len(times) if end == len(grid) - 1 else int(np.searchsorted(times, grid[end], "right")))


def replay(
    equations: EquationsOfMotion, course: Course, taken: StepsTaken, rows: FloatArray, facts: dict[str, Any], order: int
) -> Motion:
    """Return the motion with torques and energies, by Pinocchio, from the states at the ends of all steps.

    Steps of fourth order are taken again, each from where the compiled ones came to; so are those that had to be halved.

    Args:
        equations: Equations of motion.
        course: What drove it.
        taken: The steps, with a row at each end of a step; elastic coordinates and rates instead of unknowns and theirs.
        rows: Times of the rows, shape (n,) [s].
        facts: Other fields of the motion.
        order: Order of the steps.

    Raises:
        NotConverged: If such a step is not found again.
    """
    m, k, count = equations.n_motors, equations.n - equations.n_motors, 2 * len(taken.grid) - 1
    motors, states = np.broadcast_to(motors_of_steps(course.path, taken.grid), (count, m)), taken.rows[0]

    def still(time: float, row: int) -> State:
        """The state of a row whose motors stand still."""
        x, rates = np.split(states[row, : 2 * k], 2)
        return State(time, np.concatenate([motors[0], x]), np.concatenate([np.zeros(m), rates]))

    recorder = Recorder(rule_of_order(order)(equations, course.path, course.load), still(0.0, 0), rows)
    for step, end in enumerate(taken.grid[1:].tolist()):
        before = recorder.state
        h, middle_time = end - before.time, 0.5 * (before.time + end)
        u0, middle, u1 = motors[2 * step : 2 * step + 3]
        y1, v1, v0 = states[step + 1, :k], states[step + 1, k : 2 * k], before.rates[m:]
        accelerations = np.concatenate([4.0 * (u1 - 2.0 * middle + u0) / h**2, (v1 - v0) / h])
        rates = np.concatenate([(u1 - u0) / h, 0.5 * (v0 + v1)])
        x, half = np.concatenate([middle, before.x[m:] + 0.5 * h * rates[m:]]), 0.5 * h * accelerations[:m]
        last, again = State(end, np.concatenate([u1, y1]), np.concatenate([rates[:m] + half, v1])), None
        if order == GaussRule.order:
            again = recorder.rule.step(before, end)
            again = again and again._replace(end=last)
        elif np.allclose(before.x[m:] + h * rates[m:], y1, rtol=_WHOLE, atol=_WHOLE):
            begin = State(before.time, before.x, np.concatenate([rates[:m] - half, v0]))
            wrenches = course.load(middle_time)
            forces = equations.balance(x, rates, accelerations, wrenches)[:m]
            again = Step(begin, last, State(middle_time, x, rates), accelerations, forces, wrenches)
        kicked = end in course.path.kicks and end < recorder.duration
        if again is None:
            _take_parts(recorder, end)
            recorder.state = recorder.state if kicked else last
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
