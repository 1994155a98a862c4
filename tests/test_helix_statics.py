"""The helical tube under load: Love's helices in closed form, Castigliano's compliance, Kirchhoff rods by `solve_bvp`."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from scipy.optimize import brentq

import softrobots as sr
from softrobots.robots import HelixTube
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import distributed_force
from softrobots.view.body import body_at
from tests.support.helix_rods import (
    HelixRod,
    actuated_rod,
    axial_wrench,
    gauss,
    helix_frames,
    load_carried,
    solve_helix_rod,
    tip_compliance,
)
from tests.support.hinge_places import hinge_places
from tests.support.mujoco_balance import assert_mujoco_balances

FIELDS: dict[str, Any] = {"length": 0.5, "bending_stiffness": 0.02, "torsional_stiffness": 0.012, "axial_stiffness": 100.0}
"""0.9 turns of the paper's helix, soft: a force of 1 N moves the tip by some 0.3 m."""


def tube(count: int, **fields: Any) -> HelixTube:
    return HelixTube(**(FIELDS | fields), elastic_sections=count, hinges=count)


@cache
def loaded_once(robot: HelixTube) -> sr.SoftModel:
    return sr.load_model(robot)


def model(count: int, **fields: Any) -> sr.SoftModel:
    return loaded_once(tube(count, **fields))


def rod(robot: HelixTube) -> HelixRod:
    """The same tube as a rod: no name of softrobots.helix."""
    return actuated_rod(
        robot.contraction,
        robot.angle,
        robot.diameter,
        length=robot.length,
        sign=1 if robot.handedness == "right" else -1,
        bending_stiffness=robot.bending_stiffness,
        torsional_stiffness=robot.torsional_stiffness,
        axial_stiffness=robot.axial_stiffness,
    )


def misses(found: sr.Equilibrium, position: np.ndarray, rotation: np.ndarray) -> tuple[float, float]:
    """Distance [m] and angle [rad] of the tip."""
    assert found.stability.kind in ("stable", "flutter")  # not divergent
    turn = pin.log3(rotation.T @ found.transform_tip_to_world.rotation)
    return float(np.linalg.norm(found.tip_position - position)), float(np.linalg.norm(turn))


def orders(errors: Any) -> np.ndarray:
    """Observed order between halvings."""
    return np.log2(np.asarray(errors)[:-1] / np.asarray(errors)[1:])


# --- The oracles against each other


@pytest.mark.parametrize("torsion", [5.06, -5.06])
@pytest.mark.parametrize("axial_stiffness", [None, 50.0])
def test_the_boundary_value_solve_finds_loves_helix(torsion: float, axial_stiffness: float | None) -> None:
    """Tolerance 1e-6 of a method of fourth order: measured 1e-9."""
    straight = HelixRod(0.75, 12.47, torsion, 0.05, 0.03, axial_stiffness)
    love = axial_wrench(straight, 11.0, 1.3 * torsion)
    position, rotation, _ = solve_helix_rod(straight, love.wrench, tol=1e-6)
    curvature, turned, stretch = love.strains
    exact = helix_frames(curvature / stretch, turned / stretch, [stretch * 0.75])[0]
    assert np.linalg.norm(position - straight.frames([0.75])[0, :3, 3]) > 0.05
    assert np.allclose(position, exact[:3, 3], atol=1e-8)
    assert np.allclose(rotation, exact[:3, :3], atol=1e-7)


@pytest.mark.study
def test_castiglianos_compliance_is_that_of_the_boundary_value_solve() -> None:
    """Differences over 1e-3 N and 1e-4 N m; both sides, so quadratic terms cancel: 1e-5 of the largest entry."""
    one = HelixRod(0.4, 12.47, -5.06, 0.05, 0.03, 200.0)
    exact, found = tip_compliance(one), np.zeros((6, 6))
    for column, step in enumerate([1e-3] * 3 + [1e-4] * 3):
        ends = [solve_helix_rod(one, share * step * np.eye(6)[column], tol=1e-8)[:2] for share in (1.0, -1.0)]
        (p, r), (p_, r_) = ends
        found[:, column] = np.r_[p - p_, pin.log3(r @ r_.T)] / (2 * step)
    assert np.abs(found - exact).max() < 1e-5 * np.abs(exact).max()


def test_castiglianos_compliance_along_the_axis_is_the_formula_of_a_helical_spring() -> None:
    """A force on a rigid arm to the axis, whatever the number of turns and however clamped: with the lead angle a

    delta = F L (R^2 (cos^2 a / GJ + sin^2 a / EI) + sin^2 a / EA), as torque F R cos a and moment F R sin a are constant.
    """
    spring = HelixRod(1.3, 12.47, 5.06, 0.05, 0.03, 200.0)
    size = np.hypot(spring.curvature, spring.torsion)
    cosine, sine, radius = spring.curvature / size, spring.torsion / size, spring.curvature / size**2
    tip = spring.frames([spring.length])[0]
    axis = cosine * tip[:3, 1] + sine * tip[:3, 2]
    wrench = np.r_[axis, np.cross(radius * tip[:3, 0], axis)]
    expected = 1.3 * (radius**2 * (cosine**2 / 0.03 + sine**2 / 0.05) + sine**2 / 200.0)
    assert wrench @ tip_compliance(spring) @ wrench == pytest.approx(expected, rel=1e-12)


# --- Love's helices


@pytest.mark.study
@pytest.mark.parametrize("handedness", ["right", "left"])
@pytest.mark.parametrize("factors", [(0.9, 1.3), (1.1, 0.6), (0.95, 0.97)])
def test_a_wrench_along_its_axis_bends_a_chain_of_sections_into_the_exact_helix(handedness: str, factors: tuple) -> None:
    """Constant strain is the exact solution: six sections already have it, place, orientation, moment and stretch.

    The solver stops at 1e-10 of the load; then the tip errs by about that share of its motion.
    """
    robot, arm = tube(6, handedness=handedness), model(6, handedness=handedness)
    love = axial_wrench(rod(robot), factors[0] * rod(robot).curvature, factors[1] * rod(robot).torsion)
    found = sr.solve_equilibrium(arm, (), wrench=love.wrench)
    curvature, torsion, stretch = love.strains
    whole, q = stretch * rod(robot).length, found.q
    exact = helix_frames(curvature / stretch, torsion / stretch, whole * np.arange(1, 7) / 6)
    frames = [frame_placement(arm, q, f"section_1_{j}").homogeneous for j in range(1, 7)]
    assert found.stability.kind in ("stable", "flutter")
    assert np.linalg.norm(exact[-1, :3, 3] - rod(robot).frames([rod(robot).length])[0, :3, 3]) > 5e-3
    assert np.allclose(frames, exact, atol=1e-10, rtol=0)
    assert np.allclose(found.strains, [0.0, curvature, torsion, stretch], atol=1e-8)
    assert np.allclose(found.link_moments, abs(love.moment), rtol=1e-8)
    (segment,) = body_at(found.model, found.q_motors, found.q_springs, 4)
    along = helix_frames(curvature / stretch, torsion / stretch, whole * np.arange(25) / 24)
    assert np.allclose(segment.poses, along, atol=1e-10, rtol=0)


@pytest.mark.study
@pytest.mark.parametrize("rule", ["corrected", "midpoint"])
def test_a_wrench_along_its_axis_bends_lumped_chains_into_the_helix_in_second_order(rule: str) -> None:
    """The body that is drawn ends where the chain does, to second order too; from 12 hinges on. 1.8: room."""
    errors, gaps = [], []
    for count in (12, 24):
        arm, one = model(count, chain="lumped", hinge_rule=rule), rod(tube(count))
        love = axial_wrench(one, 0.9 * one.curvature, 1.3 * one.torsion)
        curvature, torsion, stretch = love.strains
        exact = helix_frames(curvature / stretch, torsion / stretch, [stretch * one.length])[0]
        found = sr.solve_equilibrium(arm, (), wrench=love.wrench)
        errors.append(misses(found, exact[:3, 3], exact[:3, :3]))
        (segment,) = body_at(found.model, found.q_motors, found.q_springs, 3)
        assert np.allclose(segment.poses[0], np.eye(4), atol=1e-13)
        gaps.append(np.linalg.norm(segment.backbone[-1] - found.tip_position))
    assert orders(errors).min() > 1.8
    assert orders(gaps).min() > 1.8
    assert errors[-1][0] < 1e-4


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(("share", "wrinkled"), [(0.999, False), (1.001, True)])
def test_it_wrinkles_where_the_moment_is_the_wrinkling_moment(sign: float, share: float, wrinkled: bool) -> None:
    """pi/4 (P + N) r with P = 8.605 N at 10 kPa and the tension N = EA (stretch - 1) of the rod, the same in every section."""
    robot, arm = tube(3, bending_stiffness=0.3), model(3, bending_stiffness=0.3)
    radius, one = 0.01655, rod(robot)

    def loaded(moment: float) -> Any:
        return axial_wrench(one, one.curvature + moment / 0.3, one.torsion)

    def tension(moment: float) -> float:
        return one.axial_stiffness * (loaded(moment).strains[2] - 1.0)

    limit = brentq(
        lambda moment: moment - np.pi / 4 * (1e4 * np.pi * radius**2 + tension(sign * moment)) * radius, 0.05, 0.2, xtol=1e-14
    )
    assert limit == pytest.approx(0.1118, rel=0.05)
    found = sr.solve_equilibrium(arm, (), wrench=loaded(sign * share * limit).wrench)
    assert found.link_limits.axial_forces == pytest.approx([tension(sign * share * limit)] * 3, rel=1e-6)
    assert found.link_limits.wrinkling_moments == pytest.approx([limit] * 3, rel=1e-3)
    assert found.link_moments == pytest.approx([share * limit] * 3, rel=1e-4)
    assert found.wrinkled == wrinkled


# --- Compliance


@pytest.mark.parametrize("handedness", ["right", "left"])
def test_compliance_of_sections_is_that_of_piecewise_constant_strain_exactly(handedness: str) -> None:
    """Castigliano with the means of moment and tension over each section, by quadrature: to rounding."""
    for count in (3, 6):
        robot, arm = tube(count, handedness=handedness), model(count, handedness=handedness)
        one, expected = rod(robot), np.zeros((6, 6))
        each = one.length / count
        for j in range(count):
            points, weights = gauss(j * each, (j + 1) * each)
            mean = np.einsum("n,nij->ij", weights, load_carried(one, points)) / each
            expected += each * np.einsum("ai,a,aj->ij", mean, one.softness, mean)
        found = sr.compliance(arm, sr.solve_equilibrium(arm, ()))
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.study
@pytest.mark.parametrize(
    "fields",
    [{"handedness": "left"}, {"hinge_rule": "midpoint"}, {"torsion": False, "extension": False, "handedness": "left"}],
    ids=str,
)
def test_compliance_of_hinges_is_that_of_springs_on_the_helix_exactly(fields: dict) -> None:
    robot, arm = tube(6, chain="lumped", **fields), model(6, chain="lumped", **fields)
    one = rod(robot)
    each, shares = one.length / 6, hinge_places(6, robot.hinge_rule)
    carried = load_carried(one, shares * each)
    soft = each * one.softness * [1.0, 1.0, robot.torsion, robot.extension]
    expected = np.einsum("nai,a,naj->ij", carried, soft, carried)
    found = sr.compliance(arm, sr.solve_equilibrium(arm, ()))
    assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


@pytest.mark.study
@pytest.mark.parametrize(
    ("fields", "handedness"),
    [({}, "right"), ({}, "left"), ({"chain": "lumped"}, "right"), ({"chain": "lumped", "hinge_rule": "midpoint"}, "right")],
    ids=str,
)
def test_compliance_converges_to_castiglianos_in_second_order(fields: dict, handedness: str) -> None:
    """Sections miss what varies within one: of a moment that turns by d over a section, d^2 / 12 of its square. 0.9 turns:
    d = 5.6 / n; of all entries the largest at most that."""
    exact, errors = tip_compliance(rod(tube(6, handedness=handedness))), []
    counts = (12, 24) if fields else (8, 16)
    for count in counts:
        arm = model(count, handedness=handedness, **fields)
        found = sr.compliance(arm, sr.solve_equilibrium(arm, ()))
        errors.append(np.abs(found - exact).max() / np.abs(exact).max())
    assert errors[-1] < (5.6 / counts[-1]) ** 2 / 12
    assert orders(errors).min() > 1.8


def test_a_helical_spring_gives_way_along_its_axis_as_its_formula_says() -> None:
    """delta / F = L (R^2 (cos^2 a / GJ + sin^2 a / EI) + sin^2 a / EA): constant torque and moment, so exact for sections."""
    robot, arm = tube(12, length=2.0), model(12, length=2.0)  # 3.6 turns
    one = rod(robot)
    size = np.hypot(one.curvature, one.torsion)
    cosine, sine, radius = one.curvature / size, one.torsion / size, one.curvature / size**2
    tip = one.frames([one.length])[0]
    axis = cosine * tip[:3, 1] + sine * tip[:3, 2]
    wrench = np.r_[axis, np.cross(radius * tip[:3, 0], axis)]
    expected = one.length * (radius**2 * (cosine**2 / 0.012 + sine**2 / 0.02) + sine**2 / 100.0)
    found = wrench @ sr.compliance(arm, sr.solve_equilibrium(arm, ())) @ wrench
    assert robot.turns == pytest.approx(3.556, abs=1e-3)
    assert found == pytest.approx(expected, rel=1e-12)


# --- Kirchhoff rods

GRAVITY = (20.0, 10.0, -30.0)  # several times the Earth's: the tube is light
LOADS: dict[str, dict[str, Any]] = {
    "force": {"tip": (0.4, -0.3, 0.2, 0.0, 0.0, 0.0)},
    "moment": {"tip": (0.0, 0.0, 0.0, 0.02, -0.015, 0.02)},
    "distributed": {"spread": (0.3, 0.2, -0.5)},
    "weight": {"gravity": GRAVITY},
    "all": {"tip": (0.2, 0.1, -0.2, -0.01, 0.01, 0.01), "spread": (-0.1, 0.2, 0.1), "gravity": GRAVITY},
}
CHAINS = {"sections": {}, "corrected": {"chain": "lumped"}, "midpoint": {"chain": "lumped", "hinge_rule": "midpoint"}}


@cache
def answer(load: str, handedness: str) -> tuple[np.ndarray, np.ndarray]:
    """Tip of the rod; its weight is that of the wall of the uninflated tube on the shorter centre line."""
    robot, asked = tube(6, handedness=handedness), LOADS[load]
    one = rod(robot)
    per_length = robot.density * np.pi * robot.diameter * robot.wall_thickness * robot.length / one.length
    spread = np.array(asked.get("spread", np.zeros(3))) + per_length * np.array(asked.get("gravity", np.zeros(3)))
    position, rotation, _ = solve_helix_rod(one, asked.get("tip"), spread, tol=1e-6)  # right to 1e-8 m, as above
    return position, rotation


def loaded(arm: sr.SoftModel, load: str) -> sr.Equilibrium:
    asked = LOADS[load]
    wrench = distributed_force(arm, asked.get("spread", (0.0, 0.0, 0.0)))
    if "tip" in asked:
        wrench["tip"] = np.array(asked["tip"])
    return sr.solve_equilibrium(arm, (), wrench=wrench, gravity=asked.get("gravity"))


@pytest.mark.study
@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("chain", CHAINS)
def test_a_loaded_tube_converges_to_the_kirchhoff_rod_in_second_order(chain: str, load: str) -> None:
    """Both hands; of hinges, whose number is a multiple of four, one, as the mirror tells the other (below). 1.8: room.

    Bounds: sections are too stiff by up to d^2 / 12 with d = 5.6 / 16 rad, 1 %, and tips move by up to 0.2 m and turn by up to
    2 rad; lumped chains are better, to an eighth at 24 hinges.
    """
    counts, hands = ((8, 16), ("right", "left")) if chain == "sections" else ((12, 24), ("right",))
    errors = np.zeros((2, len(hands), 2))
    for row, count in enumerate(counts):
        for column, handedness in enumerate(hands):
            position, rotation = answer(load, handedness)
            found = loaded(model(count, handedness=handedness, **CHAINS[chain]), load)
            errors[row, column] = misses(found, position, rotation)
    together = np.sqrt((errors**2).mean(axis=1))
    assert orders(together).min() > 1.8
    share = 1.0 if chain == "sections" else 1 / 8
    assert errors[1, :, 0].max() < share * 0.01 * 0.2
    assert errors[1, :, 1].max() < share * 0.01 * 2.0


def test_a_straight_tube_is_an_ordinary_cantilever() -> None:
    """At contraction 1 and angle 0 its compliance is that of a beam: L^3 / 3EI, L^2 / 2EI, L / EI, L / GJ, L / EA; n^-2 / 4."""
    fields = {"contraction": 1.0, "angle": 0.0}
    arm = model(12, **fields)
    found = sr.compliance(arm, sr.solve_equilibrium(arm, ()))
    length, bend = 0.5, 0.02
    expected = np.diag([length**3 / 3 / bend] * 2 + [length / 100.0] + [length / bend] * 2 + [length / 0.012])
    expected[0, 4] = expected[4, 0] = length**2 / 2 / bend
    expected[1, 3] = expected[3, 1] = -(length**2) / 2 / bend
    assert np.abs(found - expected).max() < expected[3, 3] * 12**-2


# --- Symmetry


@pytest.mark.parametrize("chain", ["sections", "corrected"])
def test_standing_upright_by_its_axis_only_turns_and_moves_the_tube(chain: str) -> None:
    """The same load in the turned axes gives the same answer in the turned axes."""
    plain, raised = (model(6, upright=upright, **CHAINS[chain]) for upright in ("tube", "axis"))
    base = frame_placement(raised, raised.configuration([]), "base_link")
    turn = np.array(base.rotation)
    force, gravity = np.array([0.3, -0.2, 0.1]), np.array(GRAVITY)
    one = sr.solve_equilibrium(plain, (), force, gravity=gravity, tolerance=1e-13)
    other = sr.solve_equilibrium(raised, (), turn @ force, gravity=turn @ gravity, tolerance=1e-13)
    assert not np.allclose(turn, np.eye(3), atol=0.1)
    assert np.allclose(other.tip_position, base.translation + turn @ one.tip_position, atol=1e-11)
    assert np.allclose(other.link_moments, one.link_moments, atol=1e-12)


def test_at_rest_nothing_is_loaded() -> None:
    """Without load the answer is the helix itself: no moments, exactly, and the rest strains."""
    for chain in CHAINS:
        robot, arm = tube(6, **CHAINS[chain]), model(6, **CHAINS[chain])
        found = sr.solve_equilibrium(arm, ())
        assert found.stable
        assert not found.wrinkled
        assert np.array_equal(found.link_moments, np.zeros(6))
        assert np.allclose(found.q, 0.0, atol=1e-15)
        one = rod(robot)
        assert np.allclose(found.strains, [0.0, one.curvature, one.torsion, 1.0], atol=1e-12)
        assert np.allclose(found.transform_tip_to_world.homogeneous, one.frames([one.length])[0], atol=1e-13)


# --- Another solver


@pytest.mark.study
@pytest.mark.parametrize(
    "parameters",
    [{}, {"torsion": False, "extension": False, "handedness": "left"}, {"hinge_rule": "midpoint", "upright": "axis"}],
    ids=str,
)
def test_mujoco_agrees_with_the_equilibrium_of_a_lumped_tube(tool: Callable[[str], ModuleType], parameters: dict) -> None:
    robot = tube(7, chain="lumped", **parameters)
    found = assert_mujoco_balances(tool("mujoco"), robot, np.array([0.3, -0.45, 0.13]), np.array(GRAVITY))
    at_rest = frame_placement(found.model, found.model.configuration([]), "tip").translation
    assert np.linalg.norm(found.tip_position - at_rest) > 0.03  # bent in earnest


@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_what_is_told_of_a_section_is_its_largest_moment(chain: str) -> None:
    """A straight cantilever under a small tip force F carries F (L - s): F (L - i h) where section i starts, the base too."""
    straight = {"contraction": 1.0, "angle": 0.0, "length": 0.5}
    robot = HelixTube(**straight, chain=chain, elastic_sections=8, hinges=8, hinge_rule="midpoint")
    found = sr.solve_equilibrium(sr.load_model(robot), (), (1e-3, 0.0, 0.0))
    expected = 1e-3 * 0.5 * (1.0 - np.arange(8) / 8)
    # It bends by F L^2 / 2EI = 4e-4 rad: its lever is shorter by less than 1e-6.
    assert np.allclose(found.link_moments, expected, rtol=1e-5)


def test_the_base_of_a_tube_wrinkles_before_the_middle_of_its_first_section() -> None:
    robot = HelixTube(contraction=1.0, angle=0.0, length=0.5, elastic_sections=4)
    model = sr.load_model(robot)
    limit = np.pi**2 / 4 * 10e3 * (0.0331 / 2) ** 3  # [Troise 2021] (3)
    force = 1.05 * limit / 0.5
    found = sr.solve_equilibrium(model, (), (force, 0.0, 0.0))
    middle = np.linalg.norm(found.spring_torques[:2])
    assert middle < limit  # 7/8 of the lever
    assert found.wrinkled
