"""The wrist of the inflatable arm: its kinematics, masses and limits, and full poses of the loaded tip."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy import optimize

import softrobots as sr
from softrobots.cli.main import main
from softrobots.statics.kinematics import frame_placement
from softrobots.statics.spherical_wrist import spherical_wrist

WRIST = (0.08, 0.12)
PUSH = (0.0, 10.0, -15.0)


@pytest.fixture(scope="module")
def wristed() -> sr.SoftModel:
    """The arm of the paper with a wrist."""
    return sr.load_model(sr.InflatableArm(wrist=WRIST))


def turn(axis: str, angle: float) -> np.ndarray:
    """Rotation about an axis of the world, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return {
        "-y": np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]]),
        "z": np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]),
        "x": np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]),
    }[axis]


# --- The robot


def test_the_tip_is_a_product_of_ten_rotations(wristed: sr.SoftModel) -> None:
    """Base to tip: z, -y, and the springs z, -y; -y, z, -y; then pitch -y, yaw z, roll x. Rounding of ten products: 1e-14."""
    random = np.random.default_rng(1)
    for _ in range(20):
        m, k = random.uniform(-1.9, 1.9, 6), random.uniform(-1.0, 1.0, 4)
        along = [
            ("z", m[0], 0.0), ("-y", m[1], 0.03), ("z", k[0], 0.0), ("-y", k[1], 0.57), ("-y", m[2], 0.03),
            ("z", k[2], 0.0), ("-y", k[3], 0.57 + WRIST[0]), ("-y", m[3], 0.0), ("z", m[4], 0.0), ("x", m[5], WRIST[1]),
        ]  # fmt: skip
        rotation, position = np.eye(3), np.zeros(3)
        for axis, angle, length in along:
            rotation = rotation @ turn(axis, angle)
            position = position + length * rotation[:, 0]
        pose = frame_placement(wristed, wristed.configuration(m, k), "tip")
        assert np.abs(pose.translation - position).max() < 1e-14
        assert np.abs(pose.rotation - rotation).max() < 1e-14


def test_without_a_wrist_nothing_changes_and_with_one_names_and_limits_go_on() -> None:
    robot = sr.InflatableArm(link_lengths=(0.5, 0.4, 0.3), wrist=(0.0, 0.1), wrist_limits=(1.0, 1.2, 2.5))
    model = sr.load_model(robot)
    assert model.motor_joints == tuple(f"motor_{i}" for i in range(1, 8))
    assert model.pinocchio.nv == robot.n_joints == 13
    assert model.motor_limits[-3:].tolist() == [[-1.0, 1.0], [-1.2, 1.2], [-2.5, 2.5]]
    assert model.reach == pytest.approx(1.3, abs=1e-12)
    assert "wrist" not in sr.InflatableArm().urdf()


def test_mass_and_centre_are_those_of_the_arm_and_of_a_tube() -> None:
    """At zero; the tube of the wrist has its centre in the middle. Sums of a dozen masses: 1e-14."""
    for wrist in (WRIST, (0.0, 0.1)):
        both = []
        for robot in (sr.InflatableArm(), sr.InflatableArm(wrist=wrist, wrist_mass=0.4)):
            model = sr.load_model(robot).pinocchio
            data = model.createData()
            pin.centerOfMass(model, data, pin.neutral(model))
            both.append((float(data.mass[0]), np.array(data.com[0])))
        (arm, centre), (mass, whole) = both
        assert mass == pytest.approx(arm + 0.4, abs=1e-14)
        assert whole == pytest.approx((arm * centre + 0.4 * np.array([1.2 + sum(wrist) / 2, 0, 0])) / (arm + 0.4), abs=1e-14)


@pytest.mark.parametrize(
    ("fields", "named"),
    [
        ({"wrist": 0.1}, "wrist"),
        ({"wrist": (0.1,)}, "wrist"),
        ({"wrist": (-0.1, 0.1)}, "wrist"),
        ({"wrist": (0.1, 0.0)}, "wrist"),
        ({"wrist": WRIST, "wrist_mass": 0.0}, "wrist_mass"),
        ({"wrist": WRIST, "wrist_limits": (1.0, 1.0)}, "wrist_limits"),
        ({"wrist": WRIST, "wrist_limits": (1.0, 0.0, 1.0)}, "wrist_limits"),
    ],
)
def test_bad_wrists_are_refused_by_name(fields: dict, named: str) -> None:
    with pytest.raises(sr.ParameterError) as caught:
        sr.InflatableArm(**fields)
    assert caught.value.field == named


def test_a_wrist_too_light_for_its_tiny_links_is_refused() -> None:
    with pytest.raises(sr.DescriptionError, match="wrist_mass"):
        sr.InflatableArm(wrist=WRIST, wrist_mass=1e-5).urdf()


# --- Full poses


def poses(model: sr.SoftModel, count: int, seed: int, largest: float = 18.0) -> list[tuple]:
    """Motors within the limits, a load, and the pose that they give: known to be reachable."""
    random = np.random.default_rng(seed)
    cases = []
    for number in range(count):
        motors = random.uniform(*model.motor_limits.T)
        push = random.normal(size=3)
        load = {"force": push / np.linalg.norm(push) * random.uniform(0.0, largest)}
        load["gravity"] = sr.EARTH_GRAVITY if number % 2 else None
        cases.append((motors, load, sr.solve_equilibrium(model, motors, **load).transform_tip_to_world))
    return cases


def apart(one: pin.SE3, other: pin.SE3) -> tuple[float, float]:
    """Distance [m] and angle [rad] between poses."""
    return float(np.linalg.norm(one.translation - other.translation)), float(
        np.linalg.norm(pin.log3(one.rotation.T @ other.rotation))
    )


def check_reached(model: sr.SoftModel, count: int, seed: int) -> None:
    """Reached to 1e-9 m and 1e-9 rad by an equilibrium solved anew, within the limits, no farther than the known motors."""
    missed = 0
    for motors, load, pose in poses(model, count, seed):
        found = sr.solve_ik(model, pose, **load)
        distance, angle = apart(sr.solve_equilibrium(model, found.q_motors, **load).transform_tip_to_world, pose)
        assert distance < 1.1e-9  # the equilibrium solved anew differs by its own tolerance
        assert angle < 1.1e-9
        assert np.all((found.q_motors >= model.motor_limits[:, 0]) & (found.q_motors <= model.motor_limits[:, 1]))
        missed += np.linalg.norm(found.q_motors) > np.linalg.norm(motors) + 1e-6  # see SAME
    assert missed <= 0.02 * count  # where the elbow is nearly straight or folded, random starts may miss the nearest solution


@pytest.mark.study
@pytest.mark.parametrize(
    "fields", [{"link_model": "two_hinges", "torsion": True}, {"payload": (0.4, 0.02, 0.0, 0.03)}, {"max_moment": 15.0}]
)
def test_other_arms_with_a_wrist_hold_poses_too(fields: dict) -> None:
    robot = sr.InflatableArm(wrist=WRIST, **fields)
    model = sr.load_model(robot)
    assert model.pinocchio.nv == robot.n_joints
    check_reached(model, 1, 6)


@pytest.mark.study
@pytest.mark.filterwarnings("ignore::softrobots.AssumedStiffnessWarning")
def test_a_wrist_behind_muscles_holds_poses() -> None:
    """The muscles stand behind the motors of the wrist in `q_motors`."""
    soft = sr.mount(
        sr.PccArm(segment_lengths=(0.4,), elastic_sections=1), "tip", sr.InflatableArm(link_lengths=(0.4,), wrist=WRIST)
    )
    model = sr.load_model(soft)
    assert spherical_wrist(model).joints == tuple(f"soft_motor_{i}" for i in (3, 4, 5))
    motors = model.relaxed_motors + (0.3, 0.5, -0.4, 0.6, 0.2, -0.01, 0.005, 0.0)
    pose = sr.solve_equilibrium(model, motors, (0, 1, -2)).transform_tip_to_world
    found = sr.solve_ik(model, pose, (0, 1, -2), starts=2)
    assert max(apart(sr.solve_equilibrium(model, found.q_motors, (0, 1, -2)).transform_tip_to_world, pose)) < 1.1e-9


@pytest.mark.study
@pytest.mark.shortened(12, 250)
def test_poses_of_random_motors_are_reached_under_load_all(wristed: sr.SoftModel, cases: int) -> None:
    check_reached(wristed, cases, 11)
    check_reached(sr.load_model(sr.InflatableArm(link_lengths=(0.5, 0.4, 0.3), wrist=(0.0, 0.1))), cases // 12, 12)


def test_a_pose_behind_a_folded_elbow_is_reached(wristed: sr.SoftModel) -> None:
    """Where the elbow nearly folds, the way to the pose is a bent valley, along which too much damping creeps."""
    motors, load, pose = poses(wristed, 116, 11)[-1]
    found = sr.solve_ik(wristed, pose, **load)
    assert found.q_motors == pytest.approx(motors, abs=1e-6)
    assert max(apart(found.equilibrium.transform_tip_to_world, pose)) < 1e-9


def closed_form(pose: pin.SE3, upper: float, fore: float, hand: float) -> list[np.ndarray]:
    """The eight or fewer solutions of a rigid arm with this wrist: cosine rule for the arm, then angles from the matrix."""
    rotation = pose.rotation
    centre = pose.translation - hand * rotation[:, 0]
    solutions = []
    for behind in (0, 1):
        yaw = np.arctan2(centre[1], centre[0]) + behind * np.pi
        along, up = np.hypot(centre[0], centre[1]) * (-1) ** behind, centre[2]
        cosine = (along**2 + up**2 - upper**2 - fore**2) / (2 * upper * fore)
        for elbow in (np.arccos(cosine), -np.arccos(cosine)) if abs(cosine) <= 1 else ():
            pitch = np.arctan2(up, along) - np.arctan2(fore * np.sin(elbow), upper + fore * np.cos(elbow))
            rest = (turn("z", yaw) @ turn("-y", pitch + elbow)).T @ rotation  # = P(a) Y(b) R(c)
            for cosine_b in (1, -1):
                b = np.arctan2(rest[1, 0], cosine_b * np.hypot(rest[0, 0], rest[2, 0]))
                a = np.arctan2(cosine_b * rest[2, 0], cosine_b * rest[0, 0])
                c = np.arctan2(-cosine_b * rest[1, 2], cosine_b * rest[1, 1])
                solutions.append(np.array([yaw, pitch, elbow, a, b, c]))
    return [(one + np.pi) % (2 * np.pi) - np.pi for one in solutions]


@pytest.mark.study
def test_a_stiff_arm_has_the_solutions_of_the_closed_form() -> None:
    """At 1e12 N m/rad the arm is rigid: same nearest solution, and no solution that the closed form does not have.

    Deflections are 20 N m / 1e12; angles err by the tolerance of the pose over the smallest singular value: 1e-9 / 0.01.
    """
    model = sr.load_model(sr.InflatableArm(stiffness=1e12, wrist=WRIST))
    low, high = model.motor_limits.T
    for _, _, pose in poses(model, 10, 3, largest=0.0):
        exact = [one for one in closed_form(pose, 0.6, 0.6 + WRIST[0], WRIST[1]) if np.all((one >= low) & (one <= high))]
        found = sr.solve_ik(model, pose)
        assert np.linalg.norm(found.q_motors) == pytest.approx(min(map(np.linalg.norm, exact)), abs=1e-6)
        for motors in (found.q_motors, *found.alternatives):
            turns = [np.abs((motors - one + np.pi) % (2 * np.pi) - np.pi).max() for one in exact]
            assert min(turns) < 1e-6


@pytest.mark.study
def test_scipy_finds_no_nearer_motors(wristed: sr.SoftModel) -> None:
    """SLSQP from random starts: least change of the motors at given pose and balance of the springs, all ten joints unknown."""
    random = np.random.default_rng(2)
    low, high = wristed.motor_limits.T
    for motors, load, pose in poses(wristed, 2, 21, largest=10.0):
        found = sr.solve_ik(wristed, pose, **load)

        def gap(x: np.ndarray, pose: pin.SE3 = pose, load: dict = load) -> np.ndarray:
            e = sr.solve_equilibrium(wristed, x, **load)
            here = e.transform_tip_to_world
            return np.concatenate([here.translation - pose.translation, pin.log3(pose.rotation.T @ here.rotation)])

        best = np.inf
        for start in (motors + 0.1, *(random.uniform(low, high) for _ in range(2))):
            answer = optimize.minimize(
                lambda x: x @ x, np.clip(start, low, high), jac=lambda x: 2 * x, method="SLSQP",
                bounds=list(zip(low, high, strict=True)), constraints={"type": "eq", "fun": gap}, options={"maxiter": 60},
            )  # fmt: skip
            if np.abs(gap(answer.x)).max() < 1e-6:
                best = min(best, float(np.linalg.norm(answer.x)))
        assert best < np.inf
        assert np.linalg.norm(found.q_motors) <= best + 1e-4  # its own tolerance


@pytest.mark.study
def test_a_pose_may_be_an_se3_a_matrix_or_position_and_orientation(wristed: sr.SoftModel) -> None:
    (_, load, pose), *_ = poses(wristed, 1, 8)
    one, two, three = (
        sr.solve_ik(wristed, pose, **load),
        sr.solve_ik(wristed, pose.homogeneous, **load),
        sr.solve_ik(wristed, pose.translation, orientation=pose.rotation, **load),
    )
    assert np.array_equal(one.q_motors, two.q_motors)
    assert np.array_equal(one.q_motors, three.q_motors)
    wrong = pose.homogeneous
    wrong[:3, :3] *= 1.001
    for target, options in ((wrong, {}), (pose.homogeneous.T, {}), (pose, {"orientation": np.eye(3)})):
        with pytest.raises(sr.ParameterError):
            sr.solve_ik(wristed, target, **options)
    with pytest.raises(sr.ParameterError, match="3 freedoms, 6 are needed"):
        sr.solve_ik(sr.load_model(sr.InflatableArm()), pose)


@pytest.mark.study
def test_what_is_out_of_reach_or_singular_is_named(wristed: sr.SoftModel) -> None:
    with pytest.raises(sr.TargetUnreachable, match=r"within 0\.1 m"):
        sr.solve_ik(wristed, pin.SE3(np.eye(3), np.array([1.5, 0.0, 0.0])))
    load = {"force": PUSH, "gravity": sr.EARTH_GRAVITY}
    for yaw, singular in ((np.pi / 2, True), (-np.pi / 2, True), (1.5, False), (0.0, False)):
        pose = sr.solve_equilibrium(wristed, (0.3, 0.6, -0.8, 0.2, yaw, 0.1), **load).transform_tip_to_world
        found = sr.solve_ik(wristed, pose, **load)
        assert max(apart(found.equilibrium.transform_tip_to_world, pose)) < 1e-9
        said = found.wrist_singularity
        assert (said is not None) == singular
        assert said is None or said.startswith("the wrist is singular: the axes of motor_4 and motor_6 are parallel")


def test_an_arm_whose_last_joints_are_no_spherical_wrist_has_none() -> None:
    assert spherical_wrist(sr.load_model(sr.InflatableArm())) is None  # springs between its motors
    assert spherical_wrist(sr.load_model(sr.PccArm())) is None
    model = sr.load_model(sr.InflatableArm(wrist=WRIST))
    moved = re.sub(
        r'(<joint name="motor_6" type="revolute">\s*<origin [^>]*xyz=")0.0 0.0 0.0"', r'\g<1>0.0 0.01 0.0"', model.urdf
    )
    assert moved != model.urdf
    assert spherical_wrist(sr.load_model(moved)) is None  # the axes do not meet


@pytest.mark.study
def test_the_elbow_is_the_last_motor_before_the_wrist(wristed: sr.SoftModel) -> None:
    """Its height over the line from shoulder to tip, computed here from the joint positions."""
    pose = sr.solve_equilibrium(wristed, (0.3, 0.2, -0.8, 0.4, 0.2, 0.1)).transform_tip_to_world
    for side, sign in (("up", 1.0), ("down", -1.0)):
        found = sr.solve_ik(wristed, pose, elbow=side)
        elbow = frame_placement(wristed, found.equilibrium.q, "motor_3").translation
        along = pose.translation / np.linalg.norm(pose.translation)
        assert sign * (elbow - along * (along @ elbow))[2] > 0.0


# --- Paths of poses


@pytest.fixture(scope="module")
def path() -> sr.Path3D:
    """From a hand that points forward to one that points down, while the tip moves half a metre."""
    first = pin.SE3(pin.rpy.rpyToMatrix(0.2, 0.3, -0.4), np.array([0.7, -0.4, 0.4]))
    last = pin.SE3(pin.rpy.rpyToMatrix(-0.5, 1.4, 0.6), np.array([0.9, 0.2, 0.2]))
    return sr.straight_line(first, last, 2.0, 30)


def test_a_straight_line_turns_about_one_axis(path: sr.Path3D) -> None:
    """By the quintic law: the turn from the start is parallel to the whole one, and as long as the share of the way."""
    whole = pin.log3(path.orientations[0].T @ path.orientations[-1])
    for share, rotation in zip(path.times / 2.0, path.orientations, strict=True):
        assert np.allclose(pin.log3(path.orientations[0].T @ rotation), sr.quintic(share) * whole, atol=1e-12)
    assert path.targets.shape == (31, 4, 4)
    with pytest.raises(sr.ParameterError, match="the same kind"):
        sr.straight_line((0, 0, 0), np.eye(4), 1.0)


@pytest.mark.study
def test_a_path_of_poses_is_followed_under_load(wristed: sr.SoftModel, path: sr.Path3D, tmp_path: Path) -> None:
    load = {"force": PUSH, "gravity": sr.EARTH_GRAVITY}
    followed = sr.follow_trajectory(wristed, path.targets, times=path.times, **load)
    assert followed.tip_error.max() < 1e-9
    assert followed.orientation_error.max() < 1e-9
    for motors, target in zip(followed.q_motors[::6], path.targets[::6], strict=True):
        pose = sr.solve_equilibrium(wristed, motors, **load).transform_tip_to_world
        assert max(apart(pose, pin.SE3(target))) < 1.1e-9
    assert np.abs(np.diff(followed.q_motors, axis=0)).max() < 0.2  # no jump on the way
    again = sr.follow_trajectory(wristed, [pin.SE3(one) for one in path.targets[:3]], **load)
    assert np.allclose(again.q_motors, followed.q_motors[:3], atol=1e-7)
    loaded = sr.load_result(sr.save_result(followed, tmp_path / "path.npz"))
    assert np.array_equal(loaded.orientations, followed.orientations)
    assert np.array_equal(loaded.q_motors, followed.q_motors)
    read = sr.read_waypoints(sr.save_csv(followed, tmp_path / "path.csv"))
    assert np.allclose(read.targets, path.targets, atol=1e-15)
    with pytest.raises(sr.ParameterError, match="poses"):
        sr.follow_trajectory(wristed, path.targets, times=path.times, method="paper")
    with pytest.raises(sr.ParameterError, match="at least one target"):
        sr.follow_trajectory(wristed, np.zeros((2, 3, 3)))


@pytest.mark.study
def test_a_path_through_a_singular_wrist_passes_and_one_beside_it_is_named(wristed: sr.SoftModel) -> None:
    """Through yaw = 90 degrees the hand goes on; 1e-4 rad beside it pitch and roll would turn half round at one point."""
    q = np.array([0.3, 0.6, -0.8, 0.2, 1.2, 0.1])
    through = [wristed_pose(wristed, q + [0, 0, 0, 0, step, 0]) for step in np.linspace(0.0, 0.7, 9)]
    assert sr.follow_trajectory(wristed, through, PUSH, q_motors0=q).orientation_error.max() < 1e-9
    # Past the pole at 0.03 rad the pitch would have to turn by nearly half a turn, which its limits do not allow.
    ends = [wristed_pose(wristed, motors) for motors in (q, q + [0, 0, 0, np.pi - 0.16, 0, -np.pi])]
    beside = sr.straight_line(*ends, 1.0, 10).targets
    with pytest.raises(sr.TargetUnreachable, match=r"waypoint 6 of 11.*nearly singular: the axes of motor_4 and motor_6"):
        sr.follow_trajectory(wristed, beside, PUSH, q_motors0=q)
    jumped = sr.follow_trajectory(wristed, beside, PUSH, q_motors0=q, allow_jumps=True)
    assert max(jumped.tip_error.max(), jumped.orientation_error.max()) < 1e-9
    # A wrist that may turn on, and a path with finer steps, goes past.
    free = sr.load_model(sr.InflatableArm(wrist=WRIST, wrist_limits=(6.0, 1.57, 6.0)))
    past = sr.follow_trajectory(free, sr.straight_line(*ends, 1.0, 30).targets, PUSH, q_motors0=q)
    assert max(past.tip_error.max(), past.orientation_error.max()) < 1e-9


def wristed_pose(model: sr.SoftModel, motors: np.ndarray) -> pin.SE3:
    """The pose of the loaded tip."""
    return sr.solve_equilibrium(model, motors, PUSH).transform_tip_to_world


# --- The command


@pytest.mark.study
def test_the_command_finds_poses_and_follows_files_of_them(
    wristed: sr.SoftModel, path: sr.Path3D, tmp_path: Path, capsys: pytest.CaptureFixture
) -> None:
    """Roll, pitch and yaw as in URDF: yaw first. Angles of five digits are met to their own rounding."""
    arm, load = ["ik", "inflatable_arm", "--set", "wrist=[0.08,0.12]"], ["--force", "0", "10", "-15"]
    target = ["--target", "0.8", "0.3", "0.1", "--rpy", "0.2", "1.1", "-0.4"]
    assert main([*arm, *target, *load, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    pose = wristed_pose(wristed, np.array(found["q_motors"]))
    wanted = turn("z", -0.4) @ turn("-y", -1.1) @ turn("x", 0.2)
    assert max(apart(pose, pin.SE3(wanted, np.array([0.8, 0.3, 0.1])))) < 1.1e-9
    assert found["wrist_singularity"] is None
    rows = [
        [*position, *pin.rpy.matrixToRpy(rotation)]
        for position, rotation in zip(path.positions, path.orientations, strict=True)
    ]
    lines = ["x,y,z,roll,pitch,yaw", *(",".join(map(repr, map(float, row))) for row in rows[::10])]
    file = tmp_path / "poses.csv"
    file.write_text("\n".join(lines), encoding="utf-8")
    assert main([*arm, "--waypoints", str(file), *load, "--json"]) == 0
    followed = json.loads(capsys.readouterr().out)
    assert np.allclose(followed["orientations"], path.orientations[::10], atol=1e-12)
    assert max(followed["orientation_error"]) < 1e-9
    assert main([*arm, "--waypoints", str(file), *load]) == 0
    assert "largest angle" in capsys.readouterr().out
    file.write_text("x,y,z,roll\n1,2,3,0\n1,2,3,1\n", encoding="utf-8")
    assert main([*arm, "--waypoints", str(file)]) == 2
    assert "all three or none are required" in capsys.readouterr().err
