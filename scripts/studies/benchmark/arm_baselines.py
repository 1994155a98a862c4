"""Workloads of the inflatable arm: names, and the check of their answers before they are timed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.statics.equilibrium import solve_equilibrium
from studies.benchmark.cases import LoadCases, arm
from studies.benchmark.comparison import Comparison
from studies.benchmark.compiled_solvers import BACKENDS, compiled
from studies.benchmark.measurement import Workload, require_agreement
from studies.benchmark.mujoco_settling import LARGE_STEPS, TIME_STEPS, SettlingArm
from studies.benchmark.pinocchio_solvers import NEWTON, PinocchioArm, Solver, fixed_point, plain_fixed_point
from studies.benchmark.scipy_solvers import scipy_root

FIXED_POINT = "Python + Pinocchio, fixed point, hand-tuned"
PLAIN_FIXED_POINT = "Python + Pinocchio, fixed point"
GENERAL = "solve_equilibrium"
MUJOCO = "MuJoCo settling, tuned, steps of 10 ms at most"
MUJOCO_ANY = "MuJoCo settling, tuned, any step"
ROOT = "scipy.optimize.root over Pinocchio"

Gravity = tuple[float, float, float] | None
One = Callable[[FloatArray, FloatArray], Any]
"""A solver of one case, or of many: motor coordinates and forces, or motor torques."""

CHECKED = 20
"""Answers that are compared before something is timed."""

_SAME = 1e-8  # [rad], of answers whose residuals are below 1e-10 f L: 2e-9 N m over 100 N m/rad, with room for soft poses
_TUNED = 16  # cases that the simulator is tuned on


def newton_name(name: str) -> str:
    """What a Newton's method of `pinocchio_solvers` is called in the tables."""
    return f"Python + Pinocchio, Newton, {name}"


def batch_name(backend: str) -> str:
    """What batches of a compiled back end are called in the tables."""
    return f"compiled, {backend}, batch"


def single_name(backend: str) -> str:
    """What single calls of a compiled back end are called in the tables."""
    return f"compiled, {backend}, one call"


def expected_springs(cases: LoadCases, gravity: Gravity) -> FloatArray:
    """What `solve_equilibrium` says of the first cases, shape (n, n_springs) [rad]."""
    pairs = zip(*cases.first(CHECKED), strict=True)
    return np.array([solve_equilibrium(arm(), *pair, gravity=gravity, tolerance=1e-13).q_springs for pair in pairs])


def one_by_one(
    name: str,
    solve: One,
    cases: LoadCases,
    expected: FloatArray,
    *,
    read: Callable[[Any], FloatArray] = np.asarray,
    tolerance: float = _SAME,
    unit: str = "rad",
) -> Workload:
    """Cases solved one by one, after the first ones have been checked.

    Args:
        name: What is to be timed.
        solve: Solves one case.
        cases: The cases.
        expected: The right answers of the first ones, shape (n, k).
        read: What of its answer is compared.
        tolerance: Largest difference of a number.
        unit: Unit of the numbers.

    Raises:
        SoftRobotsError: If its answers are wrong.
    """
    pairs = list(zip(*cases, strict=True))
    found = np.array([read(solve(*pair)) for pair in pairs[: len(expected)]])
    require_agreement(name, found, expected[: len(found)], tolerance, unit)
    return Workload(len(pairs), lambda: [solve(*pair) for pair in pairs])


def together(
    name: str,
    solve: One,
    cases: LoadCases,
    expected: FloatArray,
    *,
    read: Callable[[Any], FloatArray] = np.asarray,
    tolerance: float = _SAME,
    unit: str = "rad",
) -> Workload:
    """Cases solved in one call, after the first ones have been checked; arguments of `one_by_one`."""
    found = read(solve(*cases.first(len(expected))))
    require_agreement(name, found, expected[: len(found)], tolerance, unit)
    return Workload(len(cases.forces), lambda: solve(*cases))


def compiled_batch(
    name: str, backend: str, cases: LoadCases, expected: FloatArray, gravity: Gravity, threads: int = 1
) -> Workload:
    """A batch of a compiled back end."""
    solve = partial(compiled(arm(), backend).equilibria, gravity=gravity, threads=threads)
    return together(name, solve, cases, expected, read=_springs)


def compiled_calls(backend: str, cases: LoadCases, expected: FloatArray, gravity: Gravity) -> Workload:
    """Single calls of a compiled back end, with checks and result object."""
    solver = compiled(arm(), backend)
    solve = solver.equilibrium if gravity is None else partial(solver.equilibrium, gravity=gravity)
    return one_by_one(single_name(backend), solve, cases, expected, read=_springs)


def add_compiled(comparison: Comparison, cases: LoadCases, few: LoadCases, expected: FloatArray, gravity: Gravity) -> None:
    """Batches and single calls of both back ends."""
    for backend in BACKENDS:
        comparison.add(batch_name(backend), partial(compiled_batch, batch_name(backend), backend, cases, expected, gravity))
        comparison.add(single_name(backend), partial(compiled_calls, backend, few, expected, gravity))


def pinocchio_calls(
    name: str,
    robot: PinocchioArm,
    solve: Solver,
    cases: LoadCases,
    expected: FloatArray,
) -> Workload:
    """A solver of `pinocchio_solvers`, or one with the same arguments."""
    return one_by_one(name, partial(solve, robot), cases, expected, read=lambda q: q[robot.springs])


def add_python(comparison: Comparison, few: LoadCases, expected: FloatArray) -> None:
    """Add solvers written in Python over Pinocchio, SciPy's over Pinocchio, and `solve_equilibrium`."""
    robot = PinocchioArm(arm())
    named: dict[str, Solver] = {FIXED_POINT: fixed_point, PLAIN_FIXED_POINT: plain_fixed_point}
    named |= {newton_name(name): solve for name, solve in NEWTON.items()}
    for name, solve in named.items():
        comparison.add(name, partial(pinocchio_calls, name, robot, solve, few, expected))
    comparison.add(ROOT, lambda: pinocchio_calls(ROOT, robot, scipy_root(), few, expected))
    comparison.add(GENERAL, lambda: one_by_one(GENERAL, partial(solve_equilibrium, arm()), few, expected, read=_springs))


def _springs(found: Any) -> FloatArray:
    return np.asarray(found.q_springs)


def settling(name: str, quick: bool, few: LoadCases, expected: FloatArray, notes: list[str]) -> Workload:
    """MuJoCo with the best settings of the grid."""
    simulator = SettlingArm(arm())
    time_steps = TIME_STEPS if name == MUJOCO else (*TIME_STEPS, *LARGE_STEPS)
    some = few.first(1 if quick else _TUNED)
    tried = simulator.tune(*some, time_steps=time_steps)
    best = tried[0]
    notes.append(
        f"{name}: time step {best.time_step:g} s, damping {best.damping:g} N m s/rad, {best.stride} steps between two looks, "
        f"{best.steps:.0f} steps a case, the best of {len(tried)} settings"
    )
    return one_by_one(name, simulator.settle, few, expected, read=lambda found: found[0])
