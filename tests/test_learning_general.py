"""Derivatives of batches of robots that are no compiled chains: differences of robots that `solve_equilibrium` solves."""

from __future__ import annotations

import numpy as np
import pytest

import softrobots as sr
from softrobots.learning.differentiable import Differentiable
from softrobots.learning.general_solver import GeneralSolver
from tests.support.learning_cases import CASES, LENGTHS, OPTIONS, PCC, STEP, changes, solved


@pytest.mark.study
@pytest.mark.parametrize("kind", CASES)
def test_derivatives_are_differences_of_solved_robots(kind: str) -> None:
    """Along a change of motors, force and parameters at once; reverse mode is the transpose."""
    case = CASES[kind]()
    solver = Differentiable("equilibrium", case.robot, case.names, **OPTIONS)
    assert isinstance(solver._changes, GeneralSolver)
    one = [np.array(case.motors), np.array(case.force), solver.present]
    rates = changes(case, solver)
    near = [one[0] + rates[0], 0.5 * one[1]]
    inputs = [np.stack([one[0], near[0]]), np.stack([one[1], near[1]]), one[2]]
    results = solver.solve(*inputs)
    pushed = np.concatenate(solver.push(inputs, results, rates), axis=1)
    for row in range(2):
        at = [inputs[0][row], inputs[1][row], one[2]]
        assert np.concatenate([part[row] for part in results]) == pytest.approx(solved(solver, at), abs=1e-10)
        ends = [
            solved(solver, [a + n * STEP * b for a, b in zip(at, rates, strict=True)], results[0][row]) for n in (-2, -1, 1, 2)
        ]
        slope = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * STEP)
        assert pushed[row] == pytest.approx(slope, abs=1e-8 * (1.0 + np.abs(slope).max()))
        assert np.abs(slope).max() > 1e-3
    random = np.random.default_rng(3)
    weights = [random.normal(size=part.shape) for part in results]
    pulled = solver.pull(inputs, results, weights, [(2,), (), ()])
    back = sum(float((np.asarray(a) * b).sum()) for a, b in zip(pulled, rates, strict=True))
    assert back == pytest.approx(float((np.concatenate(weights, axis=1) * pushed).sum()), rel=1e-10)


@pytest.mark.study
def test_equilibria_of_a_compiled_robot_are_those_of_its_batch_solver() -> None:
    """At the values that it was compiled with, and close to the others' at other values. Derivatives are the same."""
    case = CASES["tendons"]()
    compiled = sr.compile(sr.load_model(case.robot), backend="python")
    solver, plain = (Differentiable("equilibrium", one, case.names, **OPTIONS) for one in (compiled, case.robot))
    random = np.random.default_rng(5)
    inputs = [np.array(case.motors) + 1e-4 * random.normal(size=(4, 6)), np.array(case.force), solver.present]
    batch = compiled.equilibria(*inputs[:2], gravity=sr.EARTH_GRAVITY)
    assert batch.certified.all()
    results = solver.solve(*inputs)
    assert np.array_equal(results[0], batch.q_springs)
    assert np.array_equal(results[1], batch.tip_positions)
    weights = [random.normal(size=part.shape) for part in results]
    shapes = [(4,), (), ()]
    pairs = zip(
        solver.pull(inputs, results, weights, shapes), plain.pull(inputs, plain.solve(*inputs), weights, shapes), strict=True
    )
    for own, other in pairs:  # the two solvers stop at residuals of 1e-10 and 1e-12 of the load
        assert own == pytest.approx(other, rel=1e-7, abs=1e-9 * np.abs(other).max())
    inputs[2] = 1.01 * solver.present
    for own, other in zip(solver.solve(*inputs), plain.solve(*inputs), strict=True):
        assert own == pytest.approx(other, abs=1e-9 * solver.model.reach)


def test_load_estimates_of_an_arm_with_a_plateau() -> None:
    """By motors, torques and parameters: differences of estimates, and the transpose."""
    solver = Differentiable("estimate", sr.InflatableArm(max_moment=12.0), ("max_moment", "link[2].stiffness"), **OPTIONS)
    motors = np.array([0.3, 0.6, -0.8])
    felt = sr.solve_equilibrium(solver.model, motors, (2.0, 4.0, -5.0), gravity=sr.EARTH_GRAVITY).motor_torques
    inputs = [motors, np.array(felt), solver.present]
    rates = [np.array([0.1, -0.2, 0.1]), np.array([0.3, 0.2, -0.4]), 0.1 * solver.present]
    results = solver.solve(*inputs)
    assert results[2] == pytest.approx(np.array([2.0, 4.0, -5.0]), abs=1e-8)
    pushed = np.concatenate(solver.push(inputs, results, rates))
    ends = []
    for number in (-1, 1):
        motors, torques, values = (a + number * STEP * b for a, b in zip(inputs, rates, strict=True))
        found = sr.estimate_load(solver._set.model(values), motors, torques, gravity=sr.EARTH_GRAVITY)
        ends.append(np.concatenate([found.equilibrium.q_springs, found.equilibrium.tip_position, found.force]))
    slope = (ends[1] - ends[0]) / (2.0 * STEP)
    assert pushed == pytest.approx(slope, abs=1e-6 * np.abs(slope).max())  # of second order: an estimate takes 0.2 s
    weights = [np.random.default_rng(5).normal(size=part.shape) for part in results]
    pulled = solver.pull(inputs, results, weights, [(), (), ()])
    back = sum(float((np.asarray(a) * b).sum()) for a, b in zip(pulled, rates, strict=True))
    assert back == pytest.approx(float(np.concatenate(weights) @ pushed), rel=1e-10)


@pytest.mark.parametrize(("kind", "step"), [("given lengths", 1e-3), pytest.param("tendons", 3e-4, marks=pytest.mark.study)])
def test_least_squares_of_six_tensions_are_differences_of_estimates(kind: str, step: float) -> None:
    """A twentieth of noise stays unexplained: without its share derivatives would be wrong by 5e-4 and more."""
    case, random = CASES[kind](), np.random.default_rng(1)
    solver = Differentiable("estimate", case.robot, case.names, **OPTIONS)
    parameters, motors = solver._set, np.array(case.motors)
    true = motors + parameters.motor_offsets(solver.present)
    felt = np.array(sr.solve_equilibrium(solver.model, true, case.force, gravity=sr.EARTH_GRAVITY).motor_torques)
    inputs = [motors, felt + 0.05 * np.abs(felt).mean() * random.normal(size=6), solver.present]
    change = changes(case, solver)
    rates = [change[0], 0.3 * np.abs(felt).max() * random.normal(size=6), change[2]]
    results = solver.solve(*inputs)
    pushed = np.concatenate(solver.push(inputs, results, rates))
    ends = []
    for number in (-2, -1, 1, 2):
        motors, torques, values = (a + number * step * b for a, b in zip(inputs, rates, strict=True))
        model, true = parameters.model(values), motors + parameters.motor_offsets(values)
        found = sr.estimate_load(model, true, torques, gravity=sr.EARTH_GRAVITY, restart=False)
        ends.append(np.concatenate([found.equilibrium.q_springs, found.equilibrium.tip_position, found.force]))
    slope = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * step)
    assert pushed == pytest.approx(slope, abs=1e-8 * np.abs(slope).max())
    weights = [random.normal(size=part.shape) for part in results]
    pulled = solver.pull(inputs, results, weights, [(), (), ()])
    back = sum(float((np.asarray(a) * b).sum()) for a, b in zip(pulled, rates, strict=True))
    assert back == pytest.approx(
        float(np.concatenate(weights) @ pushed), rel=1e-9
    )  # both modes take differences along other forces


def test_rows_without_a_result_are_named_or_marked() -> None:
    """Lengths that are no numbers, and lengths that no shape has; other rows are as without them."""
    motors = np.array([LENGTHS, LENGTHS, LENGTHS])
    motors[1, 2], motors[2, 0] = np.nan, -0.01
    force = np.array([0.5, 1.0, -1.0])
    strict, marking = (
        Differentiable("equilibrium", sr.PccArm(**PCC), "muscle_distance", **OPTIONS | {"failed": failed})
        for failed in ("raise", "nan")
    )
    with pytest.raises(sr.EquilibriumNotFound, match=r"1 of 2 rows.*row 1.*lengths that no shape has"):
        strict.solve(motors[::2], force, strict.present)
    results, alone = marking.solve(motors, force, marking.present), strict.solve(motors[:1], force, strict.present)
    weights = [np.ones_like(one) for one in results]
    found = marking.pull([motors, force, marking.present], results, weights, [(3,), (3,), ()])
    expected = strict.pull([motors[:1], force, strict.present], alone, [one[:1] for one in weights], [(1,), (1,), ()])
    for a, b in zip((*results, *found[:2]), (*alone, *expected[:2]), strict=True):
        assert np.array_equal(np.asarray(a)[:1], b)
    assert np.isnan(results[1][1:]).all()
    assert np.array_equal(np.asarray(found[0])[1:], np.zeros((2, 6)))
    assert np.array_equal(found[2], expected[2])
    assert np.isnan(marking.push([motors, force, marking.present], results, [None, np.ones(3), None])[0][1:]).all()
    nothing = marking.solve(motors[1:], force, marking.present)  # not one of them
    moved = marking.push([motors[1:], force, marking.present], nothing, [None, np.ones(3), None])
    assert [one.shape for one in moved] == [one.shape for one in nothing]
    assert np.isnan(np.concatenate(moved, axis=1)).all()
    weights = [np.ones_like(one) for one in nothing]
    assert np.array_equal(marking.pull([motors[1:], force, marking.present], nothing, weights, [None, None, ()])[2], [0.0])


def test_the_general_back_end_agrees_with_compiled_code() -> None:
    """Results and gradients of a chain that is compiled unless another back end is asked for."""
    motors, force = np.array([[0.1, 0.2, 0.3], [0.4, 0.5, -0.6]]), np.array([1.0, 2.0, -3.0])
    solvers = [
        Differentiable("equilibrium", sr.InflatableArm(), ("stiffness", "motor[1].offset"), **OPTIONS | {"backend": backend})
        for backend in ("python", "pinocchio")
    ]
    found = []
    for solver in solvers:
        results = solver.solve(motors, force, solver.present)
        weights = [np.ones_like(one) for one in results]
        found.append([*results, *solver.pull([motors, force, solver.present], results, weights, [(2,), (), ()])])
    for a, b in zip(*found, strict=True):
        assert a == pytest.approx(b, abs=1e-9)


def test_what_has_no_derivatives_is_refused_by_name() -> None:
    with pytest.raises(sr.ParameterError, match="dry friction"):
        Differentiable("equilibrium", sr.TendonArm(bending_friction=0.001), (), **OPTIONS)
    tendons = sr.TendonArm(segment_lengths=(0.06,)).urdf()
    for name in ("tendon_1_1", "tendon_1_2"):
        head, numbers = f'name="{name}" pretension="2.0" rest_length="0.06"', 'shortest="0.048" stiffness="8000.0"'
        tendons = tendons.replace(f'kind="elastic" longest="0.072" {head} {numbers}', f'kind="tension" name="{name}"')
    with pytest.raises(sr.ParameterError, match=r"three actuators at least feel the load \(1 do\)"):
        Differentiable("estimate", sr.load_model(tendons), (), **OPTIONS)
    hinges = sr.PccArm(segment_lengths=(0.3,), chain="lumped", hinges=3)
    solver = Differentiable("equilibrium", hinges, "joint[section_1_1_bend_x].stiffness", **OPTIONS)
    inputs = [solver.model.relaxed_motors + [0.01, -0.01, 0.0], np.array([0.5, 1.0, -1.0]), solver.present]
    results = solver.solve(*inputs)
    with pytest.raises(sr.ParameterError, match="about which the elastic coordinates do not jump"):
        solver.pull(inputs, results, [np.ones_like(one) for one in results], [None, None, ()])
    tips = [np.zeros_like(results[0]), np.ones_like(results[1])]
    step = 1e-3 * solver.present
    ends = [solver.solve(*inputs[:2], solver.present + n * step)[1].sum() for n in (-2, -1, 1, 2)]
    slope = np.array([1.0, -8.0, 8.0, -1.0]) @ ends / (12.0 * step)
    assert solver.pull(inputs, results, tips, [None, None, ()])[2] == pytest.approx(slope, rel=1e-6)
