"""The exact length of muscles: twist under co-contraction, torsional buckling, and rods with guided tendons.

The oracles here are closed forms of a twisted straight rod, and the rod with strings of Rucker and Webster (2011).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import softrobots as sr
from softrobots.statics.elastic_state import elastic_state
from softrobots.statics.loads import Load
from tests.support.oracles import central_difference
from tests.support.tendon_rod import Piece, String, solve_tendon_rod

EI, GJ, EA, DISTANCE, LENGTH = 1.92, 1.28, 2400.0, 0.04, 0.524


@cache
def arm(muscles: str = "forces", **fields: object) -> sr.SoftModel:
    return sr.load_model(sr.PccArm(**fields), muscles=muscles)


def one(muscles: str = "forces", **fields: object) -> sr.SoftModel:
    return arm(muscles, segment_lengths=(LENGTH,), **fields)


# --- A straight rod that is twisted


@pytest.mark.parametrize(("tension", "first_order"), [(0.0, 0.164), (50.0, 0.138), (133.0, 0.109)])
def test_tension_stiffens_torsion(tension: float, first_order: float) -> None:
    """0.2 N m twist the arm by M L / (GJ + sum T d^2) to first order in T: a lumped chain exactly, sections with stretch."""
    motors, wrench = np.full(6, tension), (0, 0, 0, 0, 0, 0.2)
    lumped = sr.solve_equilibrium(arm(chain="lumped", hinges=4), motors, wrench=wrench)
    twist = 0.2 * 2 * LENGTH / (GJ + 3 * tension * DISTANCE**2)
    assert lumped.strains[:, 2].mean() * 2 * LENGTH == pytest.approx(twist, rel=1e-10)
    assert twist == pytest.approx(first_order, abs=5e-4)

    def stretch(rate: float) -> float:
        def pull(nu: float) -> float:
            return float(EA * (nu - 1.0) + 3 * tension * nu / np.hypot(nu, DISTANCE * rate))

        return float(brentq(pull, 0.5, 1.5, xtol=1e-15))

    def torque(rate: float) -> float:
        return GJ * rate + 3 * tension * DISTANCE**2 * rate / np.hypot(stretch(rate), DISTANCE * rate)

    rate = brentq(lambda rate: torque(rate) - 0.2, 0.0, 1.0, xtol=1e-15)
    found = sr.solve_equilibrium(arm(), motors, wrench=wrench)
    assert found.strains[:, 2] == pytest.approx(rate, rel=1e-9)
    assert found.strains[:, 3] == pytest.approx(stretch(rate), rel=1e-9)
    assert found.muscle_lengths == pytest.approx(LENGTH * np.hypot(stretch(rate), DISTANCE * rate), rel=1e-12)
    held = sr.solve_equilibrium(arm("lengths"), found.muscle_lengths, wrench=wrench)
    assert held.muscle_forces == pytest.approx(motors, abs=1e-7)  # of 4600 N/m times 1e-12 m
    assert held.strains == pytest.approx(found.strains, abs=1e-9)


@pytest.mark.parametrize("axial", [2400.0, 24000.0, 240000.0])
@pytest.mark.parametrize("chain", ["sections", "lumped"])
def test_a_push_buckles_the_arm_in_torsion(axial: float, chain: str) -> None:
    """GJ + sum T d^2 / nu = 0 with the stretch nu = 1 - sum T / EA: -1200 N for the default arm, to leading order -800 N.

    The lumped chain has the leading order. Beyond the limit the straight arm is a saddle, which the solver leaves.
    """
    fields = {"chain": "lumped", "hinges": 2} if chain == "lumped" else {"elastic_sections": 2}
    robot = one(axial_stiffness=axial, **fields)
    limit = GJ / DISTANCE**2 if chain == "lumped" else GJ / (DISTANCE**2 - GJ / axial)
    straight = np.array(robot.rest)
    for share, stable in ((1.0 - 1e-6, True), (1.0 + 1e-6, False)):
        push = -share * limit / 3.0
        if chain == "sections" or robot.springs.turning.sum() < len(straight):
            straight[~robot.springs.turning] = -3.0 * push / axial * LENGTH / 2
        state = elastic_state(robot, np.full(3, push), straight, Load.of(robot, (0.0, 0.0, 0.0)))
        assert state.error < 1e-9
        assert (np.linalg.eigvalsh(state.tangent)[0] > 0.0) == stable
    if chain == "sections":
        push = -1.02 * limit / 3.0
        found = sr.solve_equilibrium(robot, np.full(3, push))

        def energy(rate: float) -> tuple[float, float]:
            def total(nu: float) -> float:
                return 0.5 * GJ * rate**2 + 0.5 * axial * (nu - 1.0) ** 2 + 3 * push * np.hypot(nu, DISTANCE * rate)

            best = minimize_scalar(total, bounds=(0.9, 1.8), method="bounded", options={"xatol": 1e-12})
            return float(best.fun), float(best.x)

        best = minimize_scalar(lambda rate: energy(rate)[0], bounds=(1e-3, 40.0), method="bounded", options={"xatol": 1e-10})
        assert found.stable
        assert np.abs(found.strains[:, 2]) == pytest.approx(best.x, rel=1e-4)  # where the energy is flat: the root of 1e-9


def test_held_lengths_change_the_torsional_stiffness() -> None:
    """Muscles held short pull with EA (1 - nu) in all; those held long push. GJ + sum T d^2 / nu by hand."""
    wrench = (0, 0, 0, 0, 0, 1e-4)
    for stretch in (0.9, 1.0, 1.1):
        found = sr.solve_equilibrium(one("lengths"), np.full(3, stretch * LENGTH), wrench=wrench)
        stiffness = GJ + EA * (1.0 - stretch) / stretch * DISTANCE**2  # sum T = EA (1 - nu)
        assert found.strains[:, 2].mean() == pytest.approx(1e-4 / stiffness, rel=1e-6)


@pytest.mark.parametrize("stretch", [1.0, 1.1])
def test_a_push_on_the_tip_of_a_held_arm_buckles_it_in_torsion(stretch: float) -> None:
    """Muscles carry what the backbone does not: sum T = -F - EA (nu - 1), and GJ + sum T d^2 / nu = 0 at the critical force.

    One section cannot bend while its lengths are held; every further section buckles at the same force.
    """
    force = GJ * stretch / DISTANCE**2 - EA * (stretch - 1.0)
    robot, motors = one("lengths", elastic_sections=1), np.full(3, stretch * LENGTH)
    assert sr.critical_load(robot, motors, (0, 0, -1), max_force=1500.0) == pytest.approx(force, rel=1e-10)
    stiff = one("lengths", elastic_sections=3, bending_stiffness=1e3)
    assert sr.critical_load(stiff, motors, (0, 0, -1), max_force=1500.0) == pytest.approx(force, rel=1e-10)


def test_the_branches_of_an_arm_that_buckles_in_torsion_are_mirror_images() -> None:
    robot, motors, force = one("lengths", elastic_sections=1), np.full(3, LENGTH), GJ / DISTANCE**2
    straight, *branches = sr.post_buckling_branches(robot, motors, (0, 0, -1), max_force=1.02 * force)
    assert not straight.stable[-1]
    assert [bool(branch.stable[-1]) for branch in branches] == [True, True]
    ends = [branch.equilibria[-1].strains[0, 2] for branch in branches]
    assert ends[0] == pytest.approx(-ends[1], rel=1e-6)
    assert abs(ends[0]) > 0.5


def test_a_twist_that_the_lengths_do_not_allow_is_refused() -> None:
    """Three rad a section of four: helices of 0.48 m around the backbone do not fit into muscles of 0.45 m."""
    robot = one("lengths", muscle_contraction=0.5)
    start = np.array(robot.rest)
    start[[name.endswith("twist") for name in robot.spring_joints]] = 3.0
    assert robot.coordinates.at(np.full(3, 0.60), start).valid
    with pytest.raises(sr.ParameterError, match="within the range of every section"):
        sr.solve_equilibrium(robot, np.full(3, 0.45), q_springs0=start)


def test_more_than_three_lengths_are_met_in_the_least_squares() -> None:
    """And the derivatives are exact: tangent and coupling against central differences of the residual."""
    robot = one("lengths", muscle_azimuths=(0.1, 1.5, 3.0, 4.4), elastic_sections=2)
    rest = np.array([muscle.rest_length for muscle in robot.muscles])
    arms = robot.structure.muscle_paths.matrix[:, :4]
    lengths = rest + arms @ np.array([0.2, -0.3, 0.0, 0.01])
    springs = np.where([name.endswith("twist") for name in robot.spring_joints], 0.5, 0.02)
    springs[~robot.springs.turning] = 1e-3
    load = Load.of(robot, (1.0, -2.0, 1.5))
    state = elastic_state(robot, lengths, springs, load)
    tangent = central_difference(lambda y: elastic_state(robot, lengths, y, load).residual, springs)
    coupling = -central_difference(lambda u: elastic_state(robot, u, springs, load).residual, lengths)
    assert np.abs(state.tangent - tangent).max() < 2e-8 * np.abs(tangent).max()
    assert np.abs(state.load.coupling - coupling).max() < 1e-6 * max(1.0, np.abs(coupling).max())


# --- A rod with guided tendons


PIECE = Piece(LENGTH, EI, GJ, EA)
STRINGS = [String.straight(LENGTH, DISTANCE, azimuth) for azimuth in (0.0, -2.0 * np.pi / 3.0, 2.0 * np.pi / 3.0)]


@pytest.mark.parametrize("moment", [0.0, 0.3])
def test_sections_converge_to_a_rod_with_guided_tendons(moment: float) -> None:
    """Unequal tensions of 300 N, a force across, a moment about z: error 4 times less with twice the sections.

    So do the lengths; and the arm held at the lengths of the rod finds its tensions.
    """
    tensions, force, about = np.array([140.0, 60.0, 100.0]), np.array([4.0, -6.0, 2.0]), np.array([0.0, 0.0, moment])
    exact = solve_tendon_rod([PIECE], STRINGS, tensions, force=force, moment=about)
    tip, rotation, lengths = exact.position, exact.rotation, exact.lengths
    wrench, errors = np.r_[force, about], []
    for sections in (2, 4, 8):
        pulled = sr.solve_equilibrium(one(elastic_sections=sections), tensions, wrench=wrench)
        held = sr.solve_equilibrium(one("lengths", elastic_sections=sections), lengths, wrench=wrench)
        pose = pulled.transform_tip_to_world
        errors.append(
            [
                np.linalg.norm(pose.translation - tip),
                np.linalg.norm(pose.rotation - rotation),
                np.abs(pulled.muscle_lengths - lengths).max(),
                np.linalg.norm(held.tip_position - tip),
                np.abs(held.muscle_forces - tensions).max(),
            ]
        )
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert ratios[-1] == pytest.approx(4.0, abs=0.3)
    assert errors[-1][0] < 2e-3 * LENGTH


# --- The compiled path


@pytest.mark.study
@pytest.mark.parametrize("muscles", ["lengths", "forces"])
@pytest.mark.parametrize("fields", [{"elastic_sections": 2}, {"chain": "lumped", "hinges": 2}], ids=["sections", "lumped"])
def test_compiled_solvers_find_the_same_twisted_arm(muscles: str, fields: dict, rng: np.random.Generator) -> None:
    """Two segments, loads across that twist it: equilibrium, tip Jacobian and tensions of both engines, to their tolerance."""
    model = arm(muscles, **fields)
    fast = sr.compile(model, backend="python")
    for _ in range(2):
        motors = LENGTH * (1.0 + rng.uniform(-0.1, 0.1, 6)) if muscles == "lengths" else rng.uniform(60.0, 140.0, 6)
        force = rng.uniform(-8.0, 8.0, 3)
        slow, quick = sr.solve_equilibrium(model, motors, force), fast.equilibrium(motors, force)
        assert np.abs(slow.strains[:, 2]).max() > 0.02
        assert np.abs(quick.q_springs - slow.q_springs).max() < 1e-7  # 1e-10 of 1 kN m over 3 N m/rad
        assert np.abs(quick.tip_position - slow.tip_position).max() < 1e-7
        if muscles == "lengths":
            torques = fast.estimate_load(motors, slow.motor_torques)
            assert torques.force == pytest.approx(force, abs=1e-5)
