"""Jobs of the inflatable arm: equilibria, weightless and under gravity, in batches and one by one."""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from softrobots.statics.loads import EARTH_GRAVITY
from studies.benchmark.arm_baselines import (
    FIXED_POINT,
    GENERAL,
    MUJOCO,
    MUJOCO_ANY,
    PLAIN_FIXED_POINT,
    ROOT,
    add_compiled,
    add_python,
    batch_name,
    compiled_batch,
    compiled_calls,
    expected_springs,
    newton_name,
    pinocchio_calls,
    settling,
    single_name,
    together,
)
from studies.benchmark.cases import arm, standard_cases
from studies.benchmark.comparison import Comparison, Outcome, Settings, curve
from studies.benchmark.compiled_solvers import BACKENDS
from studies.benchmark.numpy_arrays import ArrayArm
from studies.benchmark.pinocchio_solvers import NEWTON, PinocchioArm, fixed_point, newton_by_torque_derivatives
from studies.benchmark.results import AT_LEAST, AT_MOST

ARRAYS = "NumPy, written plainly"


def equilibria(settings: Settings) -> Outcome:
    """Equilibria of the arm, weightless: batches and single calls against everything else."""
    comparison = Comparison(settings, "equilibria")
    cases = standard_cases(settings.batch)
    few = cases.first(settings.singles)
    expected = expected_springs(few, None)
    add_compiled(comparison, cases, few, expected, None)
    add_python(comparison, few, expected)
    comparison.add(ARRAYS, lambda: together(ARRAYS, ArrayArm(arm()).equilibria, cases, expected))
    notes: list[str] = []
    for name in (MUJOCO, MUJOCO_ANY):
        comparison.add(name, partial(settling, name, settings.quick, few, expected, notes))
    comparison.run()
    job = "equilibrium, batch"
    fast, plain = batch_name("numba"), batch_name("python")
    rows = [
        comparison.cheaper(job, fast, PLAIN_FIXED_POINT, AT_LEAST, 500.0),
        comparison.cheaper(job, fast, ARRAYS, AT_LEAST, 50.0),
        comparison.cheaper(job, fast, MUJOCO, AT_LEAST, 3000.0),
        comparison.cheaper(job, fast, MUJOCO_ANY),
        comparison.cheaper(job, fast, FIXED_POINT),
        *(comparison.cheaper(job, fast, newton_name(name)) for name in NEWTON),
        comparison.cheaper(job, fast, ROOT),
        comparison.cheaper(job, plain, FIXED_POINT),
        comparison.cheaper(job, plain, ARRAYS),
        comparison.cheaper("equilibrium, one checked call", single_name("numba"), PLAIN_FIXED_POINT, AT_LEAST, 30.0),
        comparison.cheaper("equilibrium, one checked call", single_name("numba"), FIXED_POINT),
        comparison.cheaper("equilibrium, one checked call", single_name("python"), FIXED_POINT),
        comparison.costlier("equilibrium, one checked call", GENERAL, _barest(comparison), AT_MOST, 2.0),
    ]
    return Outcome(rows, notes=notes)


def two_threads(settings: Settings) -> Outcome:
    """The batch again by the wall clock, on one thread and on two."""
    comparison = Comparison(settings, "two threads", time.perf_counter)
    cases = standard_cases(settings.batch)
    few = cases.first(settings.singles)
    expected = expected_springs(few, None)
    for threads in (1, 2):
        name = f"compiled, numba, {threads} thread{'s' * (threads > 1)}"
        comparison.add(name, partial(compiled_batch, name, "numba", cases, expected, None, threads))
    robot = PinocchioArm(arm())
    comparison.add(FIXED_POINT, partial(pinocchio_calls, FIXED_POINT, robot, fixed_point, few, expected))
    comparison.run()
    job = "equilibrium, batch, wall clock"
    return Outcome(
        [comparison.cheaper(job, f"compiled, numba, {threads}", FIXED_POINT) for threads in ("1 thread", "2 threads")]
    )


def under_gravity(settings: Settings) -> Outcome:
    """Equilibria of the arm with its weight."""
    comparison = Comparison(settings, "gravity")
    cases = standard_cases(settings.batch)
    few = cases.first(settings.singles)
    expected = expected_springs(few, EARTH_GRAVITY)
    add_compiled(comparison, cases, few, expected, EARTH_GRAVITY)
    robot, newton = PinocchioArm(arm(), EARTH_GRAVITY), newton_name("torque derivatives")
    comparison.add(FIXED_POINT, partial(pinocchio_calls, FIXED_POINT, robot, fixed_point, few, expected))
    comparison.add(newton, partial(pinocchio_calls, newton, robot, newton_by_torque_derivatives, few, expected))
    weightless = f"{single_name('numba')}, weightless"
    comparison.add(weightless, partial(compiled_calls, "numba", few, expected_springs(few, None), None))
    comparison.run()
    job, fast, single = "equilibrium under gravity", batch_name("numba"), single_name("numba")
    rows = [comparison.cheaper(job, ours, baseline) for ours in (fast, single) for baseline in (FIXED_POINT, newton)]
    return Outcome([*rows, comparison.costlier(job, single, weightless)])


def batches(settings: Settings) -> Outcome:
    """Cost of an equilibrium over the size of the batch, each back end."""
    comparison, sizes = Comparison(settings, "batch sizes"), settings.batches
    for size in sizes:
        cases = standard_cases(size)
        expected = expected_springs(cases, None)
        for backend in BACKENDS:
            name = f"{batch_name(backend)} {size}"
            comparison.add(name, partial(compiled_batch, name, backend, cases, expected, None))
        comparison.add(f"{ARRAYS} {size}", partial(together, ARRAYS, ArrayArm(arm()).equilibria, cases, expected))
    few, robot = standard_cases(settings.singles), PinocchioArm(arm())
    known = expected_springs(few, None)
    comparison.add(FIXED_POINT, partial(pinocchio_calls, FIXED_POINT, robot, fixed_point, few, known))
    comparison.run()
    labels = [*(batch_name(backend) for backend in BACKENDS), ARRAYS]
    curves = [curve("batches", label, {size: comparison.cost(f"{label} {size}") for size in sizes}) for label in labels]
    curves.append(curve("batches", FIXED_POINT, dict.fromkeys(sizes, comparison.cost(FIXED_POINT))))
    notes = sorted({f"{name}: {reason}" for name, reason in comparison.absent.items()})
    return Outcome(curves=[line for line in curves if line is not None], notes=notes)


def _barest(comparison: Comparison) -> str:
    """Return the name of the cheapest Newton's method."""
    return min(map(newton_name, NEWTON), key=lambda name: comparison.cost(name) or np.inf)
