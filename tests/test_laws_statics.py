"""Laws of equilibria, on robots of every kind: least energy, and what turning, scaling, mirroring and cutting leave alone."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

import softrobots as sr
from tests.support.law_robots import ROBOTS, Case, cases, load_energy, model, scaled, shares, stored_energy, turned, turns
from tests.support.laws import law
from tests.support.oracles import flexible_jacobian

MIRROR = np.diag([1.0, -1.0, 1.0])
"""Mirror image in the x-z plane."""


def slack(*equilibria: sr.Equilibrium) -> float:
    """How far springs may be from where they belong: what is out of balance over the smallest stiffness, and rounding."""
    return 1e-9 + 10.0 * sum(found.residual / found.eigenvalues[0] for found in equilibria)


def energy(robot: sr.SoftModel, motors: np.ndarray, springs: np.ndarray, force: np.ndarray, gravity: Any) -> float:
    return stored_energy(robot, motors, springs) + load_energy(robot, motors, springs, force, gravity)


# --- Energy


@pytest.mark.study
@law("solve_equilibrium")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(10.0))
@example(case=Case([0.0] * 6, 1.3125, np.array([-1.0, 0.0, 0.0]), None))  # a straight arm that buckles: steps are halved
@example(case=Case([0.0] * 6, 3.0, np.array([np.sqrt(0.5), 0.0, np.sqrt(0.5)]), None))
@settings(max_examples=5)
def test_every_step_of_newton_lowers_the_energy(kind: str, case: Case) -> None:
    """Stopped after 1, 2, 3 ... evaluations, the best iterate never has more energy than the one before; rounding: 1e-13."""
    robot, force = model(kind), case.force(kind)
    motors = case.motors(robot)
    energies = [energy(robot, motors, np.array(robot.rest), force, case.gravity)]
    for budget in range(1, 201):
        try:
            best = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity, max_iterations=budget)
        except sr.EquilibriumNotFound as error:
            best = error.best
        energies.append(energy(robot, motors, best.q_springs, force, case.gravity))
        if best.converged and best.iterations < budget:
            break
    terms = abs(stored_energy(robot, motors, best.q_springs)) + np.linalg.norm(force) * robot.reach + 10.0
    assert np.diff(energies).max() < 1e-13 * terms


@law("solve_equilibrium")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(3.0), toward=st.integers(0, 2**32 - 1))
@settings(max_examples=6)
def test_an_equilibrium_is_where_the_energy_has_no_slope_and_a_stable_one_where_it_rises(
    kind: str, case: Case, toward: int
) -> None:
    """Along any way the springs can go; energies have 15 digits, so that a step of 1e-4 tells slopes to 1e-10 of them."""
    robot, force = model(kind), case.force(kind)
    motors = case.motors(robot)
    found = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity)
    way = np.random.default_rng(toward).normal(size=robot.n_springs) / np.sqrt(robot.stiffness)
    way *= 1e-4 / np.linalg.norm(way)
    here, ahead, behind = (
        energy(robot, motors, found.q_springs + step * way, force, case.gravity) for step in (0.0, 1.0, -1.0)
    )
    terms = stored_energy(robot, motors, found.q_springs) + np.linalg.norm(force) * robot.reach + 10.0
    curvature = way @ found.tangent_stiffness @ way
    assert abs(ahead - behind) / 2.0 < 1e-3 * abs(curvature) + 1e-14 * terms  # the third derivative; rounding
    if found.stable and not any(found.saturated):
        assert ahead + behind - 2.0 * here == pytest.approx(curvature, rel=1e-3, abs=1e-14 * terms)
        assert curvature > 0.0


@law("solve_equilibrium", "load_model")
@given(case=cases(3.0, st.none()), powers=st.lists(st.floats(-3.0, 6.0), min_size=4, max_size=4))
@settings(max_examples=25)
def test_springs_of_any_stiffness_carry_what_the_papers_jacobian_says(case: Case, powers: list[float]) -> None:
    """1e-3 to 1e6 N m/rad side by side, under a load for the softest: `k q_k = J_k^T f`, [Troise 2021] (4, 5), table 2."""
    stiffness = 10.0 ** np.array(powers)
    springs = dict(zip(model("arm").spring_joints, stiffness.tolist(), strict=True))
    robot = sr.load_model(model("arm").urdf, springs=springs)
    motors, force = case.motors(robot), case.size * stiffness.min() * case.direction
    found = sr.solve_equilibrium(robot, motors, force)
    order = [motors[0], motors[1], *found.q_springs[:2], motors[2], *found.q_springs[2:]]
    columns = flexible_jacobian(np.array(order))[:3, [2, 3, 5, 6]]
    balance = np.linalg.norm(stiffness * found.q_springs - columns.T @ force)
    assert balance <= 1e-10 * max(1.2 * np.linalg.norm(force), 1e-3) * (1.0 + 1e-3)
    start = energy(robot, motors, np.zeros(4), force, None)
    assert energy(robot, motors, found.q_springs, force, None) <= start + 1e-14 * (1.0 + np.linalg.norm(force))
    assert found.stable == (np.linalg.eigvalsh(found.tangent_stiffness / np.sqrt(np.outer(stiffness, stiffness)))[0] > 1e-9)


# --- What leaves an equilibrium alone


@law("solve_equilibrium")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(), rpy=turns)
@settings(max_examples=6)
def test_turning_base_load_and_gravity_turns_the_answer(kind: str, case: Case, rpy: tuple[float, float, float]) -> None:
    robot, force = model(kind), case.force(kind)
    table = turned(robot, rpy)
    turn, motors = pin.rpy.rpyToMatrix(*rpy), case.motors(robot)
    gravity = None if case.gravity is None else turn @ case.gravity
    one = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity, tolerance=1e-13)
    other = sr.solve_equilibrium(table, motors, turn @ force, gravity=gravity, tolerance=1e-13)
    assume(one.stable)
    off = slack(one, other)
    assert np.abs(other.q_springs - one.q_springs).max() < off
    assert np.abs(other.tip_position - turn @ one.tip_position).max() < 10.0 * off * robot.reach
    assert np.abs(other.motor_torques - one.motor_torques).max(initial=0.0) < 10.0 * off * robot.stiffness.max()
    assert other.stable


@law("solve_equilibrium")
@pytest.mark.parametrize("kind", ROBOTS)
@given(case=cases(), power=st.floats(-6.0, 6.0))
@settings(max_examples=6)
def test_a_material_and_loads_so_many_times_as_strong_leave_the_shape(kind: str, case: Case, power: float) -> None:
    """From a millionth to a million times the stiffness, the force, the gravity and the tensions."""
    factor, robot, force = 10.0**power, model(kind), case.force(kind)
    harder, motors = scaled(robot, factor), case.motors(robot)
    gravity = None if case.gravity is None else factor * np.array(case.gravity)
    pulls = np.where(np.array(robot.actuators.units) == "N", factor, 1.0) * motors
    one = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity, tolerance=1e-13)
    other = sr.solve_equilibrium(harder, pulls, factor * force, gravity=gravity, tolerance=1e-13)
    assume(one.stable)
    off = slack(one, other)
    assert np.abs(other.q_springs - one.q_springs).max() < off
    assert np.abs(other.spring_torques / factor - one.spring_torques).max() < off * robot.stiffness.max()
    assert np.abs(other.motor_torques / factor - one.motor_torques).max(initial=0.0) < 10.0 * off * robot.stiffness.max()
    assert other.stable == one.stable
    assert other.within_limits == one.within_limits


@law("solve_equilibrium", "load_model", "InflatableArm")
@given(case=cases(), power=st.floats(-1.0, 1.0))
@settings(max_examples=6)
def test_another_unit_of_length_measures_the_same_robot(case: Case, power: float) -> None:
    """Lengths in decimetres to decametres, moments and masses as they were: angles stay, positions have the other unit."""
    unit, force = 10.0**power, case.force("arm")
    robot = sr.InflatableArm()
    larger = sr.InflatableArm(
        link_lengths=unit * np.array(robot.link_lengths),
        hinge_offset=unit * np.array(robot.hinge_offset),
        radius=unit * np.array(robot.radius),
        wall_thickness=unit * np.array(robot.wall_thickness),
        density=np.array(robot.density) / unit**3,
    )
    motors = case.motors(model("arm"))
    gravity = None if case.gravity is None else np.array(case.gravity) / unit
    one = sr.solve_equilibrium(model("arm"), motors, force, gravity=case.gravity, tolerance=1e-13)
    other = sr.solve_equilibrium(sr.load_model(larger.urdf()), motors, force / unit, gravity=gravity, tolerance=1e-13)
    assume(one.stable)
    off = slack(one, other)
    assert np.abs(other.q_springs - one.q_springs).max() < off
    assert np.abs(other.tip_position / unit - one.tip_position).max() < 10.0 * off


HALVES = {
    "arm": ("arm", None),
    "limp": ("limp", None),
    "pcc": ("pcc", [0, 2, 1, 4, 3, 5]),
    "pulled": ("pulled", [0, 2, 1, 4, 3, 5]),
    "pcc_lumped": ("pcc_lumped", [0, 2, 1, 3, 5, 4]),
    "helix": ("helix_left", None),
}
"""The mirror image of a robot in the x-z plane, and which muscle is the image of which; motors that yaw change sign."""


@law("solve_equilibrium")
@pytest.mark.parametrize("kind", HALVES)
@given(case=cases())
@settings(max_examples=6)
def test_the_mirrored_load_gives_the_mirrored_answer(kind: str, case: Case) -> None:
    """An arm with its yaw turned back, muscles that change places, a tube of the other hand."""
    other_kind, places = HALVES[kind]
    robot, image, force = model(kind), model(other_kind), case.force(kind)
    motors = case.motors(robot)
    mirrored = motors[places] if places else motors * [-1.0, 1.0, 1.0][: len(motors)]
    gravity = None if case.gravity is None else MIRROR @ case.gravity
    one = sr.solve_equilibrium(robot, motors, force, gravity=case.gravity, tolerance=1e-13)
    other = sr.solve_equilibrium(image, mirrored, MIRROR @ force, gravity=gravity, tolerance=1e-13)
    assume(one.stable)
    # The tiny links of a hinge are slices that are not their own mirror images.
    off = slack(one, other) + (0.0 if kind != "pcc_lumped" or gravity is None else 1e-6)
    assert np.abs(other.tip_position - MIRROR @ one.tip_position).max() < 10.0 * off * robot.reach
    stored = [
        stored_energy(each, held, found.q_springs) for each, held, found in ((robot, motors, one), (image, mirrored, other))
    ]
    assert stored[1] == pytest.approx(stored[0], rel=10.0 * off, abs=10.0 * off * (1.0 + np.abs(one.spring_torques).max()))
    assert other.stable


@cache
def cut(parts: int, muscles: str) -> sr.SoftModel:
    """A rod of 0.6 m with three muscles, in so many segments, four sections in all."""
    robot = sr.PccArm(segment_lengths=(0.6 / parts,) * parts, offset=0.0, elastic_sections=4 // parts)
    return sr.load_model(robot, muscles=muscles)


@law("solve_equilibrium")
@given(tensions=shares, size=st.floats(0.0, 2.0), direction=st.integers(0, 2**32 - 1), parts=st.sampled_from([2, 4]))
@settings(max_examples=7)
def test_a_segment_cut_in_pieces_is_the_same_under_any_load(tensions: list, size: float, direction: int, parts: int) -> None:
    """Muscles of the same tensions run through all pieces: with a moment at the tip, too."""
    pulls, wrench = 10.0 * np.array(tensions[:3]), size * np.random.default_rng(direction).normal(size=6) / 3.0
    whole, pieces = cut(1, "forces"), cut(parts, "forces")
    one = sr.solve_equilibrium(whole, pulls, wrench=wrench, tolerance=1e-13)
    other = sr.solve_equilibrium(pieces, np.tile(pulls, parts), wrench=wrench, tolerance=1e-13)
    assume(one.stable)
    off = slack(one, other)
    assert np.abs(other.transform_tip_to_world.homogeneous - one.transform_tip_to_world.homogeneous).max() < 10.0 * off
    assert np.abs(other.strains - one.strains).max() < 10.0 * off / 0.15  # rad to rad/m
    assert np.abs(other.muscle_lengths.reshape(parts, 3).sum(axis=0) - one.muscle_lengths).max() < off


@law("solve_equilibrium")
@given(lengths=shares, twist=st.floats(-1.0, 1.0), parts=st.sampled_from([2, 4]))
@settings(max_examples=7)
def test_a_segment_bent_to_an_arc_can_be_cut_at_fixed_lengths(lengths: list, twist: float, parts: int) -> None:
    """Without a load the strains are the same along it, and every piece has its share of each length, and the same tensions.

    A twist along a straight segment leaves it so; the lengths are as they were.
    """
    held = 0.6 * (1.0 + 0.05 * np.array(lengths[:3]))
    wrench = np.zeros(6)
    if np.ptp(held) == 0.0:
        wrench[5] = twist
    one = sr.solve_equilibrium(cut(1, "lengths"), held, wrench=wrench, tolerance=1e-13)
    other = sr.solve_equilibrium(cut(parts, "lengths"), np.tile(held / parts, parts), wrench=wrench, tolerance=1e-13)
    off = slack(one, other)
    assert np.abs(other.transform_tip_to_world.homogeneous - one.transform_tip_to_world.homogeneous).max() < 10.0 * off
    assert np.abs(other.strains - one.strains).max() < 10.0 * off / 0.15
    assert np.abs(other.muscle_forces.reshape(parts, 3) - one.muscle_forces).max() < off * 2400.0 / 0.15
