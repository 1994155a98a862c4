"""Laws of moving a loaded robot: loads back from motors, motors back from targets, paths, workspaces; compiled too."""

from __future__ import annotations

import ast
import math
from functools import cache

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import softrobots as sr
from softrobots.compiled.run.compiled_model import CompiledModel
from tests.support.law_robots import PUSHES, Case, cases, model, triples
from tests.support.laws import law

# --- Loads


@law("estimate_load")
@pytest.mark.parametrize("kind", ["arm", "three_links", "pcc", "pcc_lumped", "mounted", "foreign"])
@given(case=cases(0.2))
@settings(max_examples=5)
def test_a_force_comes_back_from_what_the_motors_feel(kind: str, case: Case) -> None:
    """Where they feel every direction of it; where they do not, the answer says so, by the elastostatic Jacobian."""
    robot, force = model(kind), case.force(kind)
    motors = case.motors(robot)
    true = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity, tolerance=1e-12)
    felt = np.linalg.svd(sr.elastostatic_jacobian(robot, true), compute_uv=False)
    try:
        found = sr.estimate_load(robot, motors, true.motor_torques, gravity=case.gravity)
    except sr.LoadNotFound:
        assert felt[-1] < 0.05 * robot.reach
        return
    values = np.linalg.svd(sr.elastostatic_jacobian(robot, found.equilibrium), compute_uv=False)
    assert np.allclose(found.singular_values[: len(values)], values, rtol=1e-6, atol=1e-9 * robot.reach)
    assert len(found.unobservable_directions) == 3 - np.count_nonzero(found.singular_values >= 1e-3 * robot.reach)
    assert np.allclose(
        found.unobservable_directions @ found.unobservable_directions.T, np.eye(len(found.unobservable_directions))
    )
    if min(felt[-1], values[-1]) > 0.05 * robot.reach and len(felt) == 3:
        assert (
            np.abs(found.force - force).max()
            < 1e-7 * (np.linalg.norm(force) + np.linalg.norm(true.motor_torques) + 1e-3) / felt[-1]
        )
        assert found.residual < 1e-7 * (1.0 + np.linalg.norm(true.motor_torques))


@law("distributed_force")
@pytest.mark.parametrize("kind", ["pcc", "pulled", "pcc_lumped", "helix", "helix_lumped", "mounted"])
@given(one=triples, other=triples, factor=st.floats(-1e6, 1e6))
@settings(max_examples=5)
def test_a_distributed_force_is_linear_and_all_of_it(kind: str, one: tuple, other: tuple, factor: float) -> None:
    """Sums of forces are sums of wrenches; in all it is the force times the length that can move; without moments."""
    robot, a, b = model(kind), np.array(one), np.array(other)
    made, second, both = (sr.distributed_force(robot, force) for force in (a, b, factor * a + b))
    assert made.keys() == second.keys() == both.keys()
    for name, wrench in both.items():
        assert np.allclose(wrench, factor * made[name] + second[name], rtol=1e-12, atol=1e-12)
        assert not wrench[3:].any()
    lengths = [section.length for section in robot.structure.section_table]
    moving = sum(lengths) if "lumped" in kind else sum(lengths) - 0.5 * lengths[0]
    assert np.allclose(sum(made.values())[:3], moving * a, rtol=1e-12, atol=1e-15)
    found = sr.solve_equilibrium(robot, robot.relaxed_motors, wrench={name: 0.1 * wrench for name, wrench in made.items()})
    assert found.conservative


# --- Targets


@law("solve_ik")
@pytest.mark.parametrize("kind", ["arm", "limp", "three_links", "pcc", "pcc_lumped", "mounted"])
@given(case=cases(0.1), offset=st.integers(0, 2**32 - 1))
@settings(max_examples=4)
def test_motors_come_back_from_the_tip_that_they_made(kind: str, case: Case, offset: int) -> None:
    """Sought from motors nearby: the tip arrives, and no motor has moved more than needed; from there, none moves at all."""
    robot, force = model(kind), case.force(kind)
    low, high = robot.motor_limits.T
    motors = np.clip(case.motors(robot), low, high)
    made = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity)
    begin = np.clip(motors + 0.02 * robot.motor_scale * np.random.default_rng(offset).normal(size=len(motors)), low, high)
    options = {"gravity": case.gravity, "starts": 2}
    found = sr.solve_ik(robot, made.tip_position, force, q_motors0=begin, **options)
    again = sr.solve_equilibrium(robot, found.q_motors, force, gravity=case.gravity)
    assert found.error < 1e-9 * max(robot.reach, 1.0)
    assert np.abs(again.tip_position - made.tip_position).max() < 2e-9 * max(robot.reach, 1.0)
    change, needed = (np.linalg.norm((each - begin) / robot.motor_scale) for each in (found.q_motors, motors))
    assert change < needed * (1.0 + 1e-3) + 1e-6
    still = sr.solve_ik(robot, made.tip_position, force, q_motors0=motors, **options)
    assert np.abs((still.q_motors - motors) / robot.motor_scale).max() < 1e-9


@law("solve_ik", "solve_equilibrium")
@given(case=cases(0.1, st.just(sr.EARTH_GRAVITY)), turn=st.floats(-1.0, 1.0))
@settings(max_examples=4)
def test_a_target_that_turns_about_the_first_motor_turns_that_motor(case: Case, turn: float) -> None:
    robot, force = model("arm"), case.force("arm")
    motors = case.motors(robot)
    rotation = np.array([[math.cos(turn), -math.sin(turn), 0.0], [math.sin(turn), math.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    tip = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity).tip_position
    begin = motors + 0.01
    options = {"gravity": case.gravity, "starts": 1}
    one = sr.solve_ik(robot, tip, force, q_motors0=begin, **options)
    other = sr.solve_ik(robot, rotation @ tip, rotation @ force, q_motors0=begin + [turn, 0.0, 0.0], **options)
    values = np.linalg.svd(sr.elastostatic_jacobian(robot, one.equilibrium), compute_uv=False)
    assume(values[-1] > 0.05)
    assert np.abs(other.q_motors - one.q_motors - [turn, 0.0, 0.0]).max() < 1e-7


@law("follow_trajectory")
@pytest.mark.parametrize("kind", ["arm", "pcc", "mounted"])
@given(case=cases(0.1), offset=st.integers(0, 2**32 - 1))
@settings(max_examples=3)
def test_motors_come_back_from_the_path_that_they_made(kind: str, case: Case, offset: int) -> None:
    """Waypoints of tips that were made by motors: reached, each an equilibrium of its own, and by the same motors if three."""
    robot, force = model(kind), case.force(kind)
    low, high = robot.motor_limits.T
    way = 0.1 * robot.motor_scale * np.random.default_rng(offset).uniform(-1.0, 1.0, robot.n_motors)
    motors = np.array([np.clip(case.motors(robot) + share * way, low, high) for share in np.linspace(0.0, 1.0, 4)])
    made = [sr.solve_equilibrium(robot, held, force, gravity=case.gravity) for held in motors]
    if robot.n_motors == 3:
        values = [np.linalg.svd(sr.elastostatic_jacobian(robot, each), compute_uv=False) for each in made]
        assume(np.min(values) > 0.05 * robot.reach)
    targets = np.array([each.tip_position for each in made])
    options = {"gravity": case.gravity, "times": np.arange(4.0)}
    found = sr.follow_trajectory(robot, targets, force, q_motors0=motors[0], **options)
    assert found.tip_error.max() < 1e-9 * max(robot.reach, 1.0)
    assert np.array_equal(found.times, options["times"])
    for row, held in enumerate(found.q_motors):
        alone = sr.solve_equilibrium(robot, held, force, gravity=case.gravity, q_springs0=found.q_springs[row])
        assert np.abs(alone.tip_position - targets[row]).max() < 2e-9 * max(robot.reach, 1.0)
    if robot.n_motors == 3:
        assert np.abs(found.q_motors - motors).max() < 1e-7
        back = sr.follow_trajectory(robot, targets[::-1], force, q_motors0=motors[-1], **options)
        assert np.abs(back.q_motors[::-1] - motors).max() < 1e-7


@law("sample_workspace")
@pytest.mark.parametrize("kind", ["arm", "limp", "pcc", "pcc_lumped", "mounted"])
@given(case=cases(0.1), seed=st.integers(0, 2**32 - 1), count=st.integers(2, 5))
@settings(max_examples=3)
def test_samples_are_equilibria_and_more_of_them_begin_with_the_same(kind: str, case: Case, seed: int, count: int) -> None:
    """Manipulability is the root of `det J J^T` of the elastostatic Jacobian, of freedoms that keep muscles consistent."""
    robot, force = model(kind), case.force(kind)
    options = {"force": force, "gravity": case.gravity, "seed": seed}
    found, more = (sr.sample_workspace(robot, samples, **options) for samples in (count, count + 3))
    assert len(found.q_motors) + found.refused == count
    assert np.array_equal(more.q_motors[: len(found.q_motors)], found.q_motors)
    for motors, springs, tip, measure in zip(
        found.q_motors, found.q_springs, found.tip_positions, found.manipulability, strict=True
    ):
        alone = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity)
        assert alone.stable
        assert np.allclose(alone.q_springs, springs, rtol=0.0, atol=1e-12)
        assert np.allclose(alone.tip_position, tip, rtol=0.0, atol=1e-12)
        slope = sr.elastostatic_jacobian(robot, alone) @ robot.actuators.basis
        # the root of a determinant near zero keeps half the digits
        assert measure == pytest.approx(math.sqrt(max(np.linalg.det(slope @ slope.T), 0.0)), rel=1e-6, abs=1e-7)
    assert (found.q_motors >= robot.motor_limits[:, 0] - 1e-12).all()
    assert (found.q_motors <= robot.motor_limits[:, 1] + 1e-12).all()


# --- Compiled


COMPILED = ("arm", "pcc", "pulled", "pcc_lumped", "helix", "mounted")
WEIGHT = {"arm": (1.0, 2.0, -9.0), "helix": sr.EARTH_GRAVITY}
"""Gravity of robots whose code is made with weight [m/s^2]."""


@cache
def solver(kind: str) -> CompiledModel:
    return sr.compile(model(kind), backend="python")


@pytest.mark.study
@law("compile", "CompiledModel.equilibrium", "CompiledModel.equilibria")
@pytest.mark.parametrize("kind", COMPILED)
@given(several=st.lists(cases(0.5, st.just(None)), min_size=2, max_size=2))
@settings(max_examples=3)
def test_compiled_equilibria_are_those_of_the_model(kind: str, several: list[Case]) -> None:
    weight = WEIGHT.get(kind)
    robot, compiled = model(kind), solver(kind)
    motors = np.array([case.motors(robot) for case in several])
    forces = np.array([case.force(kind) for case in several])
    batch = compiled.equilibria(motors, forces, gravity=weight)
    for row, (held, force) in enumerate(zip(motors, forces, strict=True)):
        expected = sr.solve_equilibrium(robot, held, force, gravity=weight)
        assume(expected.stable)
        found = compiled.equilibrium(held, force, gravity=weight)
        off = 1e-9 + 10.0 * (expected.residual + found.residual) / expected.eigenvalues[0]
        assert np.abs(found.q_springs - expected.q_springs).max() < off
        assert np.abs(found.tip_position - expected.tip_position).max() < 10.0 * off * robot.reach
        assert np.allclose(batch.q_springs[row], found.q_springs, rtol=0.0, atol=1e-11)  # sums may be contracted differently
        assert np.allclose(batch.tip_positions[row], found.tip_position, rtol=0.0, atol=1e-11)


@law("CompiledModel.estimate_load", "CompiledModel.estimate_loads", "CompiledModel.inverse_kinematics", "CompiledModel.follow")
@pytest.mark.parametrize("kind", ["arm", "pcc"])
@given(case=cases(0.1, st.just(None)), way=triples)
@settings(max_examples=4)
def test_compiled_searches_undo_compiled_equilibria(kind: str, case: Case, way: tuple) -> None:
    robot, compiled, force = model(kind), solver(kind), case.force(kind)
    motors = case.motors(robot)
    made = sr.solve_equilibrium(robot, motors, force, tolerance=1e-12)
    assume(np.linalg.svd(sr.elastostatic_jacobian(robot, made), compute_uv=False)[-1] > 0.1 * robot.reach)
    alone = compiled.estimate_load(motors, made.motor_torques)
    batch = compiled.estimate_loads(motors[None], made.motor_torques[None])
    assert np.abs(alone.force - force).max() < 1e-6 * PUSHES[kind]
    assert np.allclose(batch.forces[0], alone.force, rtol=0.0, atol=1e-8 * PUSHES[kind])
    assert batch.certified.all()
    line = made.tip_position + np.linspace(0.0, 0.01, 3)[:, None] * robot.reach * np.array(way)
    near = compiled.inverse_kinematics(line, force, q_motors0=motors)
    path = compiled.follow(line, force, q_motors0=motors)
    for answer in (near, path):
        assert answer.certified.all()
        assert answer.tip_error.max() < 1e-9
        for target, held in zip(line, answer.q_motors, strict=True):
            assert np.abs(sr.solve_equilibrium(robot, held, force).tip_position - target).max() < 1e-8


@cache
def plain_c_source() -> str:
    return solver("arm").c_source(prefix="softrobots")


@law("CompiledModel.source", "CompiledModel.c_source")
@given(prefix=st.from_regex(r"\A[A-Za-z][A-Za-z0-9]{9}\Z"))
@settings(max_examples=2)
def test_source_is_python_and_every_name_of_the_c_begins_with_the_prefix(prefix: str) -> None:
    """The same robot gives the same text; another prefix (as long, so that lines break alike) changes nothing else."""
    compiled = solver("arm")
    text = compiled.source()
    assert text == sr.compile(model("arm"), backend="python").source()
    functions = [node.name for node in ast.parse(text).body if isinstance(node, ast.FunctionDef)]
    assert "settle" in functions
    assert repr(float(model("arm").stiffness[0])) in text
    made = compiled.c_source(prefix=prefix)
    assert f"{prefix}_settle(" in made
    assert made.replace(f"{prefix}_", "softrobots_").replace(f"{prefix.upper()}_", "SOFTROBOTS_") == plain_c_source()
