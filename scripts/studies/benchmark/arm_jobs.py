"""Jobs of the inflatable arm: equilibria, weightless and under gravity, in batches and one by one."""

from __future__ import annotations

import time
from functools import partial

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.loads import EARTH_GRAVITY
from studies.benchmark.arm_contenders import (
    CPP,
    FIXED_POINT,
    GENERAL,
    MUJOCO,
    MUJOCO_ANY,
    MUJOCO_BARE,
    PLAIN_FIXED_POINT,
    add_compiled,
    add_pinocchio,
    add_python,
    batch_name,
    compiled_batch,
    cpp_kinematics,
    expected_springs,
    newton_name,
    pinocchio_calls,
    scipy_name,
    settling,
    single_name,
    together,
)
from studies.benchmark.cases import LoadCases, arm, standard_cases
from studies.benchmark.compiled_solvers import BACKENDS
from studies.benchmark.numpy_arrays import ArrayArm
from studies.benchmark.pinocchio_solvers import NEWTON, PinocchioArm, fixed_point, newton_by_torque_derivatives
from studies.benchmark.race import Race, Settings, curve
from studies.benchmark.results import AT_LEAST, AT_MOST, Curve, Row

ARRAYS = "NumPy, written plainly"


def _weightless(settings: Settings) -> tuple[Race, LoadCases, LoadCases, FloatArray]:
    """The race with our compiled solvers; all cases, the few for single calls, and the springs of those, shape (n, 4) [rad]."""
    race = Race(settings, "equilibria")
    cases = standard_cases(settings.batch)
    few = cases.first(settings.singles)
    expected = expected_springs(few, None)
    add_compiled(race, cases, few, expected, None)
    return race, cases, few, expected


def equilibria(settings: Settings) -> tuple[list[Row], list[str]]:
    """Equilibria of the arm, weightless: batches and single calls against everything else."""
    race, cases, few, expected = _weightless(settings)
    add_python(race, few, expected)
    race.add(ARRAYS, lambda: together(ARRAYS, ArrayArm(arm()).equilibria, cases, expected))
    notes: list[str] = []
    for name, contacts in ((MUJOCO, True), (MUJOCO_ANY, True), (MUJOCO_BARE, False)):
        race.add(name, partial(settling, name, contacts, settings.quick, few, expected, notes))
    if settings.cpp:
        race.add(CPP, lambda: cpp_kinematics(cases))
    else:
        race.leave_out(CPP, "compiled with --cpp only")
    race.run()
    job = "equilibrium, batch"
    fast, plain = batch_name("numba"), batch_name("python")
    rows = [
        race.cheaper(job, fast, PLAIN_FIXED_POINT, AT_LEAST, 500.0),
        race.cheaper(job, fast, ARRAYS, AT_LEAST, 50.0),
        race.cheaper(job, fast, MUJOCO, AT_LEAST, 3000.0),
        race.cheaper(job, fast, CPP, AT_LEAST, 2.0),
        race.cheaper(job, fast, MUJOCO_ANY),
        race.cheaper(job, fast, MUJOCO_BARE),
        race.cheaper(job, fast, FIXED_POINT),
        *(race.cheaper(job, fast, newton_name(name)) for name in NEWTON),
        *(race.cheaper(job, fast, scipy_name(name)) for name in ("root", "least_squares")),
        race.cheaper(job, plain, FIXED_POINT),
        race.cheaper(job, plain, ARRAYS),
        race.cheaper("equilibrium, one checked call", single_name("numba"), PLAIN_FIXED_POINT, AT_LEAST, 30.0),
        race.cheaper("equilibrium, one checked call", single_name("numba"), FIXED_POINT),
        race.cheaper("equilibrium, one checked call", single_name("python"), FIXED_POINT),
        race.costlier("equilibrium, one checked call", GENERAL, _barest(race), AT_MOST, 2.0),
    ]
    return rows, notes


def without_extras(settings: Settings) -> tuple[list[Row], list[str]]:
    """Equilibria of the arm, weightless, against what needs no package beyond the required ones: the short job."""
    race, cases, few, expected = _weightless(settings)
    add_pinocchio(race, few, expected)
    race.add(ARRAYS, lambda: together(ARRAYS, ArrayArm(arm()).equilibria, cases, expected))
    race.run()
    batch, single = "equilibrium, batch", "equilibrium, one checked call"
    rows = [race.cheaper(batch, batch_name(backend), name) for backend in BACKENDS for name in (PLAIN_FIXED_POINT, ARRAYS)]
    rows += [race.cheaper(single, single_name(backend), PLAIN_FIXED_POINT) for backend in BACKENDS]
    return [*rows, race.costlier(single, GENERAL, _barest(race))], []


def two_threads(settings: Settings) -> tuple[list[Row], list[str]]:
    """The batch again by the wall clock, on one thread and on two."""
    race = Race(settings, "two threads", time.perf_counter)
    cases = standard_cases(settings.batch)
    few = cases.first(settings.singles)
    expected = expected_springs(few, None)
    for threads in (1, 2):
        name = f"compiled, numba, {threads} thread{'s' * (threads > 1)}"
        race.add(name, partial(compiled_batch, name, "numba", cases, expected, None, threads))
    robot = PinocchioArm(arm())
    race.add(FIXED_POINT, partial(pinocchio_calls, FIXED_POINT, robot, fixed_point, few, expected))
    race.run()
    job = "equilibrium, batch, wall clock"
    return [race.cheaper(job, name, FIXED_POINT) for name in ("compiled, numba, 1 thread", "compiled, numba, 2 threads")], []


def under_gravity(settings: Settings) -> tuple[list[Row], list[str]]:
    """Equilibria of the arm with its weight."""
    race = Race(settings, "gravity")
    cases = standard_cases(settings.batch)
    few = cases.first(settings.singles)
    expected = expected_springs(few, EARTH_GRAVITY)
    add_compiled(race, cases, few, expected, EARTH_GRAVITY)
    robot, newton = PinocchioArm(arm(), EARTH_GRAVITY), newton_name("torque derivatives")
    race.add(FIXED_POINT, partial(pinocchio_calls, FIXED_POINT, robot, fixed_point, few, expected))
    race.add(newton, partial(pinocchio_calls, newton, robot, newton_by_torque_derivatives, few, expected))
    race.run()
    job, fast, single = "equilibrium under gravity", batch_name("numba"), single_name("numba")
    return [race.cheaper(job, ours, baseline) for ours in (fast, single) for baseline in (FIXED_POINT, newton)], []


def batches(settings: Settings) -> tuple[list[Curve], list[str]]:
    """Cost of an equilibrium over the size of the batch, each back end."""
    race, sizes = Race(settings, "batch sizes"), settings.batches
    for size in sizes:
        cases = standard_cases(size)
        expected = expected_springs(cases, None)
        for backend in BACKENDS:
            name = f"{batch_name(backend)} {size}"
            race.add(name, partial(compiled_batch, name, backend, cases, expected, None))
        race.add(f"{ARRAYS} {size}", partial(together, ARRAYS, ArrayArm(arm()).equilibria, cases, expected))
    few, robot = standard_cases(settings.singles), PinocchioArm(arm())
    known = expected_springs(few, None)
    race.add(FIXED_POINT, partial(pinocchio_calls, FIXED_POINT, robot, fixed_point, few, known))
    race.run()
    labels = [*(batch_name(backend) for backend in BACKENDS), ARRAYS]
    made = [curve("batches", label, {size: race.cost(f"{label} {size}") for size in sizes}) for label in labels]
    made.append(curve("batches", FIXED_POINT, dict.fromkeys(sizes, race.cost(FIXED_POINT))))
    return [line for line in made if line is not None], sorted({f"{n}: {why}" for n, why in race.absent.items()})


def _barest(race: Race) -> str:
    """The cheapest of the three ways to Newton's method."""
    return min(map(newton_name, NEWTON), key=lambda name: race.cost(name) or np.inf)
