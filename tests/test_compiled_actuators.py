"""Compiled statics of actuators of any kind on any route: against Pinocchio's path, curves by quadrature, and differences."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import softrobots as sr
from softrobots.compiled import Status
from softrobots.compiled.run.compiled_model import CompiledModel
from softrobots.compiled.run.looped_search import LoopedSearch
from tests.support.c_libraries import Controller
from tests.support.oracles import central_difference
from tests.support.routed_arms import actuator, curve_length, routed
from tests.support.routed_robots import ROBOTS
from tests.support.screw_motions import screw_matrix
from tests.support.serial_chains import ARM, LAWS, LENGTHS, LUMPED, ROUTES

GRAVITY = np.array([0.4, -1.0, -9.7])  # [m/s^2]


@cache
def robot(name: str) -> sr.SoftModel:
    return ROBOTS[name]()


@cache
def solver(name: str) -> CompiledModel:
    return sr.compile(robot(name), backend="python")


def searching(name: str, *, gravity: bool = False) -> LoopedSearch:
    return solver(name)._search(solver(name)._run(gravity))


def inputs(model: sr.SoftModel, rng: np.random.Generator) -> np.ndarray:
    """Motor joints up to a radian; lengths that differ by up to 3 %, so that tendons are slack; pressures and tensions."""
    largest = {"mckibben": 1e5, "pressure": 1e5, "tension": 20.0}
    motors = rng.uniform(-1.0, 1.0, model.n_motors)
    for place, tag in enumerate(model.muscles, start=model.n_motors - len(model.muscles)):
        pulled = tag.rest_length * rng.uniform(0.97, 1.03)
        motors[place] = rng.uniform(0.0, largest[tag.kind]) if tag.kind in largest else pulled
    return motors


def push(model: sr.SoftModel, rng: np.random.Generator) -> np.ndarray:
    """A force that bends a spring in the middle of the robot by a fifth of a radian or so."""
    return rng.normal(size=3) * 0.2 * float(np.median(model.stiffness[model.springs.turning])) / model.reach


@pytest.mark.study
@pytest.mark.parametrize(("name", "gravity"), zip(ROBOTS, (GRAVITY, None) * len(ROBOTS), strict=False))
def test_equilibria_are_those_of_the_general_engine(name: str, gravity: Any, rng: np.random.Generator) -> None:
    """One by one and as a batch, heavy or weightless in turn; all settle to 1e-12 of the load."""
    model = robot(name)
    motors = np.array([inputs(model, rng) for _ in range(4)])
    forces = np.array([push(model, rng) for _ in motors])
    batch = solver(name).equilibria(motors, forces, gravity=gravity)
    assert batch.certified.all()
    slack = 0
    for q, force, springs in zip(motors, forces, batch.q_springs, strict=True):
        here = solver(name).equilibrium(q, force, gravity=gravity)
        there = sr.solve_equilibrium(model, q, force, gravity=gravity, q_springs0=here.q_springs)
        assert there.stable
        assert np.array_equal(here.q_motors, q)
        assert np.abs(here.q_springs - there.q_springs).max() < 1e-9
        assert np.abs(here.tip_position - there.transform_tip_to_world.translation).max() < 1e-9 * model.reach
        assert np.abs(springs - here.q_springs).max() < 1e-9
        slack += int(np.sum(there.muscle_forces == 0.0))
    assert slack > 0 or name not in ("tendons", "lumped", "on_an_arm")


def slope(function: Callable[[np.ndarray], Any], z: np.ndarray) -> np.ndarray:
    """Derivatives by complex steps, exact to rounding; the last axis is that of `z`."""
    steps = 1e-20j * np.eye(z.size)
    return np.stack([np.imag(function(z + step.reshape(z.shape))) / 1e-20 for step in steps], axis=-1)


def test_balance_of_curves_in_a_rod(rng: np.random.Generator) -> None:
    """Springs, force and tensions by the laws of the kinds balance, with lengths by quadrature and SciPy's exponentials."""
    model = robot("winding")
    sections = [(number, length) for number, length in enumerate(LENGTHS, start=1)]
    handle = model.chain().tip_translation

    def tip(z: np.ndarray) -> Any:
        return (screw_matrix(z[0], LENGTHS[0]) @ screw_matrix(z[1], LENGTHS[1]) @ [*handle, 1.0])[:3]

    for _ in range(3):
        motors, force = inputs(model, rng), push(model, rng)
        found = solver("winding").equilibrium(motors, force)
        z = found.q_springs.reshape(2, 4)
        torques = model.stiffness * (found.q_springs - model.rest) - force @ slope(tip, z)
        for (kind, law), u in zip(LAWS.items(), motors, strict=True):
            length = curve_length(ROUTES[kind], sections, z)
            rest = curve_length(ROUTES[kind], sections, np.zeros((2, 4)))
            tension = u
            if kind == "elastic":
                tension = max(0.0, law["pretension"] + law["stiffness"] * (length - u))
            elif kind == "pressure":
                tension = -u * law["area"]
            elif kind == "mckibben":
                a, b = 3.0 / math.tan(law["braid_angle"]) ** 2, 1.0 / math.sin(law["braid_angle"]) ** 2
                tension = max(0.0, u * math.pi * law["diameter"] ** 2 / 4.0 * (a * (length / rest) ** 2 - b))
            torques += tension * slope(lambda z, kind=kind: curve_length(ROUTES[kind], sections, z), z)
        assert np.abs(torques).max() < 1e-9  # of springs of 4 N m/rad and tensions of 30 N


MORE = ("winding", "winding_lengths", "on_an_arm", "lumped_winding")


@pytest.mark.parametrize("name", ["tendons", "lumped_coils", *(pytest.param(name, marks=pytest.mark.study) for name in MORE)])
def test_what_actuators_do_and_feel(name: str, rng: np.random.Generator) -> None:
    """The Jacobian and loads are those of Pinocchio's path; loads change by a force as differences say."""
    model, search = robot(name), searching(name, gravity=True)
    motors, force = inputs(model, rng), push(model, rng)
    status, state = search.settle(motors, force, GRAVITY, model.rest)
    assert status == Status.CERTIFIED
    there = sr.solve_equilibrium(model, motors, force, gravity=GRAVITY, q_springs0=state.q_springs)
    expected = sr.elastostatic_jacobian(model, there)
    assert np.abs(search.jacobian(state.w) - expected).max() <= 1e-9 * np.abs(expected).max()
    loads = search.actuation.loads(search.run, state.w)
    assert np.abs(loads - there.motor_torques).max() <= 1e-9 * np.abs(there.motor_torques).max()
    feeling = search.actuation.feeling(search.run, state.w)

    def felt(change: np.ndarray) -> np.ndarray:
        _, moved = search.settle(motors, force + change, GRAVITY, state.q_springs)
        search.run.look_at_tip(moved.w)
        return search.actuation.loads(search.run, moved.w)

    size = 1e-5 * float(np.linalg.norm(force))
    assert np.abs(central_difference(felt, np.zeros(3), size) - feeling).max() <= 1e-5 * np.abs(feeling).max()
    if name in ("tendons", "winding_lengths", "lumped_coils"):  # the tension is the slope of the energy by the input
        assert np.abs(feeling - search.jacobian(state.w).T).max() <= 1e-9 * np.abs(feeling).max()


def test_the_tip_follows_a_path_that_tendons_pull(rng: np.random.Generator) -> None:
    """Waypoints are those of motors that go on evenly; each is reached to 1e-9 m, with a tension of every tendon."""
    model = robot("tendons")
    start, end = model.relaxed_motors, model.relaxed_motors + rng.uniform(-1e-3, 0.0, model.n_motors)
    targets = [
        sr.solve_equilibrium(model, start + share * (end - start)).transform_tip_to_world.translation for share in (0, 0.5, 1)
    ]
    path = solver("tendons").follow(np.array(targets), q_motors0=start)
    assert path.certified.all()
    reached = [sr.solve_equilibrium(model, q).transform_tip_to_world.translation for q in path.q_motors]
    assert np.abs(np.array(reached) - targets).max() < 1e-9


def test_inputs_that_no_actuator_takes(rng: np.random.Generator) -> None:
    """Raised for a single case, a status in a batch: a motor length of zero, a negative pressure of a braided muscle."""
    model = robot("winding")
    for place, bad, words in ((0, 0.0, "positive lengths"), (1, -1.0, "pressures of McKibben")):
        motors = np.array([inputs(model, rng)] * 2)
        motors[1, place] = bad
        with pytest.raises(sr.ParameterError, match=words):
            solver("winding").equilibrium(motors[1], np.zeros(3))
        assert solver("winding").equilibria(motors, np.zeros(3)).status.tolist() == [Status.CERTIFIED, Status.NOT_A_NUMBER]


@pytest.mark.parametrize("kind", ["tension", "elastic"])
def test_redundant_tendons_get_the_least_tension(kind: str, rng: np.random.Generator) -> None:
    """Six tendons for three conditions: the inputs of `solve_ik`, which pull less than those that the target comes from."""
    model = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=1, kind=kind))
    pulled = model.relaxed_motors + (rng.uniform(0.0, 4.0, 6) if kind == "tension" else rng.uniform(-3e-3, -1e-3, 6))
    target = sr.solve_equilibrium(model, pulled).tip_position
    found = sr.compile(model, backend="python").inverse_kinematics(target[None], np.zeros((1, 3)))
    assert found.certified.all()
    np.testing.assert_allclose(found.q_motors[0], sr.solve_ik(model, target).q_motors, rtol=0, atol=1e-6)
    rest = sr.solve_equilibrium(model, pulled).muscle_forces - model.actuators.wanted_tensions
    reached = sr.solve_equilibrium(model, found.q_motors[0])
    np.testing.assert_allclose(reached.tip_position, target, rtol=0, atol=1e-9 * model.reach)
    least = reached.muscle_forces - model.actuators.wanted_tensions
    assert np.linalg.norm(least) < np.linalg.norm(rest)  # what they had before reaches the target, too


def test_joints_of_a_section_that_are_apart_are_refused_by_name() -> None:
    coiled = actuator("coil", (1, (0.0, 0.5), (0.04, 0.04), (0.0, 1.0)), kind="tension")
    urdf = sr.PccArm(segment_lengths=LENGTHS, chain="lumped", hinges=1, muscle_azimuths=()).urdf()
    before, behind = urdf.split('<joint name="section_1_1_bend_y"')
    apart = before + '<joint name="section_1_1_bend_y"' + behind.replace('xyz="0.0 0.0 0.0"', 'xyz="0.0 0.0 0.01"', 1)
    with pytest.raises(sr.DescriptionError, match="section section_1_1, whose joints are apart"):
        sr.compile(sr.load_model(apart.replace("</robot>", coiled + "</robot>")), backend="python")


def straight(azimuth: float, name: str) -> str:
    return actuator(name, (1, (0.0, 0.5), (0.04, 0.04), (azimuth, azimuth)), kind="length")


ANY_LENGTHS: dict[str, Callable[[], sr.SoftModel]] = {
    "four_from_the_base": lambda: sr.load_model(sr.PccArm(**ARM, routing="base", muscle_azimuths=(0.0, 1.5, 3.0, 4.5))),
    "without_stretch": lambda: sr.load_model(sr.PccArm(**LUMPED, hinges=2, extension=False)),
    "two": lambda: routed(straight(0.0, "one"), straight(1.5, "other"), segment_lengths=(0.5,), elastic_sections=2),
    "two_alike": lambda: routed(straight(0.0, "one"), straight(0.0, "other"), segment_lengths=(0.5,), elastic_sections=2),
}
"""More lengths than a segment has directions to choose, and fewer."""


@pytest.mark.study
@pytest.mark.parametrize("name", ANY_LENGTHS)
def test_any_number_of_given_lengths(name: str, rng: np.random.Generator) -> None:
    """Of a random shape without twist: springs, tensions, the Jacobian and steps of time are those of the general engine."""
    model = ANY_LENGTHS[name]()
    compiled, chain = sr.compile(model, backend="python"), model.chain()
    bent = 0.01 * rng.normal(size=chain.rest.size) * np.any(chain.muscle_paths.matrix, axis=0)
    motors = model.relaxed_motors + chain.muscle_paths.matrix @ bent
    force = 0.1 * rng.normal(size=3)
    there = sr.solve_equilibrium(model, motors, force, gravity=GRAVITY)
    here = compiled.equilibrium(motors, force, gravity=GRAVITY)
    np.testing.assert_allclose(here.q_springs, there.q_springs, rtol=0, atol=1e-9)
    run = compiled._run(True)
    status, state = compiled._search(run).settle(motors, force, GRAVITY, model.rest)
    assert status == Status.CERTIFIED
    run.look_at_tip(state.w)
    loads, expected = compiled._actuation.loads(run, state.w), there.motor_torques
    np.testing.assert_allclose(loads, expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    expected = sr.elastostatic_jacobian(model, there)
    np.testing.assert_allclose(compiled._actuation.jacobian(run, state.w), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    given = {"gravity": GRAVITY, "time_step": 1e-3}
    moved, expected = compiled.simulate(4e-3, motors, **given), sr.simulate(model, 4e-3, motors, **given).tip_position
    np.testing.assert_allclose(moved.tip_position, expected, rtol=0, atol=1e-9)


@pytest.mark.study
@pytest.mark.parametrize("name", ["winding_lengths", "lumped_coils"])
def test_the_same_in_c(name: str, tmp_path: Path, rng: np.random.Generator) -> None:
    """Equilibria with weight, and the Jacobian from the response of the tip; sine and cosine differ from libm's by an ulp."""
    model, heavy = robot(name), solver(name)._run(True)
    in_c = Controller(solver(name), tmp_path, gravity=True, name=name)
    for _ in range(10):
        motors, force = inputs(model, rng), push(model, rng)
        in_c.clear()
        in_c.put("FORCE", force)
        in_c.put("GRAVITY", GRAVITY)
        in_c.call("put_muscles", (ctypes.c_double * len(motors))(*motors))
        assert in_c.call("settle") == Status.CERTIFIED
        expected = solver(name).equilibrium(motors, force, gravity=GRAVITY)
        assert np.abs(in_c.get("TIP", 3) - expected.tip_position).max() < 1e-10 * model.reach
    in_c.call("look_at_tip")
    found = solver(name)._actuation.jacobian(heavy, list(in_c.w))
    settled = sr.solve_equilibrium(model, motors, force, gravity=GRAVITY, q_springs0=expected.q_springs)
    jacobian = sr.elastostatic_jacobian(model, settled)
    assert np.abs(found - jacobian).max() <= 1e-9 * np.abs(jacobian).max()
