"""Jobs of motion: rods of many pairs of hinges and the inflatable arm, against real time and against MuJoCo at equal error."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.dynamics.simulation import simulate
from softrobots.model.loader import load_model
from softrobots.robots.pcc_arm import PccArm
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.loads import EARTH_GRAVITY
from studies.benchmark.cases import arm, random_forces
from studies.benchmark.comparison import Comparison, Outcome, Settings
from studies.benchmark.compiled_solvers import compiled
from studies.benchmark.measurement import Workload, spread
from studies.benchmark.mujoco_motion import MujocoMotion, Released, tip_error
from studies.benchmark.results import AT_LEAST, Row

COMPILED, PYTHON, MUJOCO, REAL_TIME = "compiled, numba", "simulate", "MuJoCo, best integrator and step", "real time"
TIP_ERROR = 5e-4
"""Mean error of the tip at which rods are compared [m]."""
ARM_STEP = 1e-3
"""Step of the inflatable arm by the midpoint rule [s]."""
FOURTH_ORDER_STEPS = (15e-3, 10e-3, 5e-3, 2.5e-3)
"""Steps of fourth order of the inflatable arm [s]; the longest are half as far off as `ARM_STEP` by the midpoint rule."""

_STEPS = (10e-3, 5e-3, 4e-3, 2.5e-3, 2e-3, 1.25e-3, 1e-3, 0.5e-3, 0.25e-3)  # tried for rods, the longest first [s]
_LENGTH, _RADIUS, _YOUNG, _DENSITY, _PUSH = 0.4, 5e-3, 70e6, 1200.0, 0.1  # of a rod of TPU, SI units
_DAMPING = 1e-3  # [s]: 0.7 % of critical damping in the first mode
_ROW = 0.02  # of rods [s]
_ARM_ROW = 0.1  # [s]: steps of MuJoCo divide it, so that there are steps of nearly every length
_SHORT = 25  # rows of the comparison with MuJoCo, which is slow


def motion(settings: Settings) -> Outcome:
    """Motion of rods and of the arm."""
    outcomes = [
        _rod(settings, pairs, target)
        for pairs, target in zip((3, 2) if settings.quick else (30, 50), (100.0, 50.0), strict=True)
    ]
    outcomes.append(_arm(settings))
    return Outcome([row for one in outcomes for row in one.rows], notes=[note for one in outcomes for note in one.notes])


def _rod(settings: Settings, pairs: int, target: float) -> Outcome:
    """A rod of TPU that is let go: the longest step whose tip is near enough to that of the tests' own rod."""
    area = np.pi * _RADIUS**2
    bending = _YOUNG * area * _RADIUS**2 / 4.0
    model = load_model(
        PccArm(
            segment_lengths=(_LENGTH,), muscle_azimuths=(), chain="lumped", hinges=pairs, extension=False, radius=_RADIUS,
            bending_stiffness=bending, torsional_stiffness=bending / 1.5, linear_density=_DENSITY * area,
        )
    )  # fmt: skip
    start = solve_equilibrium(model, (), force=(_PUSH, 0.0, 0.0), gravity=EARTH_GRAVITY)
    released = Released(start, EARTH_GRAVITY, _DAMPING, _ROW, 5 if settings.quick else 500)
    job, comparison = f"motion of a rod, {pairs} pairs with twist", Comparison(settings, f"motion of {pairs} pairs")
    solver, expected = compiled(model, "numba"), reference(released.duration, released.rows)
    step, error = _longest_step(solver, released, expected, np.inf if settings.quick else TIP_ERROR)
    notes = [
        f"{job}: steps of {1e3 * step:g} ms, the tip is {1e3 * error:.2g} mm from that of a rod in {released.duration:g} s"
    ]
    comparison.add(COMPILED, lambda: Workload(1, _run(partial(solver.simulate, released.duration, ()), released, step)))
    comparison.run()
    rows = [_real_time(comparison, job, released.duration, target)]
    short, comparison = released._replace(rows=5 if settings.quick else _SHORT), Comparison(settings, f"{pairs} pairs, MuJoCo")
    ours = partial(solver.simulate, short.duration, ())
    finest = _run(ours, short, step / 16.0)().tip_position
    run = _run(ours, short, step)
    reached = np.inf if settings.quick else tip_error(run().tip_position, finest)
    _compare(comparison, notes, job, lambda: Workload(1, run), short, finest, reached)
    comparison.run()
    rows.append(comparison.cheaper(f"{job}, {short.duration:g} s at equal error", COMPILED, MUJOCO, AT_LEAST, 10.0))
    return Outcome(rows, notes=notes)


def _longest_step(solver: Any, released: Released, expected: FloatArray, bound: float) -> tuple[float, float]:
    """The longest of `_STEPS` that keeps the mean error of the tip, or else the best one; and the error [s, m]."""
    tried = []
    for step in _STEPS:
        run = _run(partial(solver.simulate, released.duration, ()), released, step)
        error = tip_error(run().tip_position, expected)
        if error <= bound:
            return step, error
        tried.append((error, step))
    error, step = min(tried)
    return step, error


def reference(duration: float, rows: int) -> FloatArray:
    """Path of the tip of the rod by `tests.support.planar_rod`, shape (rows + 1, 3) [m]."""
    from tests.support.planar_rod import PlanarRod

    rod = PlanarRod(_LENGTH, _RADIUS, _YOUNG, _DENSITY, 8, retardation=_DAMPING, gravity=(0.0, EARTH_GRAVITY[2]))
    step = 2e-5  # [s]: the damping of the highest polynomial is stiff
    tips = rod.tips(rod.equilibrium((_PUSH, 0.0)), duration, rows, round(duration / rows / step))
    return np.stack([tips[:, 0], 0.0 * tips[:, 0], tips[:, 1]], axis=1)


def _arm(settings: Settings) -> Outcome:
    """The inflatable arm of three motors and four springs, let go for ten seconds; MuJoCo is tuned for the error of ours."""
    model, motors = arm(), (0.3, 0.6, -0.8)
    start = solve_equilibrium(model, motors, force=(0.0, 10.0, -15.0), gravity=EARTH_GRAVITY)
    released = Released(start, EARTH_GRAVITY, 1e-3, _ARM_ROW, 5 if settings.quick else 100)
    solver, general = compiled(model, "numba"), partial(simulate, model, released.duration, motors)
    finest = _run(general, released, ARM_STEP, order=4)().tip_position
    rows, notes = [], []
    for step, order in ((ARM_STEP, 2), *((step, 4) for step in FOURTH_ORDER_STEPS)):
        job = f"motion of the arm, steps of {1e3 * step:g} ms{' of fourth order' if order == 4 else ''}"
        comparison = Comparison(settings, job)
        ours = _run(partial(solver.simulate, released.duration, motors), released, step, order)
        error = tip_error(ours().tip_position, finest)
        notes.append(f"{job}: mean error of the tip {1e3 * error:.2g} mm")
        bound = np.inf if settings.quick else error
        _compare(comparison, notes, job, partial(Workload, 1, ours), released, finest, bound)
        if order == 2:
            comparison.add(PYTHON, lambda: Workload(1, _run(general, released, ARM_STEP)))
            count = 8 if settings.quick else 256
            batch = partial(
                solver.simulations, released.duration, np.tile(motors, (count, 1)), forces=random_forces(count, 10.0),
                gravity=EARTH_GRAVITY, damping_time=released.damping_time, time_step=ARM_STEP, output_step=released.duration,
            )  # fmt: skip
            comparison.add(f"{COMPILED}, batch", partial(Workload, count, batch))
        comparison.run()
        if order == 2:
            rows += [
                _real_time(comparison, job, released.duration, 1000.0),
                _real_time(comparison, job, released.duration, 5000.0, f"{COMPILED}, batch"),
                comparison.cheaper(job, COMPILED, PYTHON),
            ]
        target = (AT_LEAST, 10.0) if order == 4 else ()  # the longest steps of fourth order are cheaper and nearer
        rows.append(comparison.cheaper(f"{job}, equal error", COMPILED, MUJOCO, *target))
    return Outcome(rows, notes=notes)


def _run(solve: Callable[..., Any], released: Released, step: float, order: int = 2) -> Callable[[], Any]:
    """A simulation with steps of one length and order."""
    return partial(
        solve, start=released.start, gravity=released.gravity, damping_time=released.damping_time, time_step=step,
        output_step=released.row_step, order=order,
    )  # fmt: skip


def _compare(
    comparison: Comparison, notes: list[str], job: str, ours: Callable[[], Workload], released: Released, expected: FloatArray,
    error: float,
) -> None:  # fmt: skip
    """Add ours, and MuJoCo tuned for the error."""
    comparison.add(COMPILED, ours)

    def tuned() -> Workload:
        simulator = MujocoMotion(released)
        notes.append(f"{job}, MuJoCo: {simulator.tune(expected, error)}")
        return Workload(1, simulator.path)

    comparison.add(MUJOCO, tuned)


def _real_time(comparison: Comparison, job: str, duration: float, target: float, name: str = COMPILED) -> Row:
    """How many times faster than real time a motion is simulated; the cost is that of one second."""
    seconds = comparison.seconds[name] / duration
    return Row(job, name, REAL_TIME, "times cheaper", *spread(1.0 / seconds), AT_LEAST, target, float(np.median(seconds)), 1.0)
