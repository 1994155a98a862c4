"""Loading: our files, other people's files, and everything that is refused."""

from __future__ import annotations

import pickle
import timeit
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.compiled.sweeps.arm_solver import SweepCase
from softrobots.model.pinocchio_data import MAX_DOF
from softrobots.statics.kinematics import frame_placement
from tests.support.foreign import BRANCHED, INERTIAL, SPRINGS, joint
from tests.support.tables import each_row


def test_springs_of_the_caller_on_a_foreign_file() -> None:
    model = sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")
    assert set(model.motor_joints) == {"shoulder", "elbow", "gripper"}
    assert model.spring_table == {"wrist": (20.0, 0.1), "slider": (800.0, 0.0)}
    assert model.spring_groups == ()
    assert model.reach == pytest.approx(4 * 0.3 + 4.0)  # four offsets, and a slider that travels from -2 to 2 m
    unlimited = model.motor_limits[model.motor_joints.index("shoulder")]
    assert unlimited.tolist() == [-np.inf, np.inf]


def test_a_continuous_joint_takes_an_angle() -> None:
    """Pinocchio stores cosine and sine; the same robot with a revolute shoulder has the same geometry."""
    model = sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")
    limited = BRANCHED.replace('"continuous"><', '"revolute"><limit lower="-9" upper="9" effort="1" velocity="1"/><')
    twin = sr.load_model(limited, springs=SPRINGS, tip="finger")
    assert (model.pinocchio.nq, twin.pinocchio.nq) == (6, 5)
    motors = dict(shoulder=2.2, elbow=-0.4, gripper=0.3)
    poses = [
        frame_placement(m, m.configuration([motors[name] for name in m.motor_joints], [0.2, 0.05]), "finger").homogeneous
        for m in (model, twin)
    ]
    assert np.allclose(*poses, atol=1e-15)
    found = [
        sr.solve_equilibrium(m, [motors[name] for name in m.motor_joints], (1, 2, 3), gravity=sr.EARTH_GRAVITY)
        for m in (model, twin)
    ]
    assert np.allclose(found[0].q_springs, found[1].q_springs, atol=1e-14)


def test_joints_that_are_not_named_are_locked() -> None:
    model = sr.load_model(BRANCHED, springs=SPRINGS, motors=["elbow"], tip="finger")
    assert model.motor_joints == ("elbow",)
    assert model.pinocchio.nv == 3
    full = sr.load_model(BRANCHED, springs=SPRINGS, tip="finger")
    motors = [0.7 if name == "elbow" else 0.0 for name in full.motor_joints]
    a = frame_placement(model, model.configuration([0.7]), "finger").homogeneous
    assert np.allclose(a, frame_placement(full, full.configuration(motors), "finger").homogeneous, atol=1e-15)


def test_a_rigid_robot_is_loaded_when_said_so() -> None:
    model = sr.load_model(BRANCHED, springs={}, tip="finger")
    assert model.n_springs == 0
    result = sr.solve_equilibrium(model, np.zeros(5), (1.0, 2.0, 3.0))
    assert result.stable
    assert result.residual == 0.0


def test_springs_of_the_caller_go_before_those_of_the_file() -> None:
    """Joint by joint; the others of the file stay, and every joint says what became of it."""
    robot = sr.InflatableArm(rest_up=0.3)
    model = sr.load_model(robot, springs={"spring_1_up": 99.0, "spring_2_up": (80.0, -0.1), "motor_3": 40.0})
    assert model.spring_table == {
        "spring_1_side": (172.71, 0.0),
        "spring_1_up": (99.0, 0.3),  # a stiffness alone keeps the rest of the file
        "motor_3": (40.0, 0.0),
        "spring_2_side": (172.71, 0.0),
        "spring_2_up": (80.0, -0.1),
    }
    assert model.joint_roles == {
        "motor_1": "motor",
        "motor_2": "motor",
        "spring_1_side": "spring",
        "spring_1_up": "given spring",
        "motor_3": "given spring",
        "spring_2_side": "spring",
        "spring_2_up": "given spring",
    }
    assert len(model.spring_groups) == 2


def test_a_spring_of_the_file_is_taken_away_by_name() -> None:
    """Its joint is a motor, or locked if others are named; also after a file, a process, or a worker of a sweep."""
    without: dict[str, float | None] = {"spring_1_side": None, "spring_2_side": None}
    model = sr.load_model(sr.InflatableArm(), springs=without)
    assert model.spring_joints == ("spring_1_up", "spring_2_up")
    assert model.n_motors == 5
    assert model.spring_groups == ()
    flat = sr.load_model(sr.InflatableArm(), springs=without, motors=["motor_1", "motor_2", "motor_3"])
    assert [name for name, role in flat.joint_roles.items() if role == "locked"] == list(without)
    for each in (model, flat):
        twin = pickle.loads(pickle.dumps(each))
        assert twin == each
        assert twin.joint_roles == each.joint_roles
    case = SweepCase.of(flat, np.array([0.0, 0.0, -1.0]), np.array([1.0]), gravity=None, tolerance=1e-9, backend="python")
    assert case.model() == flat


def test_with_springs_takes_tens_of_microseconds() -> None:
    """16 us for an arm on an idle machine; the bound leaves room for a loaded one. Loading the text again takes 1.5 ms."""
    model = sr.load_model(sr.InflatableArm())
    assert min(timeit.repeat(lambda: sr.with_springs(model, {"spring_1_up": 99.0}), number=20, repeat=20)) / 20 < 100e-6


@each_row(
    ("springs", "error", "message"),
    [
        ({"spring_3_up": 1.0}, sr.NameNotFound, r"no joint with a spring is called 'spring_3_up'.*available: spring_1_side"),
        ({"motor_1": 1.0}, sr.NameNotFound, "no joint with a spring is called 'motor_1'"),
        ({"spring_1_up": 0.0}, sr.ParameterError, "springs.*positive"),
        ({"spring_1_up": None}, sr.ParameterError, "springs.*finite number"),
        ({"spring_1_up": (1.0, float("inf"))}, sr.ParameterError, "springs.*finite"),
        ([("spring_1_up", 1.0)], sr.ParameterError, "mapping"),
    ],
)
def test_other_springs_than_those_of_a_model_are_refused(springs: Any, error: type, message: str, arm: sr.SoftModel) -> None:
    with pytest.raises(error, match=message):
        sr.with_springs(arm, springs)


def test_with_springs_refuses_what_loading_refuses() -> None:
    with pytest.raises(sr.ParameterError, match="SoftModel"):
        sr.with_springs(sr.InflatableArm(), {})  # type: ignore[arg-type]
    with pytest.raises(sr.NameNotFound, match=r"'section_1_1_bend_x'; available: none"):  # EI, GJ and EA are of the file
        sr.with_springs(sr.load_model(sr.PccArm()), {"section_1_1_bend_x": 1.0})
    with pytest.raises(sr.DescriptionError, match="same stiffness"):
        sr.with_springs(sr.load_model(sr.InflatableArm(max_moment=12.0)), {"spring_1_up": 99.0})


@each_row(
    ("points", "error", "message"),
    [
        ([("here", ("link_1", (0, 0, 0)))], sr.ParameterError, "mapping"),
        ({"link_1": ("link_2", (0, 0, 0))}, sr.ParameterError, "names that no frame or joint"),
        ({"": ("link_2", (0, 0, 0))}, sr.ParameterError, "names that no frame or joint"),
        ({"here": "link_2"}, sr.ParameterError, r"a link and a point of it, \(link"),
        ({"here": ("link_9", (0, 0, 0))}, sr.NameNotFound, "no link is called 'link_9'.*available: .*link_1"),
        ({"here": ("link_1", (0, 0))}, sr.ParameterError, r"points\['here'\].*shape \(3,\)"),
        ({"here": ("link_1", (0, 0, float("nan")))}, sr.ParameterError, r"points\['here'\].*finite"),
    ],
)
def test_points_that_a_model_cannot_have_are_refused(points: Any, error: type, message: str, arm: sr.SoftModel) -> None:
    with pytest.raises(error, match=message):
        sr.with_points(arm, points)


def test_results_cannot_be_changed(arm: sr.SoftModel) -> None:
    for array in (arm.stiffness, arm.rest, arm.motor_limits, arm.spring_limits):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    for indices in (arm.motor_indices, arm.spring_indices):
        with pytest.raises(ValueError, match="read-only"):
            indices[0] = 0
    result = sr.solve_equilibrium(arm, (0.3, 0.6, -0.8), (0, 10, -15))
    with pytest.raises(TypeError):
        result.load.wrenches["tip"] = np.zeros(6)
    result.transform_tip_to_world.translation[:] = 0.0  # a copy
    assert result.tip_position[0] > 1.0


def test_threads_share_a_model_and_get_identical_bytes(arm: sr.SoftModel) -> None:
    def job(number: int) -> bytes:
        random = np.random.default_rng(number)
        gravity = (0.0, 0.0, -9.81) if number % 2 else tuple(random.normal(size=3))
        found = sr.solve_equilibrium(arm, random.uniform(-3, 3, 3), random.normal(size=3) * 20, gravity=gravity)
        return found.q_springs.tobytes() + found.motor_torques.tobytes()

    alone = [job(number) for number in range(200)]
    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(job, range(200))) == alone


def test_gravity_of_one_call_does_not_leak_into_the_next(arm: sr.SoftModel) -> None:
    before = sr.solve_equilibrium(arm, (0, 0.5, 0), (0, 1, 0)).q_springs
    sr.solve_equilibrium(arm, (0, 0.5, 0), (0, 1, 0), gravity=(0, 0, -100))
    assert np.array_equal(sr.solve_equilibrium(arm, (0, 0.5, 0), (0, 1, 0)).q_springs, before)
    assert np.array_equal(arm.pinocchio.gravity.linear, pin.Model().gravity.linear)


def test_gravities_take_turns_in_one_workspace(arm: sr.SoftModel, rng: np.random.Generator) -> None:
    """A large robot's takes a gigabyte. More gravities than a model keeps, and none of them leaves a trace in it."""
    gravities = [None, *(tuple(rng.normal(size=3)) for _ in range(10))]
    cases = [(gravities[rng.integers(11)], rng.uniform(-1, 1, 3), rng.normal(size=3)) for _ in range(60)]

    def solve(model: sr.SoftModel, gravity: object, motors: np.ndarray, force: np.ndarray) -> bytes:
        found = sr.solve_equilibrium(model, motors, force, gravity=gravity)
        return found.q_springs.tobytes() + found.motor_torques.tobytes()

    assert len({id(arm.workspace(gravity)[1]) for gravity in gravities}) == 1
    alone = {id(gravity): sr.load_model(arm.urdf) for gravity in gravities}  # a model for each
    assert [solve(arm, *case) for case in cases] == [solve(alone[id(case[0])], *case) for case in cases]


@each_row(
    ("source", "options", "error", "message"),
    [
        (BRANCHED, {}, sr.DescriptionError, r"no joint springs.*shoulder, elbow.*springs=\{\}"),
        (BRANCHED, {"springs": {"wirst": 10.0}}, sr.NameNotFound, r"'wirst' \(did you mean 'wrist'\?\); available: .*wrist"),
        (BRANCHED, {"springs": {"wrist": -1.0}}, sr.ParameterError, "springs.*positive"),
        (BRANCHED, {"springs": {"wrist": (1.0, float("nan"))}}, sr.ParameterError, "finite"),
        (BRANCHED, {"springs": ["wrist"]}, sr.ParameterError, "mapping"),
        (BRANCHED, {"springs": SPRINGS}, sr.DescriptionError, r"2 ends \(.*finger.*\); give the name of the tip frame"),
        (BRANCHED, {"springs": SPRINGS, "tip": "fingr"}, sr.NameNotFound, "'fingr'.*did you mean 'finger'"),
        (BRANCHED, {"springs": SPRINGS, "motors": ["elbw"]}, sr.NameNotFound, "'elbw'.*did you mean 'elbow'"),
        (BRANCHED, {"springs": SPRINGS, "motors": ["wrist"]}, sr.ParameterError, "without a spring"),
        (BRANCHED, {"springs": SPRINGS, "motors": ["elbow", "elbow"]}, sr.ParameterError, "repetition"),
        (BRANCHED, {"springs": SPRINGS, "tip": 3}, sr.NameNotFound, "frame is called '3'"),
        (BRANCHED, {"springs": SPRINGS, "motors": "elbow"}, sr.ParameterError, "list of joint names"),
        (
            "<robot name='r'><link name='a'/><link name='b'/></robot>",
            {"springs": {}},
            sr.DescriptionError,
            r"2 root links \(a, b\)",
        ),
        ("<scene/>", {"springs": {}}, sr.DescriptionError, r"root tag <scene>; one of <robot> \(URDF\), <mujoco> \(MJCF\)"),
        ("<robot", {}, sr.DescriptionError, "not well-formed"),
        ("no_such_file.urdf", {}, sr.DescriptionError, "cannot read 'no_such_file.urdf'"),
        (42, {}, sr.ParameterError, "a robot, a path, or URDF text"),
        (sr.InflatableArm, {}, sr.ParameterError, r"a robot, not its class: InflatableArm\(\)"),
        (
            BRANCHED.replace('lower="-2"', 'lower="3"'),
            {"springs": {}, "tip": "finger"},
            sr.DescriptionError,
            "lower limit 3.0 above",
        ),
        (
            f'<robot name="f"><link name="a">{INERTIAL}</link>' + joint("j", "a", "b", "0 0 1", "floating") + "</robot>",
            {"springs": {}},
            sr.DescriptionError,
            "revolute, continuous and prismatic",
        ),
    ],
)
def test_what_cannot_be_loaded_is_refused(source: object, options: dict, error: type, message: str) -> None:
    with pytest.raises(error, match=message) as caught:
        sr.load_model(source, **options)
    assert isinstance(caught.value, sr.SoftRobotsError)


def test_too_many_coordinates_are_refused_before_gigabytes_are_spent() -> None:
    model = sr.load_model(sr.InflatableArm(link_lengths=(0.1,) * 101))
    with pytest.raises(sr.DescriptionError, match=rf"has 304 coordinates.*at most {MAX_DOF} .*softrobots\.compile"):
        sr.solve_equilibrium(model, np.zeros(102))


def test_equal_models_are_equal(arm: sr.SoftModel) -> None:
    twin = sr.load_model(sr.InflatableArm().urdf())
    assert twin == arm
    assert hash(twin) == hash(arm)
    state = sr.solve_equilibrium(twin, (0.3, 0.6, -0.8), (0, 10, -15))
    assert sr.compliance(arm, state).shape == (6, 6)
    assert arm != sr.load_model(sr.InflatableArm(stiffness=170.0))
    assert arm != sr.load_model(sr.InflatableArm(), tip="link_2")


@pytest.mark.parametrize("given", [sr.InflatableArm(), "arm.urdf", None])
def test_what_is_no_model_is_refused_by_every_solver(given: object, arm: sr.SoftModel) -> None:
    state = sr.solve_equilibrium(arm, (0, 0, 0))
    for call in (
        lambda: sr.solve_equilibrium(given, (0, 0, 0)),
        lambda: sr.critical_load(given, (0, 0, 0), (-1, 0, 0)),
        lambda: sr.estimate_load(given, (0, 0, 0), (0, 0, 0)),
        lambda: sr.solve_ik(given, (1, 0, 0)),
        lambda: sr.follow_trajectory(given, [(1, 0, 0)]),
        lambda: sr.compliance(given, state),
        lambda: sr.elastostatic_jacobian(given, state),
        lambda: sr.view(given),
    ):
        with pytest.raises(sr.ParameterError, match=r"a SoftModel \(made by softrobots.load_model\)"):
            call()


def test_mimic_joints_are_locked_or_refused() -> None:
    text = BRANCHED.replace(
        '<joint name="gripper" type="revolute">', '<joint name="gripper" type="revolute"><mimic joint="elbow"/>'
    )
    with pytest.raises(sr.DescriptionError, match=r"joints that mimic others \(gripper\).*name the motors"):
        sr.load_model(text, springs=SPRINGS, tip="finger")
    model = sr.load_model(text, springs=SPRINGS, motors=["shoulder", "elbow"], tip="finger")
    assert model.motor_joints == ("shoulder", "elbow")


def test_a_spring_on_a_fixed_joint_is_refused(arm: sr.SoftModel) -> None:
    text = arm.urdf.replace('name="spring_2_up" type="revolute"', 'name="spring_2_up" type="fixed"')
    with pytest.raises(sr.DescriptionError, match="spring or a section on spring_2_up, which cannot move"):
        sr.load_model(text)


def test_a_folder_and_a_binary_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(sr.DescriptionError, match="cannot read"):
        sr.load_model(tmp_path)
    binary = tmp_path / "x.urdf"
    binary.write_bytes(bytes(range(256)))
    with pytest.raises(sr.DescriptionError, match="cannot read"):
        sr.load_model(binary)


@each_row(
    ("motors", "springs", "field"),
    [
        ((0.0, 0.0), None, "q_motors"),
        ((0.0, 0.0, float("nan")), None, "q_motors"),
        ("abc", None, "q_motors"),
        (((0.0, 0.0, 0.0),), None, "q_motors"),
        ((0.0, 0.0, 0.0), (0.0,), "q_springs"),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, float("inf")), "q_springs"),
    ],
)
def test_bad_coordinates_are_refused(arm: sr.SoftModel, motors: object, springs: object, field: str) -> None:
    with pytest.raises(sr.ParameterError, match=field):
        arm.configuration(motors, springs)


def test_unknown_frames_are_refused_with_the_known_ones(arm: sr.SoftModel) -> None:
    with pytest.raises(sr.NameNotFound, match=r"'tipp' \(did you mean 'tip'\?\); available: .*hinge_1") as caught:
        arm.frame_id("tipp")
    assert caught.value.available[-1] == "tip"


def test_drives_of_motors_are_those_of_the_file() -> None:
    """Rotor, viscous and dry friction, largest torque; through URDF, MJCF and SDF; without effect on statics."""
    robot = sr.InflatableArm(rotor_inertia=0.05, motor_effort=40.0)
    urdf = robot.urdf().replace('damping="0.0" friction="0.0"', 'damping="0.25" friction="0.5"', 1)
    model = sr.load_model(urdf)
    drives = model.actuators.drives
    assert drives.rotor_inertia.tolist() == [0.05] * 3
    assert drives.damping.tolist() == [0.25, 0.0, 0.0]
    assert drives.friction.tolist() == [0.5, 0.0, 0.0]
    assert drives.effort.tolist() == [40.0] * 3
    load = ((0.3, 0.6, -0.8), (0, 10, -15))
    plain = sr.solve_equilibrium(sr.load_model(sr.InflatableArm()), *load)
    assert np.array_equal(sr.solve_equilibrium(model, *load).q_springs, plain.q_springs)
    assert sr.load_model(urdf.replace('effort="40.0"', 'effort="0.0"', 1)).actuators.drives.effort[0] == np.inf
    muscles = sr.load_model(sr.PccArm())
    assert muscles.actuators.drives.effort.tolist() == [tag.strongest for tag in muscles.muscles]
    with pytest.raises(sr.DescriptionError, match="rotor of joint motor_1"):
        sr.load_model(robot.urdf().replace('rotor inertia="0.05"', 'rotor inertia="-1"', 1))


@pytest.mark.parametrize(("write", "module"), [("to_mjcf", "mujoco"), ("to_sdf", "pydrake")])
def test_rotors_and_friction_pass_through_other_formats(write: str, module: str, tool: Callable[[str], ModuleType]) -> None:
    other = tool(module)
    urdf = sr.InflatableArm(rotor_inertia=0.05).urdf().replace('friction="0.0"', 'friction="0.5"', 1)
    text = getattr(sr.export, write)(sr.load_model(urdf), damping="file")
    drives = sr.load_model(text).actuators.drives
    assert drives.rotor_inertia == pytest.approx([0.05] * 3, rel=1e-15)
    if module == "mujoco":  # Drake drops dry friction
        assert drives.friction.tolist() == [0.5, 0.0, 0.0]
        spec = other.MjModel.from_xml_string(text)
        assert sorted(spec.dof_armature.tolist()) == [0.0] * 4 + [0.05] * 3
    else:
        assert "<friction>0.5</friction>" in text


def test_a_robot_is_loaded_and_mounted_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The name wins over a file of that name, which a path means; an unknown one is told with names and files."""
    robot = sr.ROBOTS["inflatable_arm_two_hinges"]()
    model = sr.load_model("inflatable_arm_two_hinges")
    assert model == sr.load_model(robot)
    assert model.robot == robot
    assert sr.mount("inflatable_arm", "tip", "pcc_arm") == sr.mount(sr.InflatableArm(), "tip", sr.PccArm())
    monkeypatch.chdir(tmp_path)
    (tmp_path / "pcc_arm").write_text(robot.urdf(), encoding="utf-8")
    (tmp_path / "other.urdf").write_text(robot.urdf(), encoding="utf-8")
    assert sr.load_model("pcc_arm") == sr.load_model(sr.PccArm())
    assert sr.load_model(Path("pcc_arm")) == sr.load_model("./pcc_arm") == model
    with pytest.raises(
        sr.DescriptionError, match=r"name of a robot is required: helix_tube, inflatable_arm, .*; files in \.: other"
    ):
        sr.load_model("helix_tub")


def test_springs_for_some_joints_leave_the_others_as_they_are() -> None:
    """No spring becomes a motor unless None says so, and the roles tell what became of every joint."""
    model = sr.load_model(sr.InflatableArm().urdf(), springs={"spring_1_side": 100.0, "spring_1_up": 120.0})
    assert model.actuator_names == ("motor_1", "motor_2", "motor_3")
    assert model.stiffness.tolist() == [100.0, 120.0, 172.71, 172.71]
    assert [model.joint_roles[f"spring_{place}"] for place in ("1_up", "2_up")] == ["given spring", "spring"]
