"""Inverse kinematics over muscles: the loaded tip arrives, with least change, within the limits; and what cannot be reached."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from scipy.linalg import null_space
from scipy.optimize import minimize

import softrobots as sr
from softrobots.constant_curvature import arc_from_muscles, chain_muscle_jacobian, chain_transform, muscle_residual
from tests.support.tables import each_row

POSITION = 1e-9  # what `solve_ik` promises [m]
ANGLE = 1e-9  # and for orientations [rad]
FORCE = np.array([0.8, -1.2, -0.5])


@cache
def model(muscles: str = "lengths", **fields) -> sr.SoftModel:
    return sr.load_model(sr.PccArm(**fields), muscles=muscles)


def inside(rng: np.random.Generator, arm: sr.SoftModel, share: float = 0.6) -> np.ndarray:
    """Actuators in the middle `share` of their limits; no more than three muscles a segment."""
    low, high = arm.motor_limits.T
    drawn: np.ndarray = 0.5 * (low + high) + 0.5 * share * (high - low) * rng.uniform(-1, 1, len(low))
    return drawn


def within(arm: sr.SoftModel, motors: np.ndarray) -> bool:
    low, high = arm.motor_limits.T
    return bool(np.all((motors >= low) & (motors <= high)))


def angle_between(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.linalg.norm(pin.log3(one @ other.T)))


# ---------------------------------------------------------------------------------------------------------------------------
# Targets that can be reached


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, sr.EARTH_GRAVITY])
@pytest.mark.parametrize("segments", [1, 2, 3])
def test_the_loaded_tip_arrives(segments: int, gravity: tuple | None, rng: np.random.Generator) -> None:
    """Targets are tips of random lengths under the same load; the answer is solved again from the relaxed arm."""
    arm = model(segment_lengths=(0.524,) * segments, elastic_sections=2)
    for _ in range(1 if segments == 1 else 3):  # three muscles: every search of all starts is made
        lengths, force = inside(rng, arm), rng.uniform(-1.5, 1.5, 3)
        target = sr.solve_equilibrium(arm, lengths, force, gravity=gravity).tip_position
        found = sr.solve_ik(arm, target, force, gravity=gravity, starts=8)
        again = sr.solve_equilibrium(arm, found.q_motors, force, gravity=gravity)
        assert found.error <= POSITION
        assert np.linalg.norm(again.tip_position - target) < 2 * POSITION
        assert np.abs(again.q_springs - found.equilibrium.q_springs).max() < 1e-8
        assert found.equilibrium.stable
        assert within(arm, found.q_motors)
        assert (found.orientation, found.orientation_error) == (None, 0.0)


def test_a_lumped_arm_arrives(rng: np.random.Generator) -> None:
    arm = model(chain="lumped", hinges=4)
    target = sr.solve_equilibrium(arm, inside(rng, arm), FORCE, gravity=sr.EARTH_GRAVITY).tip_position
    found = sr.solve_ik(arm, target, FORCE, gravity=sr.EARTH_GRAVITY)
    again = sr.solve_equilibrium(arm, found.q_motors, FORCE, gravity=sr.EARTH_GRAVITY)
    assert np.linalg.norm(again.tip_position - target) < 2 * POSITION
    assert within(arm, found.q_motors)


def test_one_segment_without_load_is_the_inverse_of_the_arc() -> None:
    """Tip of an arc: bending 2 atan2(hypot(x, y), z), length chord (theta/2) / sin(theta/2); the only lengths there are."""
    arm = model(segment_lengths=(0.524,), elastic_sections=2)
    target = np.array([0.10, -0.06, 0.49])
    bending, azimuth = 2.0 * np.arctan2(np.hypot(*target[:2]), target[2]), np.arctan2(target[1], target[0])
    length = np.linalg.norm(target) * (bending / 2) / np.sin(bending / 2)
    expected = length - bending * 0.04 * np.cos(azimuth - np.array([0.0, -2 * np.pi / 3, 2 * np.pi / 3]))
    found = sr.solve_ik(arm, target, starts=6)
    assert found.q_motors == pytest.approx(expected, abs=1e-9)
    assert found.alternatives == ()


def test_tensions_bring_the_tip_there_too(rng: np.random.Generator) -> None:
    arm = model("forces", elastic_sections=2)
    for gravity in (None, (0, 0, 9.81)):  # hanging upside down, so that no tension buckles it
        tensions, force = rng.uniform(-30, 30, 6), rng.uniform(-0.5, 0.5, 3)
        target = sr.solve_equilibrium(arm, tensions, force, gravity=gravity).tip_position
        found = sr.solve_ik(arm, target, force, gravity=gravity)
        again = sr.solve_equilibrium(arm, found.q_motors, force, gravity=gravity)
        assert np.linalg.norm(again.tip_position - target) < 2 * POSITION
        assert again.stable
        assert within(arm, found.q_motors)
        assert np.linalg.norm(found.q_motors) <= np.linalg.norm(tensions) * (1 + 1e-6)  # from zero: no more than what there is


@pytest.mark.study
@pytest.mark.parametrize("azimuths", [(0.0, np.pi / 2, np.pi, -np.pi / 2), (0.2, 1.3, 2.9, 4.4)])
def test_four_muscles_stay_consistent(azimuths: tuple) -> None:
    arm = model(muscle_azimuths=azimuths, elastic_sections=2)
    bends = np.array([[0.25, -0.4, 0.01], [-0.3, 0.2, -0.005]])  # a, b, elongation of each segment
    arms = np.column_stack([0.04 * np.sin(azimuths), -0.04 * np.cos(azimuths), np.ones(4)])
    lengths = (0.524 + bends @ arms.T).ravel()
    target = sr.solve_equilibrium(arm, lengths, FORCE).tip_position
    found = sr.solve_ik(arm, target, FORCE)
    assert found.error <= POSITION
    assert within(arm, found.q_motors)
    assert muscle_residual(found.q_motors.reshape(2, 4), 0.04, azimuths).max() < 1e-6
    again = sr.solve_equilibrium(arm, found.q_motors, FORCE)
    assert np.linalg.norm(again.tip_position - target) < 2 * POSITION
    with pytest.raises(sr.TargetUnreachable) as caught:
        sr.solve_ik(arm, (0.9, 0.3, 1.0), FORCE, starts=3)
    assert within(arm, caught.value.best.q_motors)
    assert muscle_residual(caught.value.best.q_motors.reshape(2, 4), 0.04, azimuths).max() < 1e-6


# ---------------------------------------------------------------------------------------------------------------------------
# Least change


@pytest.mark.parametrize("muscles", ["lengths", "forces"])
def test_the_change_is_orthogonal_to_what_does_not_move_the_tip(muscles: str, rng: np.random.Generator) -> None:
    """KKT without active limits: the change over the scale of each actuator has no part in the null space of the Jacobian.

    The search ends when that part is below 1e-6 in each actuator: 1e-6 sqrt(6) of a change of about 1."""
    arm = model(muscles, elastic_sections=2, muscle_distance=(0.04, 0.03))
    scale = arm.motor_scale
    for _ in range(3):
        goal, start = inside(rng, arm, 0.5 if muscles == "lengths" else 0.05), inside(rng, arm, 0.2 * (muscles == "lengths"))
        target = sr.solve_equilibrium(arm, goal, FORCE, gravity=(0, 0, 9.81)).tip_position
        found = sr.solve_ik(arm, target, FORCE, gravity=(0, 0, 9.81), q_motors0=start)
        low, high = arm.motor_limits.T
        assert np.all((found.q_motors > low) & (found.q_motors < high))  # no limit is active in these cases
        change = (found.q_motors - start) / scale
        idle = null_space(sr.elastostatic_jacobian(arm, found.equilibrium) * scale, rcond=1e-9)
        assert idle.shape == (6, 3)
        assert np.linalg.norm(change) > 0.05
        assert np.linalg.norm(idle.T @ change) < 3e-6
        assert np.linalg.norm(change) <= np.linalg.norm((goal - start) / scale) + 1e-6


def test_given_tensions_keep_the_limits_of_lengths_where_they_push_too(rng: np.random.Generator) -> None:
    """Targets that random tensions reach: least change alone goes beyond the lengths of two of them (within_limits false)."""
    arm = sr.load_model(
        sr.PccArm(
            kind="tension", segment_lengths=(0.5, 0.5), elastic_sections=1, muscle_contraction=0.08, muscle_extension=0.08
        )
    )
    for _ in range(3):
        target = sr.solve_equilibrium(arm, rng.uniform(-60.0, 60.0, 6)).tip_position
        found = sr.solve_ik(arm, target)
        assert found.equilibrium.within_limits
        assert np.linalg.norm(found.equilibrium.tip_position - target) < POSITION


def tip_of(lengths: np.ndarray) -> np.ndarray:
    """Unloaded tip of the paper's arm in closed form."""
    tip: np.ndarray = chain_transform(arc_from_muscles(lengths.reshape(-1, 3), 0.04))[:3, 3]
    return tip


def slope_of(lengths: np.ndarray) -> np.ndarray:
    slope: np.ndarray = chain_muscle_jacobian(lengths.reshape(-1, 3), 0.04)[:3]
    return slope


LOW, HIGH = 0.524 * 0.85, 0.524 * 1.15


@pytest.mark.parametrize(
    ("target", "active"), [((0.25, -0.15, 0.95), False), ((-0.30, 0.35, 0.85), False), ((0.254, 0.166, 1.144), True)]
)
def test_the_least_change_is_the_one_that_scipy_finds(target: tuple, active: bool) -> None:
    """SLSQP on the unloaded closed form, with limits active and without; it stops at changes of 1e-14, the search at 1e-6."""
    found = sr.solve_ik(model(elastic_sections=1), target)
    start = np.full(6, 0.524)
    best = minimize(
        lambda x: 0.5 * x @ x,  # x: change over the distance
        (found.q_motors - start) / 0.04 + 0.02 * np.array([1, -1, 1, 1, -1, -1]),
        jac=lambda x: x,
        bounds=[((LOW - 0.524) / 0.04, (HIGH - 0.524) / 0.04)] * 6,
        constraints={
            "type": "eq",
            "fun": lambda x: tip_of(start + 0.04 * x) - target,
            "jac": lambda x: 0.04 * slope_of(start + 0.04 * x),
        },
        method="SLSQP",
        options={"ftol": 1e-14, "maxiter": 300},
    )
    assert np.linalg.norm(tip_of(start + 0.04 * best.x) - target) < 1e-8
    at_limit = np.minimum(found.q_motors - LOW, HIGH - found.q_motors).min() < 1e-9
    assert at_limit == active
    assert 0.5 * np.sum(((found.q_motors - start) / 0.04) ** 2) <= best.fun + 1e-5
    assert np.abs(found.q_motors - start - 0.04 * best.x).max() < 1e-5


# ---------------------------------------------------------------------------------------------------------------------------
# Orientation


@pytest.mark.parametrize("segments", [2, 3])
def test_an_orientation_is_met(segments: int, rng: np.random.Generator) -> None:
    arm = model(segment_lengths=(0.524,) * segments, elastic_sections=2)
    lengths = inside(rng, arm)
    pose = sr.solve_equilibrium(arm, lengths, FORCE, gravity=sr.EARTH_GRAVITY).transform_tip_to_world
    found = sr.solve_ik(arm, pose.translation, FORCE, gravity=sr.EARTH_GRAVITY, orientation=pose.rotation, starts=5)
    again = sr.solve_equilibrium(arm, found.q_motors, FORCE, gravity=sr.EARTH_GRAVITY).transform_tip_to_world
    assert (found.error <= POSITION, found.orientation_error <= ANGLE) == (True, True)
    assert np.linalg.norm(again.translation - pose.translation) < 2 * POSITION
    assert angle_between(again.rotation, pose.rotation) < 2 * ANGLE
    assert within(arm, found.q_motors)
    assert np.array_equal(found.orientation, pose.rotation)


@pytest.mark.parametrize("size", [1.0, 0.2, 1e6])
def test_a_direction_is_met_whatever_its_length(size: float, rng: np.random.Generator) -> None:
    arm = model(elastic_sections=2)
    pose = sr.solve_equilibrium(arm, inside(rng, arm), FORCE, gravity=sr.EARTH_GRAVITY).transform_tip_to_world
    pointing = pose.rotation[:, 2]
    found = sr.solve_ik(arm, pose.translation, FORCE, gravity=sr.EARTH_GRAVITY, orientation=size * pointing)
    again = sr.solve_equilibrium(arm, found.q_motors, FORCE, gravity=sr.EARTH_GRAVITY).transform_tip_to_world
    assert np.linalg.norm(again.translation - pose.translation) < 2 * POSITION
    assert np.linalg.norm(np.cross(again.rotation[:, 2], pointing)) < 2 * ANGLE
    assert again.rotation[:, 2] @ pointing > 0.0
    assert np.linalg.norm(found.orientation) == pytest.approx(1.0, abs=1e-15)


def test_an_orientation_out_of_reach_is_said() -> None:
    """Upside down at the height of a straight arm: the position alone is easy."""
    arm = model(elastic_sections=2)
    assert sr.solve_ik(arm, (0, 0, 1.0)).error <= POSITION
    with pytest.raises(sr.TargetUnreachable, match=r"in the target orientation.* and .* rad") as caught:
        sr.solve_ik(arm, (0, 0, 1.0), orientation=(0, 0, -1), starts=3)
    best = caught.value.best
    pointing = best.equilibrium.transform_tip_to_world.rotation[:, 2]
    assert best.orientation_error == pytest.approx(np.arccos(-pointing[2]), abs=1e-9)
    assert best.orientation_error > 0.1
    assert within(arm, best.q_motors)


@each_row(
    ("robot", "orientation", "freedom", "needed"),
    [
        (sr.InflatableArm(), np.eye(3), 3, 6),
        (sr.InflatableArm(), (0, 0, 1), 3, 5),
        (sr.PccArm(segment_lengths=(0.5,)), np.eye(3), 3, 6),
        (sr.PccArm(segment_lengths=(0.5,)), (0, 0, 1), 3, 5),
        (sr.PccArm(segment_lengths=(0.5,), muscle_azimuths=(0.0, 1.5, 3.1, 4.7, 5.5)), (0, 0, 1), 3, 5),  # five, of rank 3
    ],
)
def test_an_orientation_without_the_freedom_is_refused(
    robot: sr.InflatableArm | sr.PccArm, orientation: object, freedom: int, needed: int
) -> None:
    with pytest.raises(sr.ParameterError, match=rf"it has {freedom} freedoms, {needed} are needed") as caught:
        sr.solve_ik(sr.load_model(robot), (0.1, 0.0, 0.5), orientation=orientation)
    assert caught.value.field == "orientation"


@each_row(
    "orientation",
    [
        (0.0, 0.0, 0.0),
        (1.0, 0.0),
        (1.0, 0.0, 0.0, 0.0),  # no quaternions
        np.eye(2),
        np.eye(3)[None],
        np.eye(3)[:2],
        np.diag([1.0, 1.0, -1.0]),  # a reflection
        np.diag([1.0, 1.0, 1.0 + 1e-6]),
        np.array([[1.0, 1e-6, 0], [0, 1.0, 0], [0, 0, 1.0]]),
        np.zeros((3, 3)),
        2.0 * np.eye(3),
        (np.nan, 0.0, 1.0),
        np.full((3, 3), np.inf),
        "up",
        (True, False, False),
        1.0,
    ],
)
def test_bad_orientations_are_refused(orientation: object) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        sr.solve_ik(model(elastic_sections=2), (0.1, 0.1, 1.0), orientation=orientation)
    assert caught.value.field == "orientation"


# ---------------------------------------------------------------------------------------------------------------------------
# Targets that cannot be reached


# Rotation vector of a segment with three muscles over its lengths, (2, 3) [rad/m]: (34, 41) squared are a sum of these squares.
BENDING = np.array([[-2.0, 1.0, 1.0], [0.0, -np.sqrt(3.0), np.sqrt(3.0)]]) / (3 * 0.04)


def nearest(
    target: np.ndarray, rng: np.random.Generator, largest_bending: float = np.inf, limits: tuple = (LOW, HIGH)
) -> float:
    """Distance of the nearest tip within the limits, by SLSQP on the closed form from several starts.

    A segment may bend by `largest_bending` [rad].
    """

    def distance(lengths: np.ndarray) -> tuple[float, np.ndarray]:
        missing = tip_of(lengths) - target
        size = float(np.linalg.norm(missing))
        return size, slope_of(lengths).T @ missing / size

    def spare(lengths: np.ndarray) -> np.ndarray:
        return largest_bending**2 - np.sum((lengths.reshape(2, 3) @ BENDING.T) ** 2, axis=1)

    starts = [np.full(6, 0.524), *rng.uniform(LOW, HIGH, (8, 6))]
    common = {"jac": True, "bounds": [limits] * 6, "method": "SLSQP", "options": {"ftol": 1e-13, "maxiter": 500}}
    if np.isfinite(largest_bending):
        common["constraints"] = {"type": "ineq", "fun": spare}
        starts = [0.524 + 0.5 * (start - 0.524) for start in starts]  # within the range
    ended = [minimize(distance, start, **common) for start in starts]
    return min(float(end.fun) for end in ended if not np.isfinite(largest_bending) or spare(end.x).min() > -1e-9)


@pytest.mark.study
@pytest.mark.parametrize("target", [(-0.2, 1.2, 0.2), (0.05, 0.02, 0.3), (-0.4, 0.1, 0.2)])
def test_an_unreachable_target_comes_with_the_nearest_point(target: tuple, rng: np.random.Generator) -> None:
    """Outside the workspace, and in the void around the base that arcs cannot bend into."""
    arm = model(elastic_sections=2)
    with pytest.raises(sr.TargetUnreachable, match="cannot reach") as caught:
        sr.solve_ik(arm, target, starts=6)
    best = caught.value.best
    assert within(arm, best.q_motors)
    assert np.linalg.norm(best.equilibrium.tip_position - target) == pytest.approx(best.error, abs=1e-15)
    assert np.abs(tip_of(best.q_motors) - best.equilibrium.tip_position).max() < 1e-13
    assert caught.value.residual == best.error
    assert best.error <= nearest(np.array(target), rng) + 1e-6


@pytest.mark.study
@pytest.mark.parametrize("target", [(0.05, 0.02, 0.3), (0.0, 0.1, 0.15)])
def test_the_range_of_a_section_is_a_limit_like_any_other(target: tuple, rng: np.random.Generator) -> None:
    """One section may bend by 170 degrees, less than these limits of the muscles allow: the search slides along that.

    The limit is curved and the distance large: a search gains on it slowly, and ends within a centimetre of the nearest point.
    """
    arm = model(elastic_sections=1, muscle_contraction=0.3, muscle_extension=0.3)
    limits = (0.7 * 0.524, 1.3 * 0.524)
    least = nearest(np.array(target), rng, np.deg2rad(170.0), limits)
    if least < 1e-9:
        assert sr.solve_ik(arm, target).error <= 1e-9
        return
    with pytest.raises(sr.TargetUnreachable, match="cannot reach") as caught:
        sr.solve_ik(arm, target)
    assert within(arm, caught.value.best.q_motors)
    assert caught.value.residual <= least + 0.01


def test_straight_above_the_nearest_point_is_the_fully_stretched_arm() -> None:
    """Closed form: all muscles at their longest, 1.15 times 1.048 m."""
    with pytest.raises(sr.TargetUnreachable) as caught:
        sr.solve_ik(model(elastic_sections=1), (0, 0, 1.5), starts=4)
    assert caught.value.residual == pytest.approx(1.5 - 1.15 * 1.048, abs=1e-9)
    assert caught.value.best.q_motors == pytest.approx(np.full(6, HIGH), abs=1e-6)


@pytest.mark.study
def test_limits_are_never_exceeded_under_load(rng: np.random.Generator) -> None:
    """Narrow muscles: of targets of a wide arm some are reached and some not, all within the limits, to the last bit."""
    narrow, wide = (model(elastic_sections=2, muscle_contraction=c, muscle_extension=c) for c in (0.04, 0.15))
    reached = missed = 0
    for share in (0.2, 0.25, 0.3, 0.6, 0.8, 0.9):
        target = sr.solve_equilibrium(wide, inside(rng, wide, share), FORCE).tip_position
        try:
            found = sr.solve_ik(narrow, target, FORCE, starts=3)
            reached += 1
        except sr.TargetUnreachable as error:
            found = error.best
            missed += 1
        assert within(narrow, found.q_motors)
        assert all(within(narrow, other) for other in found.alternatives)
    assert reached > 0
    assert missed > 0


@each_row(
    ("options", "message"),
    [
        ({"q_motors0": np.full(6, 0.7)}, "q_motors0.*within the motor limits"),
        ({"q_motors0": np.full(5, 0.524)}, "q_motors0"),
        ({"q_motors0": [0.524] * 5 + [-0.5]}, "q_motors0.*positive muscle lengths"),
        ({"elbow": "up"}, "elbow.*None for this robot"),
        ({"target": (0.1, 0.2)}, "target"),
        ({"starts": 0}, "starts"),
    ],
)
def test_bad_input_is_refused(options: dict, message: str) -> None:
    with pytest.raises(sr.ParameterError, match=message):
        sr.solve_ik(model(elastic_sections=2), **({"target": (0.1, 0.1, 1.0)} | options))


def test_a_passive_rod_has_nothing_to_move() -> None:
    with pytest.raises(sr.ParameterError, match="at least one motor or muscle"):
        sr.solve_ik(sr.load_model(sr.PccArm(muscle_azimuths=(), elastic_sections=1)), (0, 0, 1.0))


# ---------------------------------------------------------------------------------------------------------------------------
# Trajectories


@pytest.mark.study
@pytest.mark.parametrize("gravity", [None, sr.EARTH_GRAVITY])
def test_a_straight_line_is_followed_with_continuous_lengths(gravity: tuple | None) -> None:
    """Every step is that of the loaded Jacobian's pseudo-inverse, the least change, up to second order: 10 % of 12 mm steps."""
    arm = model(elastic_sections=2)
    ends = np.array([[0.15, -0.10, 0.98], [0.22, -0.02, 0.94]])
    points = ends[0] + np.linspace(0, 1, 10)[:, None] * (ends[1] - ends[0])
    found = sr.follow_trajectory(arm, points, FORCE, gravity=gravity)
    assert found.tip_error.max() <= POSITION
    for motors, point in zip(found.q_motors, points, strict=True):
        assert within(arm, motors)
        assert np.linalg.norm(sr.solve_equilibrium(arm, motors, FORCE, gravity=gravity).tip_position - point) < 2 * POSITION
    for one, other in pairwise(found.equilibria):
        step = np.linalg.pinv(sr.elastostatic_jacobian(arm, one)) @ (other.tip_position - one.tip_position)
        assert np.linalg.norm(other.q_motors - one.q_motors - step) < 0.1 * np.linalg.norm(step)


def test_a_line_that_leaves_the_workspace_names_its_waypoint() -> None:
    points = np.column_stack(
        [np.zeros(6), np.zeros(6), np.linspace(1.1, 1.25, 6)]
    )  # 1.2052 m is the end: waypoint 5 is at 1.22
    with pytest.raises(sr.TargetUnreachable, match="waypoint 5 of 6"):
        sr.follow_trajectory(model(elastic_sections=1), points)


def test_tensions_follow_a_line() -> None:
    arm = model("forces", elastic_sections=2)
    points = np.array([0.05, 0.02, 1.03]) + np.linspace(0, 1, 5)[:, None] * [0.03, 0.02, -0.01]
    found = sr.follow_trajectory(arm, points, (0.2, 0.1, 0.3))
    assert found.tip_error.max() <= POSITION
    for one, other in pairwise(found.equilibria):
        assert np.abs(other.q_motors - one.q_motors).max() < 20.0  # 9 mm of tip a step: 0.1 rad, about 10 N
