"""Runs of the generated code of motion: of one case, of many, and with shorter and shorter steps."""

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
from softrobots.core.progress import with_progress
from softrobots.dynamics.step_control import STALLED, error_share, halved

_PARTS_A_STEP = 4  # on average, of a run that is compared: one with shorter steps is cheaper than more
_CHUNK = 2_000  # steps between two looks for Ctrl-C
_CASE_STEPS = 10_000_000  # steps times cases between two looks for Ctrl-C, a second or so
_SAMPLES = 2_000_000  # of motor positions in memory

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
    sliders: FloatArray | None = None
    """Where those of dry friction are at the end, of guides and of each strain, (n, G + N) [m, rad]; None without."""
    failure: tuple[float, Exception] | None = None
    """Time [s] before which a function of the one case failed, and its error."""


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
        if not np.any(counts) and not np.all(bad) and len(history) <= STALLED and 2 * len(grid) <= MOST_STEPS:
            history, before = [*history, math.inf], now  # long steps may fail where shorter ones do not
            continue
        furthest = float(errors[counts].max(initial=0.0))
        errors *= error_share(last, furthest, order)
        now, last = replace(now, errors=np.where(counts, errors, np.inf)), furthest
        history.append(float(errors[counts].max(initial=0.0)))
        stalled = len(history) > STALLED and history[-1] > 0.5 * history[-1 - STALLED]
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
                motors, change, kicks = course.path(time), course.path.kicks[time], course.spring_kicks
                jump = kicks.at(motors, y, change)
                run.put(w, layout.velocity, v + jump)
                if layout.rubbing:
                    at = np.array(w[layout.rate_begin : layout.beyond])
                    run.put(w, layout.rate_begin, at + kicks.strain_rates(motors, y, change, jump))
    except KeyboardInterrupt:
        interrupted = True
    sliders = np.array([w[layout.anchors : layout.strain_begin]]) if layout.rubbing else None
    whole = np.array([status if failure is None else Status.NOT_A_NUMBER])
    return StepsTaken(grid, rows, whole, interrupted, sliders=sliders, failure=failure)


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
    """Take the steps of a grid with many cases.

    `given` has positions, velocities, of dry friction sliders, strains and rates, and what is the same for all cases.
    """
    layout, bound = run.layout, _bound(run, grid, compared)
    n, strains = layout.unknowns, layout.strain_begin - layout.anchors
    given = [*given, *((place, one[None]) for place, one in bound)]
    out, sliders = np.full((cases.count, len(times), 2 * n + 3), np.nan), np.zeros((cases.count, strains))
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
            cases.kick(spring_kicks, float(grid[end]), rows, *own[: 3 if strains else 2])
        if strains:
            sliders[rows] = own[2][:, :strains]
        statuses[rows] = worst

    with ThreadPoolExecutor(threads) as pool:
        try:
            blocks = range(0, cases.count, size)
            done = pool.map(solve, blocks)
            list(with_progress(done, progress, label=f"motions, {len(grid) - 1} steps", unit="block", total=len(blocks)))
        except KeyboardInterrupt:
            stopped.set()
    return StepsTaken(grid, out, statuses, stopped.is_set(), sliders=sliders if strains else None)


def _stops(grid: FloatArray, kicks: FloatArray) -> set[int]:
    """Places of the grid between which no velocity of a motor jumps."""
    inside = [time for time in kicks.tolist() if 0.0 < time < grid[-1]]
    return {0, *np.searchsorted(grid, inside).tolist(), len(grid) - 1} if inside else {0, len(grid) - 1}


def _times_within(times: FloatArray, grid: FloatArray, first: int, end: int) -> slice:
    """Which of the times are within steps `first` to `end`, without the beginning but of the first."""
    begin = 0 if first == 0 else int(np.searchsorted(times, grid[first], "right"))
    return slice(begin, len(times) if end == len(grid) - 1 else int(np.searchsorted(times, grid[end], "right")))
