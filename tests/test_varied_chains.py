"""Compiled looped chains with other parameter values from case to case: one code, whose inputs are numbers of the robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pytest

import softrobots as sr
from softrobots.learning.differentiable import Differentiable
from softrobots.learning.varied_chains import VariedChains
from tests.support.learning_cases import CASES, LENGTHS, OPTIONS, PCC, STEP, Case, changes, solved

MORE: Mapping[str, Callable[[], Case]] = {
    "base to tip": lambda: Case(
        sr.PccArm(**PCC, routing="base"), (0.28, 0.32, 0.3, 0.56, 0.54, 0.55), 0.01, (0.5, 1.0, -1.0),
        ("segment[2].segment_lengths", "muscle_distance", "bending_stiffness"),
    ),
    "lumped": lambda: Case(
        sr.PccArm(**PCC, chain="lumped"), LENGTHS, 0.01, (0.5, 1.0, -1.0), ("muscle_distance", "linear_density", "offset[2]")
    ),
    "long arm": lambda: Case(
        sr.InflatableArm(link_lengths=(0.3,) * 6), (0.3, 0.2, -0.1, 0.2, -0.3, 0.1, 0.2), 0.1, (1.0, 2.0, -3.0),
        ("hinge_offset", "stiffness", "link[2].link_lengths", "wall_thickness", "joint[spring_3_up].rest"),
    ),
    "chambers": lambda: Case(
        sr.PccArm(**PCC, kind="pressure"), (2e4, 5e4, 0.0, 1e4, 4e4, 3e4), 1e3, (0.5, 1.0, -1.0),
        ("muscle_area", "muscle_distance", "segment_lengths[1]"),
    ),
    "braided": lambda: Case(
        sr.PccArm(**PCC, kind="mckibben"), (2e4, 5e4, 1e3, 1e4, 4e4, 3e4), 1e3, (0.5, 1.0, -1.0),
        ("muscle_diameter", "muscle_distance", "muscle_braid_angle"),
    ),
}  # fmt: skip
LOOPED = {name: make for name, make in CASES.items() if name not in ("side branches", "plateau")} | MORE


@pytest.mark.study
@pytest.mark.parametrize("kind", LOOPED)
def test_cases_of_other_parameters_are_robots_that_were_built_with_them(kind: str) -> None:
    """Equilibria; and derivatives are differences of those, along a change of motors, force and parameters at once."""
    case = LOOPED[kind]()
    solver = Differentiable("equilibrium", sr.compile(sr.load_model(case.robot), backend="python"), case.names, **OPTIONS)
    random, scale = np.random.default_rng(2), np.where(solver.present == 0.0, 0.02, solver.present)
    inputs = [
        np.array(case.motors) + case.rate * random.uniform(size=(3, len(case.motors))),
        np.array(case.force) * random.uniform(0.5, 1.0, (3, 1)),
        solver.present + 0.02 * scale * random.uniform(-1.0, 1.0, (3, len(scale))),
    ]
    results, rates = solver.solve(*inputs), changes(case, solver)
    pushed = np.concatenate(solver.push(inputs, results, rates), axis=1)
    for row in range(3):
        assert None not in solver._changes._at(tuple(inputs[2][row].tolist()))[1:]  # compiled
        at = [one[row] for one in inputs]
        own = np.concatenate([part[row] for part in results])
        assert own == pytest.approx(solved(solver, at), abs=1e-9 * solver.model.reach)
    ends = [solved(solver, [a + n * STEP * b for a, b in zip(at, rates, strict=True)], results[0][row]) for n in (-2, -1, 1, 2)]
    slope = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * STEP)
    assert pushed[row] == pytest.approx(slope, abs=1e-8 * (1.0 + np.abs(slope).max()))
    weights = [random.normal(size=part.shape) for part in results]
    pulled = solver.pull(inputs, results, weights, [(), (), ()])
    back = sum(float((np.asarray(a) * b).sum()) for a, b in zip(pulled, rates, strict=True))
    assert back == pytest.approx(float((np.concatenate(weights, axis=1) * pushed).sum()), rel=1e-10)


@pytest.mark.study
def test_estimates_at_other_values_find_the_force_back() -> None:
    """From the tensions of `solve_equilibrium` of a robot that was built with them."""
    case = CASES["given lengths"]()
    names = ("muscle_distance", "bending_stiffness")
    solver = Differentiable("estimate", sr.compile(sr.load_model(case.robot), backend="python"), names, **OPTIONS)
    values = solver.present * [[1.01, 0.98], [0.99, 1.02]]
    given = [np.array(case.motors), sr.EARTH_GRAVITY]
    felt = [
        sr.solve_equilibrium(solver._set.model(one), given[0], case.force, gravity=given[1]).motor_torques for one in values
    ]
    found = solver.solve(given[0], np.array(felt), values)
    assert found[2] == pytest.approx(np.tile(case.force, (2, 1)), abs=1e-7)  # torques are explained to 1e-10 of themselves


def test_code_is_made_anew_for_numbers_that_no_parameter_changed_before_and_none_for_another_structure() -> None:
    case = CASES["helix"]()
    compiled = sr.compile(sr.load_model(case.robot), backend="python")
    chains = VariedChains(compiled, Differentiable("equilibrium", compiled, "young_modulus", **OPTIONS)._set)
    other = sr.load_model(sr.HelixTube(length=0.3, elastic_sections=3, young_modulus=1.1 * case.robot.young_modulus))
    assert chains.at(other) is not None
    few = chains._inputs.count
    longer = sr.load_model(sr.HelixTube(length=0.31, elastic_sections=3))
    solvers = chains.at(longer)
    assert solvers is not None
    assert chains._inputs.count > few
    for model in (other, longer):
        found, expected = chains.at(model), sr.solve_equilibrium(model, (), case.force, gravity=sr.EARTH_GRAVITY)
        assert found is not None
        tip = found.equilibrium((), case.force, gravity=sr.EARTH_GRAVITY).tip_position
        assert tip == pytest.approx(expected.tip_position, abs=1e-9 * model.reach)
    assert chains.at(sr.load_model(sr.HelixTube(length=0.3, elastic_sections=4))) is None
