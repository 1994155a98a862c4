"""Tendons that reach and feel: inverse kinematics with tensions that are limited and least, loads from tensions."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize, nnls

import softrobots as sr

DOWN = sr.EARTH_GRAVITY
ROBOTS: dict[str, Any] = {
    "elastic": sr.TendonArm(),
    "tension": sr.TendonArm(kind="tension"),
    "length": sr.TendonArm(kind="length"),
    "least tension": sr.TendonArm(tendon_least_tension=1.0),
    "mixed": sr.TendonArm(kind=("tension", "elastic", "elastic")),
    "helical": sr.TendonArm(
        segment_lengths=(0.2,),
        elastic_sections=4,
        routing=[sr.Route(at=(0.0, 0.2), azimuth=(a, a + b), distance=0.0045) for b in (0.0, 1.5) for a in (0.0, 2.1, 4.2)],
    ),
    "pressure": sr.PccArm(kind="pressure"),
    "mckibben": sr.PccArm(kind="mckibben"),
}


@cache
def model(name: str) -> sr.SoftModel:
    return sr.load_model(ROBOTS[name])


def reached(arm: sr.SoftModel, rng: np.random.Generator) -> sr.Equilibrium:
    """An equilibrium with motors that pull at random, within the limits of tensions."""
    kinds = [muscle.kind for muscle in arm.muscles]
    share = rng.uniform(0.0, 1.0, arm.n_motors)
    if "length" in kinds:
        free = sr.load_model(ROBOTS["tension"])
        posture = sr.solve_equilibrium(free, 1.0 + 10.0 * share, gravity=DOWN)
        return sr.solve_equilibrium(arm, posture.muscle_lengths, gravity=DOWN)
    scale = {"elastic": -0.004, "tension": 10.0, "pressure": 8e4, "mckibben": 8e4}
    step = np.array([scale[kind] for kind in kinds]) * (0.25 + share)
    return sr.solve_equilibrium(arm, arm.relaxed_motors + step, gravity=DOWN if arm.reach < 0.5 else None)


def differences(arm: sr.SoftModel, at: sr.Equilibrium, step: float = 1e-5) -> tuple[np.ndarray, np.ndarray]:
    """Tip and tensions by independent changes of the motors: central differences of solved equilibria."""
    tips, tensions = [], []
    for column in arm.actuators.basis.T:
        ends = [
            sr.solve_equilibrium(arm, motors, gravity=at.load.gravity, q_springs0=at.q_springs, tolerance=1e-12)
            for motors in (at.q_motors + step * column, at.q_motors - step * column)
            if arm.actuators.admit(motors)  # no negative pressure of a McKibben muscle
        ] + [at]
        width = step * (len(ends) - 1)
        tips.append((ends[0].tip_position - ends[1].tip_position) / width)
        tensions.append((ends[0].muscle_forces - ends[1].muscle_forces) / width)
    return np.array(tips).T, np.array(tensions).T


@pytest.mark.study
@pytest.mark.parametrize("name", ROBOTS)
def test_targets_are_reached_within_all_limits_with_least_tension(name: str, rng: np.random.Generator) -> None:
    """The conditions of Karush, Kuhn and Tucker, with differences of solved equilibria as derivatives.

    At the solution the gradient of the squared tensions, beyond pretension, is a sum of gradients of the tip and of reached
    limits, those with multipliers that are not negative: nonnegative least squares find them. Both differences and the search,
    which ends at steps of 1e-6, leave a thousandth of the gradient.
    """
    arm = model(name)
    sought = reached(arm, rng)
    assert sought.within_limits
    found = sr.solve_ik(arm, sought.tip_position, gravity=sought.load.gravity)
    at = found.equilibrium
    assert at.within_limits
    assert at.stable
    assert found.error <= 1e-9
    wanted = np.array([max(tag.weakest, tag.pretension if tag.kind == "elastic" else 0.0) for tag in arm.muscles])
    wanted[[tag.kind in ("pressure", "mckibben") for tag in arm.muscles]] = 0.0
    beyond = at.muscle_forces - wanted
    tip, tension = differences(arm, at)
    low, high = arm.actuators.muscle_forces.T
    at_limit = [-tension[at.muscle_forces < low + 1e-5], tension[at.muscle_forces > high - 1e-5]]
    least, most = arm.motor_limits.T
    units = arm.actuators.basis / arm.motor_scale[:, None]
    near = 1e-9 * arm.motor_scale
    rows = np.concatenate([tip, -tip, *at_limit, -units[at.q_motors < least + near], units[at.q_motors > most - near]])
    gradient = tension.T @ beyond
    normals = rows.T / np.maximum(np.linalg.norm(rows, axis=1), 1e-12)
    assert nnls(normals, -gradient)[1] <= 1e-3 * np.linalg.norm(gradient) + 1e-9


@pytest.mark.study
@pytest.mark.parametrize(
    ("seed", "stretch"), [(6, 0.2), (27, 0.2), (29, 0.2), (38, 0.2), (6, 0.01451), (27, 0.01115), (22, 0.01267)]
)
def test_least_tensions_are_those_of_scipy(seed: int, stretch: float) -> None:
    """SLSQP from beside them; the tip, reached to 1e-9 of 0.12 m, leaves some millionths. Limits stop drifts on the way.

    With a stretch that is hardly more than that of the tensions which made the tip, lengths are at their limits, too.
    """
    limits: dict[str, Any] = {"tendon_contraction": stretch, "tendon_extension": stretch}
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.06), elastic_sections=1, kind="tension", **limits))
    rest, rng = np.array([tag.rest_length for tag in arm.muscles]), np.random.default_rng(seed)
    target = sr.solve_equilibrium(arm, rng.uniform(0.0, 4.0, 6)).tip_position
    solution = sr.solve_ik(arm, target)
    assert solution.equilibrium.within_limits
    stretches = np.abs(solution.equilibrium.muscle_lengths / rest - 1.0)
    assert (stretches.max() > stretch - 1e-8) == (stretch < 0.2)
    found = solution.q_motors
    solved = cache(lambda *tensions: sr.solve_equilibrium(arm, tensions))
    reaching = {
        "type": "eq",
        "fun": lambda tensions: 100.0 * (solved(*tensions).tip_position - target),
        "jac": lambda tensions: 100.0 * sr.elastostatic_jacobian(arm, solved(*tensions)),
    }
    kept = {"type": "ineq", "fun": lambda tensions: stretch - np.abs(solved(*tensions).muscle_lengths / rest - 1.0)}
    least = minimize(
        lambda tensions: (tensions @ tensions, 2.0 * tensions),
        found + rng.uniform(0.0, 0.1, 6),
        jac=True,
        bounds=[(0.0, None)] * 6,
        constraints=[reaching, kept],
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
    )
    assert np.linalg.norm(solved(*least.x).tip_position - target) < 1e-12
    assert np.linalg.norm(found) <= (1.0 + 1e-5) * np.linalg.norm(least.x)


def least_of_six(kind: str, target: np.ndarray, force: tuple[float, ...] | None = None) -> sr.IkSolution:
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.0625), elastic_sections=2, kind=kind))
    return sr.solve_ik(arm, target, force, gravity=DOWN)


def test_given_lengths_find_the_tensions_that_given_tensions_find() -> None:
    """The set of tensions that hold a tip is the same, whatever is given; both searches end at steps of 1e-6 of the scale."""
    target = np.array((0.0279773, 0.0004087, 0.118221))
    held, pulled = (least_of_six(kind, target, (0.05, 0.02, -0.03)) for kind in ("length", "tension"))
    assert held.equilibrium.stable
    assert held.equilibrium.within_limits
    assert held.error <= 1e-9
    assert np.abs(held.equilibrium.muscle_forces - pulled.equilibrium.muscle_forces).max() <= 1e-4
    compiled = sr.compile(held.equilibrium.model).inverse_kinematics(target, (0.05, 0.02, -0.03), gravity=DOWN)
    assert np.abs(compiled.q_motors[0] - held.q_motors).max() <= 1e-8


@pytest.mark.study
def test_given_lengths_need_no_more_than_tensions_known_to_suffice(rng: np.random.Generator) -> None:
    """Tips held with some tendons slack: neither more than given tensions find, nor than those that made the tip."""
    for _ in range(15):
        tensions = rng.uniform(0.0, 3.0, 6) * (rng.uniform(size=6) < 0.6)
        free = sr.load_model(sr.TendonArm(segment_lengths=(0.06, 0.0625), elastic_sections=2, kind="tension"))
        target = sr.solve_equilibrium(free, tensions, gravity=DOWN).tip_position
        held, pulled = (least_of_six(kind, target) for kind in ("length", "tension"))
        size = np.linalg.norm(held.equilibrium.muscle_forces)
        assert held.equilibrium.within_limits
        assert held.error <= 1e-9
        assert size <= 1.0001 * np.linalg.norm(pulled.equilibrium.muscle_forces) + 1e-5
        assert size <= 1.0001 * np.linalg.norm(tensions) + 1e-5


@pytest.mark.study
@pytest.mark.parametrize("kind", ["length", "elastic"])
def test_a_workspace_has_only_what_tendons_can_hold(kind: str) -> None:
    """Every sample, solved again, is within all limits: none pushes; the others are counted as refused."""
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06,), elastic_sections=1, kind=kind))
    sampled = sr.sample_workspace(arm, 20, gravity=DOWN)
    assert 4 <= len(sampled.q_motors) == 20 - sampled.refused
    for motors, springs, tip in zip(sampled.q_motors, sampled.q_springs, sampled.tip_positions, strict=True):
        again = sr.solve_equilibrium(arm, motors, gravity=DOWN, q_springs0=springs)
        assert again.within_limits
        assert again.stable
        assert np.abs(again.tip_position - tip).max() <= 1e-9  # as the residual leaves it


@pytest.mark.parametrize(
    ("robot", "height"),
    [
        (sr.PccArm(kind="elastic"), 1.048),
        (sr.PccArm(kind="elastic", routing="base"), 1.048),
        (sr.PccArm(kind="elastic", segment_lengths=(0.3,)), 0.3),
    ],
)
def test_tips_that_only_slack_tendons_leave_alone_are_reached(robot: sr.PccArm, height: float) -> None:
    """The straight arm at rest length: its pretension shortens it, so that all tendons hang slack there, to 1e-9 m."""
    found = sr.solve_ik(sr.load_model(robot), (0.0, 0.0, height))
    assert found.error <= 1e-9
    assert found.equilibrium.muscle_forces.max() <= 1e-4  # N; EA over a metre times 1e-9 m


@pytest.mark.study
@pytest.mark.parametrize("name", ["elastic", "tension", "length"])
def test_poses_and_directions_are_reached_with_nine_tendons(name: str, rng: np.random.Generator) -> None:
    """A pose has six conditions, a direction five: both are met within the limits of all tensions."""
    arm = model(name)
    sought = sr.solve_equilibrium(model("tension"), rng.uniform(1.0, 8.0, 9), gravity=DOWN)
    turn = sought.transform_tip_to_world.rotation
    pose = sr.solve_ik(arm, sought.transform_tip_to_world, gravity=DOWN)
    pointing = sr.solve_ik(arm, sought.tip_position, orientation=turn[:, 2], gravity=DOWN)
    for found in (pose, pointing):
        tip = found.equilibrium.transform_tip_to_world
        assert found.equilibrium.within_limits
        assert np.linalg.norm(tip.translation - sought.tip_position) <= 1e-9
        assert np.linalg.norm(np.cross(tip.rotation[:, 2], turn[:, 2])) <= 1e-9
    assert np.linalg.norm(pose.equilibrium.transform_tip_to_world.rotation - turn) <= 1e-8


@pytest.mark.study
@pytest.mark.parametrize("name", ["elastic", "tension"])
def test_a_closed_path_is_followed_within_all_limits(name: str) -> None:
    """A round of 40 mm about the axis, on which some tendons are just taut."""
    turn = np.linspace(0.3, 0.3 + 2.0 * np.pi, 9)
    path = np.stack([0.04 * np.cos(turn), 0.04 * np.sin(turn), np.full(9, 0.16)], axis=1)
    followed = sr.follow_trajectory(model(name), path, gravity=DOWN)
    assert followed.tip_error.max() <= 1e-9
    assert all(at.within_limits and at.stable for at in followed.equilibria)
    assert min(at.muscle_forces.min() for at in followed.equilibria) >= 0.0


FELT = {
    "elastic": ROBOTS["elastic"],
    "length": ROBOTS["length"],
    "mckibben": ROBOTS["mckibben"],
    "mixed": ROBOTS["mixed"],
    "helical": ROBOTS["helical"],
}


def loaded(arm: sr.SoftModel, rng: np.random.Generator) -> tuple[np.ndarray, sr.Equilibrium]:
    """A random force that moves the tip some per cent of the reach, and the robot under it."""
    still = reached(arm, rng)
    force = rng.normal(size=3)
    tip = sr.compliance(arm, still)[:3, :3]
    force *= 0.03 * arm.reach / np.linalg.norm(tip @ force)
    return force, sr.solve_equilibrium(arm, still.q_motors, force, gravity=still.load.gravity, tolerance=1e-12)


@pytest.mark.study
@pytest.mark.parametrize("name", FELT)
def test_a_load_is_read_from_tensions(name: str, rng: np.random.Generator) -> None:
    """Forward and back: the force comes back to the tolerance of the torques, 1e-10, over the least singular value."""
    arm = model(name)
    force, under = loaded(arm, rng)
    measured = np.array(under.muscle_forces)
    measured[[tag.kind == "tension" for tag in arm.muscles]] = 0.0  # not used
    found = sr.estimate_load(arm, under.q_motors, measured, gravity=under.load.gravity, restart=False, torque_std=0.1)
    assert len(found.unobservable_directions) == 0
    assert np.linalg.norm(found.force - force) <= 1e-6 * np.linalg.norm(force)
    assert np.abs(found.equilibrium.tip_position - under.tip_position).max() <= 1e-8 * arm.reach
    # The derivative of the tensions by the force, against differences of solved equilibria.
    step, slope = 1e-4 * float(np.linalg.norm(force)), []
    for axis in np.eye(3):
        ends = [
            sr.solve_equilibrium(
                arm, under.q_motors, force + sign * step * axis, gravity=under.load.gravity, tolerance=1e-12
            ).muscle_forces
            for sign in (1.0, -1.0)
        ]
        slope.append((ends[0] - ends[1]) / (2.0 * step))
    by_force = np.array(slope).T
    assert np.allclose(np.linalg.svd(by_force)[1], found.singular_values, rtol=1e-5, atol=1e-7)
    assert found.covariance is not None
    expected = 0.1**2 * np.linalg.inv(by_force.T @ by_force)
    assert np.allclose(found.covariance, expected, rtol=1e-4, atol=1e-6 * np.abs(expected).max())


def test_slack_tendons_feel_nothing(rng: np.random.Generator) -> None:
    """Two taut tendons of three feel two directions at most; of three slack ones none is left."""
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06,), tendon_pretension=0.0))
    motors = arm.relaxed_motors + (-0.004, 0.006, -0.002)
    under = sr.solve_equilibrium(arm, motors, (0.01, 0.02, 0.0))
    assert under.muscle_slack == (False, True, False)
    found = sr.estimate_load(arm, motors, under.muscle_forces, restart=False)
    assert len(found.unobservable_directions) >= 1
    assert found.singular_values[2] == 0.0


@pytest.mark.parametrize("robot", [sr.TendonArm(segment_lengths=(0.06,), elastic_sections=1), ROBOTS["mckibben"]])
def test_what_only_pulls_has_no_tension_below_zero(robot: Any) -> None:
    """Before a search, in both solvers; noise of a known size may be below zero."""
    arm = sr.load_model(robot)
    tensions = np.full(arm.n_motors, 5.0)
    tensions[1] = -1.0
    for call in (sr.compile(arm, backend="python").estimate_load, partial(sr.estimate_load, arm)):
        with pytest.raises(sr.ParameterError, match=rf"0 or above, within a tenth of the largest, of {arm.motor_joints[1]}, "):
            call(arm.relaxed_motors, tensions)
    free = sr.solve_equilibrium(arm, arm.relaxed_motors)
    noise = np.where(np.arange(arm.n_motors) == 1, -0.1 - free.muscle_forces, 0.0)
    found = sr.estimate_load(
        arm, arm.relaxed_motors, free.muscle_forces + noise, torque_std=100.0, restart=False, max_iterations=5
    )
    assert found.measured_torques[1] == pytest.approx(-0.1, rel=1e-12)


def test_tensions_are_told_in_newtons() -> None:
    arm = sr.load_model(sr.TendonArm(segment_lengths=(0.06,), elastic_sections=1))
    with pytest.raises(sr.LoadNotFound, match=r"\] by 'newton' in \d+ iterations: [\d.]+ N remain$"):
        sr.estimate_load(arm, arm.relaxed_motors, (1e3, 1.0, 1.0), restart=False, max_iterations=5)


@pytest.mark.parametrize("name", ["tension", "pressure"])
def test_given_forces_feel_no_load(name: str) -> None:
    arm = model(name)
    with pytest.raises(sr.ParameterError, match=r"elastic tendons or McKibben muscles: given forces feel no load"):
        sr.estimate_load(arm, np.zeros(arm.n_motors), np.zeros(arm.n_motors))


@pytest.mark.parametrize("name", ["elastic", "mixed", "mckibben"])
def test_jacobian_and_compliance_are_derivatives_of_equilibria(name: str, rng: np.random.Generator) -> None:
    """Against central differences, to their error of second order."""
    arm = model(name)
    at = reached(arm, rng)
    expected, _ = differences(arm, at)
    jacobian = sr.elastostatic_jacobian(arm, at) @ arm.actuators.basis
    assert np.abs(jacobian - expected).max() <= 1e-7 * np.abs(expected).max()
    tip = sr.compliance(arm, at)[:3, :3]
    step, moved = 1e-3 * arm.reach / np.abs(tip).max(), []
    for axis in np.eye(3):
        ends = [
            sr.solve_equilibrium(arm, at.q_motors, sign * step * axis, gravity=at.load.gravity, q_springs0=at.q_springs)
            for sign in (1.0, -1.0)
        ]
        moved.append((ends[0].tip_position - ends[1].tip_position) / (2.0 * step))
    assert np.abs(np.array(moved).T - tip).max() <= 1e-5 * np.abs(tip).max()


@pytest.mark.study
def test_a_pushed_arm_buckles_where_its_last_tendons_go_slack() -> None:
    """Knees on the path of a load: the push shortens the arm until its tendons are slack.

    All slack, the arm is a column of Euler's load EI pi^2 / (4 L^2), to the order of its sections. Tendons along the first
    segment, of length h, go slack at the push T0 EA / (k h); where that is above Euler's load, stability ends there.
    """
    arm = sr.TendonArm(tendon_pretension=0.001)
    modulus, radius, length = 50e9, 0.0005, 0.1865
    euler = modulus * np.pi * radius**4 / 4.0 * np.pi**2 / (4.0 * length**2)
    bare = sr.load_model(arm)
    assert sr.critical_load(bare, bare.relaxed_motors, (0, 0, -1)) == pytest.approx(euler, rel=2e-3)
    held = sr.load_model(sr.TendonArm(tendon_pretension=0.004))
    knee = 0.004 * modulus * np.pi * radius**2 / (8e3 * 0.060)
    assert knee > 1.5 * euler
    assert sr.critical_load(held, held.relaxed_motors, (0, 0, -1)) == pytest.approx(knee, rel=1e-6)


@pytest.mark.study
@pytest.mark.parametrize(("chain", "fields"), [("sections", {"elastic_sections": 2}), ("lumped", {"hinges": 4})])
def test_an_arm_snaps_where_a_tendon_goes_slack(chain: str, fields: dict[str, int]) -> None:
    """Pushed from above, the bent arm is stable until a tendon goes slack: there the tangent jumps, and it snaps aside."""
    model = sr.load_model(sr.TendonArm(chain=chain, **fields))
    motors = model.relaxed_motors - np.array([0.3e-3, *[0.0] * 8])
    critical = sr.critical_load(model, motors, (0.0, 0.0, -1.0))
    springs, taut = None, None
    for share in (0.5, 0.8, 0.95, 0.99, 0.999, 0.9999):
        found = sr.solve_equilibrium(model, motors, (0.0, 0.0, -share * critical), q_springs0=springs)
        assert found.stable
        springs, taut = found.q_springs, min(found.muscle_forces)
    assert 0.0 < taut < 0.02
    beyond = sr.solve_equilibrium(model, motors, (0.0, 0.0, -1.0005 * critical), q_springs0=springs)
    assert np.abs(beyond.q_springs - springs).max() > 0.3
