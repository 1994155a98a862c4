"""The contenders of the inflatable arm: what each is called, and that its answers are right before it is timed."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from softrobots.core.checks import FloatArray
from softrobots.core.errors import SoftRobotsError
from softrobots.statics.equilibrium import solve_equilibrium
from softrobots.statics.kinematics import frame_placement
from studies.benchmark.cases import LoadCases, arm
from studies.benchmark.compiled_solvers import BACKENDS, compiled
from studies.benchmark.cpp_kinematics import CppChain, build
from studies.benchmark.measurement import Contender, require_agreement
from studies.benchmark.mujoco_settling import LARGE_STEPS, TIME_STEPS, SettlingArm
from studies.benchmark.pinocchio_solvers import NEWTON, PinocchioArm, Solver, fixed_point, plain_fixed_point
from studies.benchmark.race import Race
from studies.benchmark.scipy_solvers import solvers

FIXED_POINT = "Python + Pinocchio, fixed point, hand-tuned"
PLAIN_FIXED_POINT = "Python + Pinocchio, fixed point"
GENERAL = "solve_equilibrium"
MUJOCO = "MuJoCo settling, tuned, steps of 10 ms at most"
MUJOCO_ANY, MUJOCO_BARE = "MuJoCo settling, tuned, any step", "MuJoCo settling, tuned, any step, contacts off"
CPP = "one forwardKinematics of Pinocchio in C++"

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


def scipy_name(name: str) -> str:
    """What a solver of SciPy is called in the tables."""
    return f"scipy.optimize.{name} over Pinocchio"


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
) -> Contender:
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
    return Contender(len(pairs), lambda: [solve(*pair) for pair in pairs])


def together(
    name: str,
    solve: One,
    cases: LoadCases,
    expected: FloatArray,
    *,
    read: Callable[[Any], FloatArray] = np.asarray,
    tolerance: float = _SAME,
    unit: str = "rad",
) -> Contender:
    """Cases solved in one call, after the first ones have been checked; arguments of `one_by_one`."""
    found = read(solve(*cases.first(len(expected))))
    require_agreement(name, found, expected[: len(found)], tolerance, unit)
    return Contender(len(cases.forces), lambda: solve(*cases))


def compiled_batch(
    name: str, backend: str, cases: LoadCases, expected: FloatArray, gravity: Gravity, threads: int = 1
) -> Contender:
    """A batch of a compiled back end."""
    solve = partial(compiled(arm(), backend).equilibria, gravity=gravity, threads=threads)
    return together(name, solve, cases, expected, read=_springs)


def compiled_calls(backend: str, cases: LoadCases, expected: FloatArray, gravity: Gravity) -> Contender:
    """Single calls of a compiled back end, with checks and result object."""
    solver = compiled(arm(), backend)
    solve = solver.equilibrium if gravity is None else partial(solver.equilibrium, gravity=gravity)
    return one_by_one(single_name(backend), solve, cases, expected, read=_springs)


def add_compiled(race: Race, cases: LoadCases, few: LoadCases, expected: FloatArray, gravity: Gravity) -> None:
    """Batches and single calls of both back ends."""
    for backend in BACKENDS:
        race.add(batch_name(backend), partial(compiled_batch, batch_name(backend), backend, cases, expected, gravity))
        race.add(single_name(backend), partial(compiled_calls, backend, few, expected, gravity))


def pinocchio_calls(
    name: str,
    robot: PinocchioArm,
    solve: Solver,
    cases: LoadCases,
    expected: FloatArray,
) -> Contender:
    """A solver of `pinocchio_solvers`, or one with the same arguments."""
    return one_by_one(name, partial(solve, robot), cases, expected, read=lambda q: q[robot.springs])


def add_python(race: Race, few: LoadCases, expected: FloatArray) -> None:
    """What one writes in Python over Pinocchio, with SciPy too, and our own general solver."""
    add_pinocchio(race, few, expected)
    robot = PinocchioArm(arm())
    try:
        named = {scipy_name(name): solve for name, solve in solvers().items()}
    except SoftRobotsError as error:
        for name in ("root", "least_squares"):
            race.leave_out(scipy_name(name), str(error))
        return
    for name, solve in named.items():
        race.add(name, partial(pinocchio_calls, name, robot, solve, few, expected))


def add_pinocchio(race: Race, few: LoadCases, expected: FloatArray) -> None:
    """What one writes in Python over Pinocchio alone, and our own general solver."""
    robot = PinocchioArm(arm())
    named: dict[str, Solver] = {FIXED_POINT: fixed_point, PLAIN_FIXED_POINT: plain_fixed_point}
    named |= {newton_name(name): solve for name, solve in NEWTON.items()}
    for name, solve in named.items():
        race.add(name, partial(pinocchio_calls, name, robot, solve, few, expected))
    race.add(GENERAL, lambda: one_by_one(GENERAL, partial(solve_equilibrium, arm()), few, expected, read=_springs))


def _springs(found: Any) -> FloatArray:
    return np.asarray(found.q_springs)


def settling(name: str, contacts: bool, quick: bool, few: LoadCases, expected: FloatArray, notes: list[str]) -> Contender:
    """MuJoCo with the best settings of the grid."""
    simulator = SettlingArm(arm(), contacts=contacts)
    time_steps = TIME_STEPS if name == MUJOCO else (*TIME_STEPS, *LARGE_STEPS)
    some = few.first(1 if quick else _TUNED)
    tried = simulator.tune(*some, time_steps=time_steps)
    best = tried[0]
    notes.append(
        f"{name}: time step {best.time_step:g} s, damping {best.damping:g} N m s/rad, {best.stride} steps between two looks, "
        f"{best.steps:.0f} steps a case, the best of {len(tried)} settings"
    )
    return one_by_one(name, simulator.settle, few, expected, read=lambda found: found[0])


def cpp_kinematics(cases: LoadCases) -> Contender:
    """C++, checked against Pinocchio in Python."""
    chain = CppChain(arm(), build())
    q = np.zeros((len(cases.forces), arm().pinocchio.nv))
    q[:, arm().motor_indices] = cases.q_motors
    q[:, arm().spring_indices] = np.random.default_rng(0).normal(scale=0.05, size=(len(q), arm().n_springs))
    last = arm().pinocchio.names[arm().pinocchio.njoints - 1]
    expected = [frame_placement(arm(), row, last).translation for row in q[:CHECKED]]
    require_agreement(CPP, chain.last_joints(q[:CHECKED]), np.array(expected), 1e-12, "m")
    return Contender(len(q), lambda: chain.last_joints(q))
