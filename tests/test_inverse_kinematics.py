"""Inverse kinematics: the tip arrives, every branch is found, limits hold, what cannot be reached is said with how near."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

import softrobots as sr
from softrobots.statics.inverse_kinematics import elbow_side
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.loads import Load
from softrobots.statics.tip_goal import Goal, LoadedTip
from softrobots.statics.tip_search import WARM_DAMPING, search
from tests.support.oracles import flexible_table, rigid_table
from tests.support.tables import each_row

FORCE = (0.0, 10.0, -15.0)
TOLERANCE = 1e-9  # what `solve_ik` promises [m]


def test_without_load_it_is_the_rigid_arms_own_solution(arm: sr.SoftModel) -> None:
    """Two-link closed form: cos(q5) = (r^2 - 2 L^2) / (2 L^2)."""
    target = np.array([0.7, 0.2, 0.4])
    elbow = np.arccos((target @ target - 2 * 0.36) / (2 * 0.36))
    for side, sign in (("up", -1.0), ("down", 1.0)):
        found = sr.solve_ik(arm, target, elbow=side)
        assert found.q_motors[2] == pytest.approx(sign * elbow, abs=1e-8)
        assert np.allclose(rigid_table(found.q_motors)[:3, 3], target, atol=1e-9)


def test_all_four_branches_are_found_and_selectable(arm: sr.SoftModel) -> None:
    target = np.array([0.7, 0.2, 0.4])
    found = sr.solve_ik(arm, target, FORCE)
    branches = [found.q_motors, *found.alternatives]
    assert len(branches) == 4  # two shoulders, two elbows
    for motors in branches:
        assert np.linalg.norm(sr.solve_equilibrium(arm, motors, FORCE).tip_position - target) < 2 * TOLERANCE
    distances = [np.linalg.norm(motors) for motors in branches]
    assert distances == sorted(distances)
    for side in ("up", "down"):
        chosen = sr.solve_ik(arm, target, FORCE, elbow=side)
        assert elbow_side(arm, chosen.equilibrium.q) == side
        height = frame_placement(arm, chosen.equilibrium.q, "link_2_root").translation[2]
        assert (height > target[2] / 2) == (side == "up")


def test_the_nearest_solution_to_the_start_is_chosen(arm: sr.SoftModel) -> None:
    target = np.array([0.7, 0.2, 0.4])
    everything = sr.solve_ik(arm, target, FORCE)
    for motors in (everything.q_motors, *everything.alternatives):
        start = np.clip(motors + 0.1, -np.pi, np.pi)
        assert np.allclose(sr.solve_ik(arm, target, FORCE, q_motors0=start).q_motors, motors, atol=1e-7)


def test_an_arm_with_four_motors_moves_least(odd_arm: sr.SoftModel) -> None:
    """Oracle: SciPy's constrained minimiser of the motor change over the rigid arm's DH-like chain, to its 1e-6."""
    arm = sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.4, 0.3)))
    start, target = np.array([0.1, 0.6, -0.5, -0.4]), np.array([0.8, 0.2, 0.3])
    found = sr.solve_ik(arm, target, q_motors0=start)
    best = minimize(
        lambda q: (q - start) @ (q - start),
        found.q_motors + 0.05,
        constraints={"type": "eq", "fun": lambda q: frame_placement(arm, arm.configuration(q), "tip").translation - target},
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert np.linalg.norm(found.q_motors - start) <= np.linalg.norm(best.x - start) + 1e-6
    assert np.allclose(found.q_motors, best.x, atol=1e-4)


def test_motor_limits_hold() -> None:
    narrow = sr.load_model(sr.InflatableArm(motor_limit=1.0))
    wide = sr.load_model(sr.InflatableArm())
    inside = sr.solve_equilibrium(wide, (0.4, 0.9, -0.9), FORCE).tip_position
    found = sr.solve_ik(narrow, inside, FORCE)
    assert np.abs(found.q_motors).max() <= 1.0
    assert all(np.abs(other).max() <= 1.0 for other in found.alternatives)
    outside = sr.solve_equilibrium(wide, (2.0, 0.4, -0.5), FORCE).tip_position
    with pytest.raises(sr.TargetUnreachable) as caught:
        sr.solve_ik(narrow, outside, FORCE)
    assert np.abs(caught.value.best.q_motors).max() <= 1.0


@pytest.mark.study
def test_springs_that_do_not_settle_are_not_an_unreachable_target(arm: sr.SoftModel) -> None:
    """At 200 N the fixed point mostly fails; the error says that it is the springs, and what to use instead."""
    force = (200.0, 0.0, 0.0)
    target = sr.solve_equilibrium(arm, (0.5, 0.8, -1.0), force).tip_position
    assert sr.solve_ik(arm, target, force).error <= TOLERANCE
    with pytest.raises(sr.NotConverged, match=r"no equilibrium under this load|'fixed_point' found no equilibrium at \d+"):
        sr.solve_ik(arm, target, force, method="fixed_point", starts=3)


def test_targets_under_moments_are_reached(arm: sr.SoftModel) -> None:
    wrench = np.array([0, 0, 0, 0, 100.0, 0])
    start = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), wrench=wrench)
    target = start.tip_position + [-0.05, 0.02, 0.01]
    found = sr.solve_ik(arm, target, wrench=wrench, q_motors0=(0.3, 0.6, -0.8))
    again = sr.solve_equilibrium(arm, found.q_motors, wrench=wrench)
    assert np.linalg.norm(again.tip_position - target) < 2 * TOLERANCE


def test_whole_turns_are_not_other_solutions(arm: sr.SoftModel) -> None:
    found = sr.solve_ik(arm, (-0.7, 0.0, 0.4))
    motors = np.array([found.q_motors, *found.alternatives])
    turns = np.exp(1j * motors)
    for i in range(len(motors)):
        for j in range(i):
            assert np.abs(turns[i] - turns[j]).max() > 1e-3


def test_a_robot_without_an_elbow_refuses_the_choice() -> None:
    single = sr.load_model(sr.InflatableArm(link_lengths=(0.6,)))
    with pytest.raises(sr.ParameterError, match=r"elbow.*None for this robot"):
        sr.solve_ik(single, (0.6, 0, 0), elbow="down")


def test_an_unreachable_target_says_how_near(arm: sr.SoftModel) -> None:
    """Unloaded: the nearest point to a far target is on the sphere of radius 1.2 m, exactly."""
    with pytest.raises(sr.TargetUnreachable, match=r"nearest of 24 starts \(seed \d+\) comes within 0.8 m") as caught:
        sr.solve_ik(arm, (0.0, 2.0, 0.0))
    assert caught.value.residual == pytest.approx(0.8, abs=1e-6)
    assert caught.value.best.equilibrium.tip_position == pytest.approx([0.0, 1.2, 0.0], abs=1e-3)


def test_unreachable_under_load_is_the_best_that_scipy_finds(arm: sr.SoftModel) -> None:
    target = np.array([1.1, 0.3, 0.5])
    with pytest.raises(sr.TargetUnreachable) as caught:
        sr.solve_ik(arm, target, FORCE)

    def distance(motors: np.ndarray) -> float:
        springs = sr.solve_equilibrium(arm, motors, FORCE).q_springs
        q = [motors[0], motors[1], springs[0], springs[1], motors[2], springs[2], springs[3]]
        return float(np.linalg.norm(flexible_table(np.array(q))[-1][:3, 3] - target))

    options = {"xatol": 1e-9, "fatol": 1e-12, "maxiter": 4000}
    starts = ([0.3, 0.5, 0.1], [0.3, 0.4, -0.3])
    best = min(minimize(distance, start, method="Nelder-Mead", options=options).fun for start in starts)
    assert caught.value.residual == pytest.approx(best, abs=1e-6)


@each_row(
    ("options", "message"),
    [
        ({"target": (1, 0)}, "target"),
        ({"target": (1, 0, float("nan"))}, "target"),
        ({"q_motors0": (0, 0)}, "q_motors0"),
        ({"q_motors0": (0, 0, 4.0)}, "q_motors0.*within the motor limits"),
        ({"elbow": "left"}, "elbow = 'left'.*'up', 'down'"),
        ({"method": "paper"}, "method"),
        ({"tolerance": -1e-9}, "tolerance"),
        ({"starts": 0}, "starts"),
        ({"force": (1, 2)}, "force"),
        ({"gravity": "down"}, "gravity"),
    ],
)
def test_bad_input_is_refused(arm: sr.SoftModel, options: dict, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        sr.solve_ik(arm, **({"target": (0.7, 0.2, 0.4)} | options))


def test_a_robot_without_motors_is_refused() -> None:
    with pytest.raises(sr.ParameterError, match="at least one motor"):
        sr.solve_ik(sr.load_model(sr.InflatableArm(), motors=[]), (1, 0, 0))


@pytest.mark.parametrize("way", [(0.02, 0.0, 0.0), (0.0, 0.03, -0.01), (0.001, 0.002, 0.03)])
def test_a_refused_step_is_tried_again_less_far(
    arm: sr.SoftModel, monkeypatch: pytest.MonkeyPatch, way: tuple[float, float, float]
) -> None:
    """Where nothing but the start has an equilibrium, a search tries shorter and shorter steps, and ends after few.

    Damping grows threefold from a third of the least singular value; far beyond the others it shortens steps ninefold.
    """
    start, solve = np.array([0.3, 0.6, -0.8]), LoadedTip.solve
    there = sr.solve_equilibrium(arm, start, FORCE)
    tried: list[float] = []

    def shy(tip: LoadedTip, q_motors: np.ndarray, springs: np.ndarray) -> object:
        tried.append(float(np.linalg.norm(q_motors - start)))
        return None if len(tried) > 1 else solve(tip, q_motors, springs)

    monkeypatch.setattr(LoadedTip, "solve", shy)
    tip = LoadedTip(arm, Goal(there.tip_position + way), Load.of(arm, FORCE))
    found = search(tip, start, there.q_springs, damping=WARM_DAMPING)
    assert found is not None
    assert not found.arrived(TOLERANCE)
    lengths = np.array(tried[1:])
    assert 3 <= len(lengths) <= 10
    assert (lengths[1:] < 0.995 * lengths[:-1]).all()  # the third of the least value takes 8 % off its direction
    assert (lengths[5:] < 0.2 * lengths[4:-1]).all()
