"""Jobs of rods: an equilibrium of 50 sections in calls of Pinocchio's Jacobian, and how cost grows with their number."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from softrobots.core.checks import FloatArray
from softrobots.statics.equilibrium import solve_equilibrium
from studies.benchmark.cases import rod, rod_forces
from studies.benchmark.comparison import Comparison, Outcome, Settings, curve
from studies.benchmark.compiled_solvers import BENDING, compiled
from studies.benchmark.measurement import Workload, require_agreement
from studies.benchmark.results import AT_MOST

JACOBIAN = "computeJointJacobians of the chain of six joints a section"
BENT, FREE, HINGED = "sections, bending only", "sections, all four strains", "pairs of hinges"
"""The forms of a rod."""
FORMS = {BENT: ("sections", BENDING), FREE: ("sections", ()), HINGED: ("lumped", ())}
"""Kind of the chain and locked strains by form."""

_CASES = 32
_CHECKED = 3
_SAME = 1e-8  # [m], of tips whose residuals are below 1e-10 f L
_NEAR = 0.01  # share of the length by which stretch and twist, which are small here, may move the tip
_FROM, _TO, _GROWTH = 10, 50, 5.0


def rods(settings: Settings) -> Outcome:
    """An equilibrium of a rod of many sections against Pinocchio's Jacobian of the same rod."""
    comparison, count = Comparison(settings, "rod"), settings.sections
    comparison.add(JACOBIAN, partial(_jacobian, count))
    for form in FORMS:
        comparison.add(f"compiled, numba, {form}", partial(_single, form, count))
        comparison.add(f"compiled, numba, {form}, batch", partial(_batch, form, count, settings.batch))
    comparison.run()
    job = f"rod of {count} sections"
    rows = [
        comparison.costlier(f"{job}, one call", f"compiled, numba, {BENT}", JACOBIAN, AT_MOST, 4.0),
        comparison.costlier(f"{job}, one call", f"compiled, numba, {FREE}", JACOBIAN),
        comparison.costlier(f"{job}, one call", f"compiled, numba, {HINGED}", JACOBIAN),
        *(comparison.costlier(f"{job}, batch", f"compiled, numba, {form}, batch", JACOBIAN) for form in FORMS),
    ]
    return Outcome(rows)


def sizes(settings: Settings) -> Outcome:
    """Cost of one equilibrium over the number of sections or pairs of hinges, and its growth from 10 to 50."""
    comparison = Comparison(settings, "numbers of sections")
    for count in settings.sizes:
        comparison.add(f"{JACOBIAN} {count}", partial(_jacobian, count))
        for form in FORMS:
            comparison.add(f"{form} {count}", partial(_single, form, count))
        comparison.add(f"solve_equilibrium, {FREE} {count}", partial(_general, count))
    comparison.run()
    labels = (*FORMS, f"solve_equilibrium, {FREE}", JACOBIAN)
    curves = [
        curve("sizes", label, {count: comparison.cost(f"{label} {count}") for count in settings.sizes}) for label in labels
    ]
    rows = []
    if _FROM in settings.sizes and _TO in settings.sizes:
        job = f"equilibrium, {_TO} against {_FROM}"
        targets = {BENT: _GROWTH, FREE: _GROWTH, HINGED: _GROWTH}
        rows = [comparison.costlier(job, f"{form} {_TO}", f"{form} {_FROM}", AT_MOST, limit) for form, limit in targets.items()]
    return Outcome(rows, [line for line in curves if line is not None])


def _jacobian(count: int) -> Workload:
    robot = rod(count)
    model, data = robot.workspace(None)
    poses = [robot.configuration((), _curled(robot.n_springs, seed)) for seed in range(_CASES)]

    def run() -> None:
        for q in poses:
            pin.computeJointJacobians(model, data, q)

    return Workload(_CASES, run)


def _curled(size: int, seed: int) -> FloatArray:
    """Section coordinates within range; what they are does not matter for the cost of a Jacobian."""
    strains: Any = np.random.default_rng(seed).normal(scale=0.02, size=size)
    strains[3::4] *= 0.01
    return np.asarray(strains)


def _single(form: str, count: int) -> Workload:
    """One call a case."""
    solver, forces = _solver(form, count), rod_forces(_CASES)
    _check(form, count, [solver.equilibrium((), force).tip_position for force in forces[:_CHECKED]], forces)
    none = np.zeros(0)
    return Workload(_CASES, lambda: [solver.equilibrium(none, force) for force in forces])


def _batch(form: str, count: int, batch: int) -> Workload:
    """A batch, smaller than that of the arm by as much as a rod has more springs."""
    solver, size = _solver(form, count), max(_CASES, batch // (4 * count))
    forces, none = rod_forces(size), np.zeros((size, 0))
    _check(form, count, solver.equilibria(none[:_CHECKED], forces[:_CHECKED]).tip_positions, forces)
    return Workload(size, lambda: solver.equilibria(none, forces))


def _general(count: int) -> Workload:
    robot, forces = rod(count), rod_forces(4)
    return Workload(len(forces), lambda: [solve_equilibrium(robot, (), force) for force in forces])


def _solver(form: str, count: int) -> Any:
    kind, locked = FORMS[form]
    return compiled(rod(count, kind), "numba", locked)


def _check(form: str, count: int, tips: Sequence[FloatArray] | FloatArray, forces: FloatArray) -> None:
    """Compare tips with those of `solve_equilibrium`, which has all strains: bending only comes near."""
    robot = rod(count, FORMS[form][0])
    expected = [solve_equilibrium(robot, (), force, tolerance=1e-13).tip_position for force in forces[:_CHECKED]]
    tolerance = _NEAR * robot.reach if FORMS[form][1] else _SAME
    require_agreement(form, np.array(tips), np.array(expected), tolerance, "m")
