"""Buckling loads against closed forms, against scans by energy descent, and on both sides of the limit."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import softrobots as sr
from softrobots.statics.stability import is_positive, stability
from tests.support.tables import each_row


def test_one_link_buckles_at_k_over_l2() -> None:
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.6,)))
    assert sr.critical_load(model, (0, 0), (-1, 0, 0)) == pytest.approx(172.71 / 0.57, rel=1e-12)


def test_two_links_buckle_at_the_closed_form(arm: sr.SoftModel) -> None:
    a, c = 1.17, 0.57  # docs/theory.md 1.4: 2 L - l1 and l2; 114.0657 N
    expected = 172.71 / ((a + c) / 2 + np.sqrt((a - c) ** 2 / 4 + c**2))
    assert sr.critical_load(arm, (0, 0, 0), (-3, 0, 0)) == pytest.approx(expected, rel=1e-12)
    assert expected == pytest.approx(114.0657, abs=5e-5)


@pytest.mark.parametrize("turn", [0.0, 0.7, -2.0])
def test_the_limit_does_not_depend_on_where_the_arm_points(arm: sr.SoftModel, turn: float) -> None:
    push = -np.array([np.cos(turn) * np.cos(0.4), np.sin(turn) * np.cos(0.4), np.sin(0.4)])
    straight = sr.critical_load(arm, (0, 0, 0), (-1, 0, 0))
    assert sr.critical_load(arm, (turn, 0.4, 0), push) == pytest.approx(straight, rel=1e-10)


def test_smallest_eigenvalue_changes_sign_at_the_limit(arm: sr.SoftModel) -> None:
    """Below, the straight arm is stable; above, it balances but the solver leaves it for a buckled state."""
    limit = sr.critical_load(arm, (0, 0, 0), (-1, 0, 0))
    below = sr.solve_equilibrium(arm, (0, 0, 0), (-0.999 * limit, 0, 0))
    above = sr.solve_equilibrium(arm, (0, 0, 0), (-1.001 * limit, 0, 0))
    assert np.abs(below.q_springs).max() == 0.0
    assert 0.0 < below.eigenvalues[0] < 0.01 * 172.71
    assert np.abs(above.q_springs).max() > 1e-2
    assert above.stable


@each_row("wrong", [float("nan"), float("inf"), -float("inf")])
def test_a_tangent_that_is_not_finite_is_never_certified(arm: sr.SoftModel, wrong: float) -> None:
    """Eigen's factorisation passes a NaN."""
    point, q = arm.coordinates.at(np.zeros(3), arm.rest), arm.configuration(np.zeros(3), arm.rest)
    for row, column in itertools.combinations_with_replacement(range(arm.n_springs), 2):
        tangent = np.diag(arm.stiffness)
        assert is_positive(arm, tangent)
        assert stability(arm, point, q, tangent).kind == "stable"
        tangent[row, column] = tangent[column, row] = wrong
        assert not is_positive(arm, tangent)
        assert stability(arm, point, q, tangent).kind == "unknown"


def test_pivots_tell_the_sign_of_the_smallest_eigenvalue(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """NumPy's eigenvalues answer the same, in coordinates scaled by the springs; one within rounding of zero is not stable."""
    n, k = arm.n_springs, arm.stiffness
    for least in rng.choice([-1.0, -1e-8, 0.0, 0.9e-9, 1.1e-8, 1e-3, 1.0], 50):
        turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
        unit = (turn * np.r_[least, rng.uniform(2.0, 3.0, n - 1)]) @ turn.T
        tangent = np.sqrt(k)[:, None] * (0.5 * (unit + unit.T)) * np.sqrt(k)
        assert is_positive(arm, tangent) == (least > 1e-9)
    assert not is_positive(arm, np.zeros((n, n)))
    shifted = np.array(arm.springs.least_tangent)  # what is left has a diagonal of zeros: Eigen calls that positive
    shifted[0, 1] = shifted[1, 0] = 50.0
    assert not is_positive(arm, shifted)


def scan(arm: sr.SoftModel, motors: tuple, direction: np.ndarray, forces: np.ndarray) -> list[sr.Equilibrium]:
    """Warm-started energy descent under a force that grows in small steps: another road than the path follower's."""
    unit, springs, found = direction / np.linalg.norm(direction), None, []
    for force in forces:
        found.append(sr.solve_equilibrium(arm, motors, force * unit, q_springs0=springs))
        springs = found[-1].q_springs
    return found


@pytest.mark.study
@pytest.mark.parametrize("tilt", [1e-3, 1e-2, 0.1])
def test_an_oblique_push_bends_the_arm_and_has_no_limit(arm: sr.SoftModel, tilt: float) -> None:
    """The pitchfork of the straight arm is gone: the arm bends away smoothly, past the load of the straight one."""
    direction = np.array([-1.0, 0.0, tilt])
    with pytest.raises(sr.NoCriticalLoad):
        sr.critical_load(arm, (0, 0, 0), direction, max_force=170.0)
    states = scan(arm, (0, 0, 0), direction, np.arange(1.0, 170.0, 0.25))
    moves = [np.abs(b.q_springs - a.q_springs).max() for a, b in itertools.pairwise(states)]
    assert max(moves) < 0.1
    assert max(np.abs(state.q_springs[[0, 2]]).max() for state in states) < 1e-9  # it stays in its plane


@pytest.mark.study
@each_row("tilt", [1e-4, 1e-5, 3e-6, 1e-6, 1e-7, 1e-8])
def test_a_nearly_axial_push_bends_the_arm_and_has_no_limit(arm: sr.SoftModel, tilt: float) -> None:
    """However small the tilt, the path bends away beside the crossing and does not go on straight."""
    with pytest.raises(sr.NoCriticalLoad, match="stays stable up to 137 N"):
        sr.critical_load(arm, (0, 0, 0), (-1, 0, tilt), max_force=137.0)
    with pytest.raises(sr.NoCriticalLoad, match="stays stable up to 137 N"):
        sr.post_buckling_branches(arm, (0, 0, 0), (-1, 0, tilt), max_force=137.0)


@each_row("rest", [1e-3, 1e-6, 1e-8])
def test_an_arm_that_is_nearly_straight_at_rest_has_no_limit(rest: float) -> None:
    crooked = sr.load_model(sr.InflatableArm(rest_up=rest))
    with pytest.raises(sr.NoCriticalLoad, match="stays stable up to 137 N"):
        sr.critical_load(crooked, (0, 0, 0), (-1, 0, 0), max_force=137.0)


def test_a_folded_arm_snaps_at_the_limit(arm: sr.SoftModel) -> None:
    """A limit point: just below the force the state moves on smoothly, just above it jumps far away."""
    motors, direction = (2.41, -0.95, -1.57), np.array([-0.40, -0.88, 1.47])
    limit = sr.critical_load(arm, motors, direction)
    before = scan(arm, motors, direction, np.r_[np.arange(5.0, 0.99 * limit, 5.0), 0.995 * limit, 0.99999 * limit])
    after = sr.solve_equilibrium(
        arm, motors, 1.00001 * limit * direction / np.linalg.norm(direction), q_springs0=before[-1].q_springs
    )
    assert before[-1].eigenvalues[0] < 0.05 * 172.71
    assert np.abs(after.q_springs - before[-1].q_springs).max() > 0.3  # for 2e-5 more force


def test_sag_under_gravity_lowers_nothing_to_zero(arm: sr.SoftModel) -> None:
    """A vertical arm pushed down buckles earlier with weight than without, and later with weight upwards."""
    up = (0, np.pi / 2, 0)
    limits = [sr.critical_load(arm, up, (0, 0, -1), gravity=g) for g in ((0, 0, -9.81), None, (0, 0, 9.81))]
    assert limits[0] < limits[1] < limits[2]


def test_stiff_springs_with_rest_angles_have_no_false_limit(arm: sr.SoftModel) -> None:
    """Rounding of k (y - rest) must not be taken for the end of the path."""
    for stiffness, rest in ((1e5, 1.0), (1e6, 0.5)):
        table = {name: (stiffness, rest) if "_1_" in name else (172.71, 0.0) for name in arm.spring_joints}
        model = sr.load_model(arm.urdf, springs=table)
        with pytest.raises(sr.NoCriticalLoad, match="stays stable"):
            sr.critical_load(model, (0.3, 0.2, 0.1), (0, 0, -1), max_force=100.0)


def test_a_soft_arm_that_sags_is_followed_from_its_sag() -> None:
    model = sr.load_model(sr.InflatableArm(stiffness=25.0, cap_mass=1.0))
    state = sr.solve_equilibrium(model, (2.0, 1.1, -0.1), gravity=sr.EARTH_GRAVITY)
    assert state.stable
    try:
        assert sr.critical_load(model, (2.0, 1.1, -0.1), (0, 0, -1), gravity=sr.EARTH_GRAVITY, max_force=50.0) > 0.0
    except sr.NoCriticalLoad as error:
        assert error.max_force > 1.0


def test_a_slider_does_not_buckle() -> None:
    stage = (
        '<robot name="stage"><link name="a"/><joint name="x" type="prismatic"><parent link="a"/><child link="b"/>'
        '<axis xyz="1 0 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint><link name="b"/></robot>'
    )
    model = sr.load_model(stage, springs={"x": 1e5})
    with pytest.raises(sr.NoCriticalLoad):
        sr.critical_load(model, (), (-1, 0, 0), max_force=1e6)
    assert sr.solve_equilibrium(model, (), (-200.0, 0, 0)).q_springs == pytest.approx([-2e-3], rel=1e-12)


def test_tension_has_no_limit(arm: sr.SoftModel) -> None:
    with pytest.raises(sr.NoCriticalLoad, match="stays stable up to 500 N") as caught:
        sr.critical_load(arm, (0, 0, 0), (1, 0, 0), max_force=500.0)
    assert caught.value.max_force == 500.0


@each_row(
    ("options", "message"),
    [
        ({"direction": (0, 0, 0)}, "direction.*different from zero"),
        ({"direction": (1, 0)}, "direction"),
        ({"direction": (float("nan"), 0, 0)}, "direction"),
        ({"q_motors": (0,)}, "q_motors"),
        ({"max_force": -1.0}, "max_force"),
        ({"gravity": (0, 0)}, "gravity"),
    ],
)
def test_bad_input_is_refused(arm: sr.SoftModel, options: dict, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        sr.critical_load(arm, **({"q_motors": (0, 0, 0), "direction": (-1, 0, 0)} | options))


def test_unknown_frame_and_rigid_robot_are_refused(arm: sr.SoftModel) -> None:
    with pytest.raises(sr.NameNotFound, match="'top'"):
        sr.critical_load(arm, (0, 0, 0), (-1, 0, 0), frame="top")
    rigid = sr.load_model(sr.InflatableArm(), springs={})
    with pytest.raises(sr.ParameterError, match="with springs"):
        sr.critical_load(rigid, np.zeros(7), (-1, 0, 0))
