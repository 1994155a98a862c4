"""Compiled derivatives of looped chains: those of the solvers on Pinocchio, and differences of compiled equilibria."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.learning import force_batches
from softrobots.learning.chain_responses import ChainResponses
from softrobots.learning.differentiable import Differentiable
from tests.support.learning_cases import CASES, OPTIONS, balanced, changes
from tests.support.routed_robots import ROBOTS as ROUTED
from tests.support.serial_chains import ROBOTS

ALONE = ("given lengths", "tensions", "tendons", "winding lengths", "helix")


@pytest.mark.study
@pytest.mark.parametrize("kind", ALONE)
def test_compiled_derivatives_are_those_of_pinocchio(kind: str) -> None:
    """Of robots with parameters, in both modes; of rows that share a force, and of one that failed."""
    case = CASES[kind]()
    compiled = sr.compile(sr.load_model(case.robot), backend="python")
    options = OPTIONS | {"failed": "nan"}
    solver, plain = (Differentiable("equilibrium", one, case.names, **options) for one in (compiled, case.robot))
    rates = changes(case, solver)
    motors = np.array(case.motors) + np.array([[0.0], [1.0], [0.5]]) * rates[0]
    motors[2, :1] = np.nan
    inputs = [motors, np.array(case.force), solver.present]
    results = plain.solve(*inputs)
    random = np.random.default_rng(3)
    weights = [random.normal(size=part.shape) for part in results]
    own, other = (one.pull(inputs, results, weights, [(3,), (), ()]) for one in (solver, plain))
    for a, b in zip(own, other, strict=True):  # the results are in balance to 1e-12, the numbers of winding lengths by it
        assert a == pytest.approx(b, rel=1e-9, abs=1e-9 * np.abs(b).max(initial=0.0))
    # rates by parameters are differences of numbers: the order of sums in the code moves those of winding lengths by some 1e-9
    for given, near in (([rates[0], rates[1], None], 1e-9), ([None, rates[1], None], 1e-9), (rates, 1e-8)):
        own, other = (one.push(inputs, results, given) for one in (solver, plain))
        for a, b in zip(own, other, strict=True):
            assert a == pytest.approx(b, rel=near, abs=near * np.nanmax(np.abs(b)), nan_ok=True)


CHAINS: dict[str, Any] = {"stacked": ROBOTS["stacked"], "on_an_arm": ROUTED["on_an_arm"], "lumped": ROUTED["lumped"]}
CHAINS |= {name: ROUTED[name] for name in ("lumped_winding", "lumped_coils")}


@pytest.mark.study
@pytest.mark.parametrize("name", CHAINS)
def test_compiled_rates_are_differences(name: str) -> None:
    """Along a change of motor joints, actuators and force at once; reverse mode is the transpose."""
    model = CHAINS[name]()
    compiled, random = sr.compile(model, backend="python"), np.random.default_rng(7)
    q = model.relaxed_motors + 0.01 * np.maximum(np.abs(model.relaxed_motors), 1e-2)
    rates, force, push = 1e-3 * random.normal(size=q.size), random.normal(size=3), random.normal(size=3)

    def solved(step: float) -> np.ndarray:
        found = compiled.equilibria(q + step * rates, force + step * push, gravity=sr.EARTH_GRAVITY)
        assert found.certified.all()
        return np.concatenate([found.q_springs[0], found.tip_positions[0]])

    responses = ChainResponses(compiled, weight=True)
    springs = solved(0.0)[None, :-3]
    at = responses.at(q[None], force[None], springs, np.array(sr.EARTH_GRAVITY))
    pushed = np.concatenate(responses.push(at, rates[None], push[None], 1), axis=1)[0]
    step = 1e-2  # differences of fourth order; results are in balance to 1e-12 of the load
    slope = np.array([1.0, -8.0, 8.0, -1.0]) @ [solved(n * step) for n in (-2, -1, 1, 2)] / (12.0 * step)
    assert pushed == pytest.approx(slope, abs=1e-8 * (1.0 + np.abs(slope).max()))
    weights = random.normal(size=pushed.size)
    pulled = responses.pull(at, weights[None, :-3], weights[None, -3:], 1)
    assert pulled.motors[0] @ rates + pulled.force[0] @ push == pytest.approx(float(weights @ pushed), rel=1e-9)


STRAIGHT: dict[str, Any] = {"segment_lengths": (0.3, 0.25), "elastic_sections": 2}
ARM = ("segment_lengths[1]", "linear_density", "bending_stiffness", "torsional_stiffness", "axial_stiffness", "offset")
RANDOM: dict[str, tuple[Any, tuple[str, ...]]] = {
    "three lengths": (sr.PccArm(**STRAIGHT), (*ARM, "muscle_distance", "muscle_azimuth_deviation", "motor[4].offset")),
    "four lengths": (
        sr.PccArm(**STRAIGHT, muscle_azimuths=(0.0, 1.4, 3.0, 4.8), rest_bend_x=0.1),
        (*ARM, "muscle_distance", "rest_bend_x"),
    ),
    "braided": (
        sr.PccArm(**STRAIGHT, kind="mckibben"),
        (*ARM[:1], "segment[2].linear_density", *ARM[2:], "muscle_distance", "muscle_diameter", "muscle_braid_angle"),
    ),
    "lumped": (
        sr.PccArm(segment_lengths=(0.3,), chain="lumped", hinges=3, kind="elastic", rest_twist=0.3),
        (*ARM[:-1], "muscle_distance", "muscle_stiffness", "muscle_pretension", "rest_twist"),
    ),
    "tendons": (
        sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=2, tendon_azimuth_deviation=0.05),
        ("segment_lengths[1]", "tendon_distance", "tendon_stiffness", "tendon_pretension", "young_modulus", "linear_density"),
    ),
    "winding lengths": (
        sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=2, kind="length"),
        ("segment_lengths[1]", "tendon_distance", "young_modulus", "linear_density"),
    ),
    "helix": (
        sr.HelixTube(length=0.3, elastic_sections=3),
        ("length", "diameter", "contraction", "angle", "density", "wall_thickness", "young_modulus"),
    ),
}
"""A robot, and parameters that move masses, springs, joints, maps of sections, routes and laws of actuators."""


@pytest.mark.study
@pytest.mark.shortened(14, 280)
def test_rates_by_parameters_are_differences_of_solved_robots(cases: int) -> None:
    """Along random changes of actuators, force and all parameters at once; the transposed gradient is the same number.

    Where a tendon comes off slack there is a kink and no slope: one of the 280 cases.
    """
    random, step = np.random.default_rng(31), 1.5e-4  # of differences of fourth order of changes of a fiftieth
    kinks = 0
    for robot, names in RANDOM.values():
        model = sr.load_model(robot)
        solver = Differentiable("equilibrium", sr.compile(model, backend="python"), names, **OPTIONS)
        for _ in range(cases // len(RANDOM)):
            basis = model.actuators.basis
            drawn = [0.05 * basis @ random.normal(size=basis.shape[1]) for _ in range(2)]
            motors = np.maximum(model.relaxed_motors + drawn[0], model.motor_limits @ (0.98, 0.02))  # pressures push
            inputs = [motors, 0.2 * random.normal(size=3), solver.present]
            sizes = np.where(solver.present == 0.0, 0.1, solver.present)
            rates = [0.2 * drawn[1], 0.2 * random.normal(size=3), 0.02 * random.normal(size=sizes.size) * sizes]
            results = solver.solve(*inputs)
            pushed = np.concatenate(solver.push(inputs, results, rates))
            ends = [
                balanced(solver, [a + n * step * b for a, b in zip(inputs, rates, strict=True)], results[0])
                for n in (-2, -1, 1, 2)
            ]
            taut = np.array([one.muscle_forces > 0.0 for one in ends])
            if np.any(taut != taut[0]):
                kinks += 1
                continue
            there = [np.concatenate([one.q_springs, one.tip_position]) for one in ends]
            slope = np.array([1.0, -8.0, 8.0, -1.0]) @ there / (12.0 * step)
            assert pushed == pytest.approx(slope, abs=1e-8 * (1.0 + np.abs(slope).max())), robot
            weights = [random.normal(size=part.shape) for part in results]
            pulled = solver.pull(inputs, results, weights, [(), (), ()])
            back = sum(float((np.asarray(a) * b).sum()) for a, b in zip(pulled, rates, strict=True))
            assert back == pytest.approx(float(np.concatenate(weights) @ pushed), rel=1e-9, abs=1e-9 * np.abs(pushed).max())
    assert kinks <= 2


@pytest.mark.parametrize(
    "name", [one if one == "lumped_coils" else pytest.param(one, marks=pytest.mark.study) for one in CHAINS]
)
def test_loads_on_actuators_and_what_a_force_changes_of_them(name: str) -> None:
    """Those of `solve_equilibrium`, and differences of them; joint motors are among the actuators, too."""
    model, random = CHAINS[name](), np.random.default_rng(7)
    q = model.relaxed_motors + 0.01 * np.maximum(np.abs(model.relaxed_motors), 1e-2)
    force, step = random.normal(size=3), 1e-3
    responses = ChainResponses(sr.compile(model, backend="python"), weight=True)

    def balanced(force: np.ndarray) -> sr.Equilibrium:
        return sr.solve_equilibrium(model, q, force, gravity=sr.EARTH_GRAVITY, tolerance=1e-13)

    here = balanced(force)
    loads, slope = responses.feel(responses.at(q[None], force[None], here.q_springs[None], np.array(sr.EARTH_GRAVITY)), 1)
    assert loads[0] == pytest.approx(here.motor_torques, abs=1e-9 * (1.0 + np.abs(here.motor_torques).max()))
    ends = [[balanced(force + n * step * axis).motor_torques for n in (-2, -1, 1, 2)] for axis in np.eye(3)]
    differences = np.array([1.0, -8.0, 8.0, -1.0]) @ np.array(ends) / (12.0 * step)  # loads are balanced to 1e-13
    assert pytest.approx(differences, abs=1e-8 * (1.0 + np.abs(differences).max())) == slope[0].T


@pytest.mark.study
@pytest.mark.parametrize("kind", ["given lengths", "tendons", "winding lengths"])
def test_compiled_load_estimates_are_those_of_pinocchio(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """By least squares of six tensions, with derivatives in both modes; noise of a thousandth stays unexplained.

    A row that is no number changes no other, and cases that the search side by side leaves are found one by one.
    """
    case, random = CASES[kind](), np.random.default_rng(1)
    model, options = sr.load_model(case.robot), OPTIONS | {"failed": "nan"}
    compiled = sr.compile(model, backend="python")
    solver, plain = (Differentiable("estimate", one, case.names, **options) for one in (compiled, case.robot))
    motors = np.array(case.motors) + 0.02 * random.normal(size=(2, 6)) @ model.actuators.basis.T
    true = motors + solver._set.motor_offsets(solver.present)
    forces = np.array(case.force) * random.uniform(0.5, 1.0, (2, 1))
    cases = zip(true, forces, strict=True)
    felt = np.array([sr.solve_equilibrium(model, *one, gravity=sr.EARTH_GRAVITY).motor_torques for one in cases])
    felt += 1e-3 * np.abs(felt).mean() * random.normal(size=felt.shape)
    results = solver.solve(np.concatenate([motors, motors[:1]]), np.concatenate([felt, np.nan * felt[:1]]), solver.present)
    assert np.isnan(results[2][2]).all()
    monkeypatch.setattr(force_batches, "_STEPS", 2)
    alone = solver.solve(motors[:1], felt[:1], solver.present)
    expected = plain.solve(motors, felt, plain.present)
    for own, other, one in zip(results, expected, alone, strict=True):  # least squares converge linearly, to 1e-10 of the loads
        assert own[:2] == pytest.approx(other, abs=1e-7 * np.abs(other).max())
        assert one == pytest.approx(other[:1], abs=1e-7 * np.abs(other).max())
    change, inputs = changes(case, solver), [motors, felt, solver.present]
    rates, weights = [change[0], felt[::-1], change[2]], [random.normal(size=one.shape) for one in expected]
    pairs = [
        (one.push(inputs, expected, rates), one.pull(inputs, expected, weights, [(2,), (2,), ()])) for one in (solver, plain)
    ]
    for own, other in zip(*((*pushed, *pulled) for pushed, pulled in pairs), strict=True):
        assert own == pytest.approx(other, abs=1e-7 * np.abs(other).max())  # what is left of the loads is the noise to 1e-7
    (pushed, pulled), _ = pairs
    back = sum(float((np.asarray(a) * b).sum()) for a, b in zip(pulled, rates, strict=True))
    assert back == pytest.approx(sum(float((a * b).sum()) for a, b in zip(weights, pushed, strict=True)), rel=1e-9)
