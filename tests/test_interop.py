"""The shipped URDF in other tools: every link is where Pinocchio puts it, and nothing of the mass is lost."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from importlib import metadata
from pathlib import Path
from types import ModuleType

import numpy as np
import pinocchio as pin
import pytest

import softrobots as sr
from softrobots.kinematics import frame_placement
from softrobots.paths import urdf_folder
from softrobots.robots import Robot
from tests.conftest import missing

FILE = urdf_folder() / "inflatable_arm.urdf"


@pytest.fixture
def configurations(arm: sr.SoftModel) -> Iterator[tuple[dict[str, float], np.ndarray]]:
    rng = np.random.default_rng(5)
    names = (*arm.motor_joints, *arm.spring_joints)
    return [
        (dict(zip(names, values, strict=True)), arm.configuration(values[:3], values[3:]))
        for values in np.c_[rng.uniform(-3, 3, (20, 3)), rng.uniform(-1.5, 1.5, (20, 4))]
    ]


LINKS = ("base_link", "shoulder", "link_1_root", "hinge_1", "link_1", "link_2_root", "hinge_2", "link_2", "tip")


def test_mujoco(tool: Callable[[str], ModuleType], arm: sr.SoftModel, configurations: list) -> None:
    mujoco = tool("mujoco")
    model = mujoco.MjModel.from_xml_path(str(FILE))
    data = mujoco.MjData(model)
    assert model.nq == 7
    assert model.body_mass.sum() == pytest.approx(2.0 + sum(i.mass for i in arm.pinocchio.inertias[1:]), rel=1e-12)
    for values, q in configurations:
        for name, value in values.items():
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        for link in LINKS:
            ours = frame_placement(arm, q, link)
            assert np.allclose(data.body(link).xpos, ours.translation, atol=1e-9)
            assert np.allclose(data.body(link).xmat.reshape(3, 3), ours.rotation, atol=1e-9)


def test_mujoco_reaches_the_same_equilibrium_when_told_the_stiffness(
    tool: Callable[[str], ModuleType], arm: sr.SoftModel
) -> None:
    """MuJoCo drops the springs of a URDF, so they are set by hand; its own static torques then vanish at our answer."""
    mujoco = tool("mujoco")
    model = mujoco.MjModel.from_xml_path(str(FILE))
    for name, (stiffness, rest) in arm.spring_table.items():
        joint = model.joint(name)
        model.jnt_stiffness[joint.id] = stiffness
        model.qpos_spring[joint.qposadr[0]] = rest
    model.opt.gravity[:] = sr.EARTH_GRAVITY
    data = mujoco.MjData(model)
    motors, force = (0.3, 0.6, -0.8), np.array([0.0, 10.0, -15.0])
    found = sr.solve_equilibrium(arm, motors, force, gravity=sr.EARTH_GRAVITY)
    for name, value in zip((*arm.motor_joints, *arm.spring_joints), (*found.q_motors, *found.q_springs), strict=True):
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, model.body("tip").id)
    balance = jacobian.T @ force + data.qfrc_passive - data.qfrc_bias
    springs = [model.joint(name).dofadr[0] for name in arm.spring_joints]
    assert np.abs(balance[springs]).max() < 1e-8
    assert data.ncon == 0  # no collision shapes touch across a hinge


def test_drake(tool: Callable[[str], ModuleType], arm: sr.SoftModel, configurations: list) -> None:
    tool("pydrake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(FILE))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    assert plant.num_positions() == 7
    for values, q in configurations:
        for name, value in values.items():
            plant.GetJointByName(name).set_angle(context, value)
        for link in LINKS:
            pose = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(link)).GetAsMatrix4()
            assert np.allclose(pose, frame_placement(arm, q, link).homogeneous, atol=1e-9)


def test_pybullet(tool: Callable[[str], ModuleType], arm: sr.SoftModel, configurations: list) -> None:
    """Single precision inside: 1e-5."""
    if sys.version_info >= (3, 12):
        pytest.skip("pybullet has no wheels above Python 3.11")
    pybullet = tool("pybullet")
    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(str(FILE), useFixedBase=True, physicsClientId=client)
        info = [pybullet.getJointInfo(robot, i, physicsClientId=client) for i in range(pybullet.getNumJoints(robot, client))]
        places = {row[1].decode(): row[0] for row in info}
        links = {row[12].decode(): row[0] for row in info}
        for values, q in configurations:
            for name, value in values.items():
                pybullet.resetJointState(robot, places[name], value, physicsClientId=client)
            for link in LINKS:
                state = pybullet.getLinkState(robot, links[link], computeForwardKinematics=True, physicsClientId=client)
                assert np.allclose(state[4], frame_placement(arm, q, link).translation, atol=1e-5)
        masses = [pybullet.getDynamicsInfo(robot, place, physicsClientId=client)[0] for place in links.values()]
        assert sum(masses) == pytest.approx(2.0 + sum(i.mass for i in arm.pinocchio.inertias[1:]), rel=1e-6)
    finally:
        pybullet.disconnect(client)


# --- The chains of the PCC arm and of the helical tube: every joint by itself, as other tools see it

TUBE_MASS = 920.0 * np.pi * 0.0331 * 1e-4 * 1.5  # wall of the helical tube
MASSES = {"pcc_arm": (2.0, 1.048 * 0.6), "pcc_arm_lumped": (2.0, 1.048 * 0.6)}
MASSES |= {"helix_tube": (0.5, TUBE_MASS), "helix_tube_lumped": (0.5, TUBE_MASS)}
"""Mass of the base and of what moves [kg]."""
SECTION_FILES = [urdf_folder() / f"{name}.urdf" for name in MASSES]
SECTION_FRAMES = ("segment_1", "tip")


def poses_anywhere(file: Path) -> tuple[dict[str, bool], float, list[tuple[dict[str, float], dict[str, np.ndarray]]]]:
    """Joints (and whether they slide), mass with the base, and Pinocchio's poses at five draws within the joint limits.

    Pinocchio alone: nothing of softrobots stands between.
    """
    model = pin.buildModelFromUrdf(str(file))
    data, rng = model.createData(), np.random.default_rng(6)
    names = list(model.names)[1:]
    cases = []
    for _ in range(5):
        q = rng.uniform(0.4 * model.lowerPositionLimit, 0.4 * model.upperPositionLimit)
        pin.framesForwardKinematics(model, data, q)
        poses = {frame: data.oMf[model.getFrameId(frame)].homogeneous.copy() for frame in SECTION_FRAMES}
        cases.append((dict(zip(names, q.tolist(), strict=True)), poses))
    sliding = {name: model.joints[model.getJointId(name)].shortname().startswith("JointModelP") for name in names}
    return sliding, sum(MASSES[file.stem]), cases


@pytest.mark.parametrize("file", SECTION_FILES, ids=lambda file: file.stem)
def test_robot_of_sections_in_yourdfpy(file: Path) -> None:
    import yourdfpy

    joints, _, cases = poses_anywhere(file)
    robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
    assert set(robot.actuated_joint_names) == set(joints)
    for values, poses in cases:
        robot.update_cfg(values)
        for frame, pose in poses.items():
            assert np.allclose(robot.get_transform(frame, "world"), pose, atol=1e-9)


@pytest.mark.parametrize("file", SECTION_FILES, ids=lambda file: file.stem)
def test_robot_of_sections_in_mujoco(tool: Callable[[str], ModuleType], file: Path) -> None:
    mujoco = tool("mujoco")
    joints, mass, cases = poses_anywhere(file)
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    assert model.nq == len(joints)
    assert model.body_mass.sum() == pytest.approx(mass, rel=1e-12)
    for values, poses in cases:
        for name, value in values.items():
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        for frame, pose in poses.items():
            assert np.allclose(data.body(frame).xpos, pose[:3, 3], atol=1e-9)
            assert np.allclose(data.body(frame).xmat.reshape(3, 3), pose[:3, :3], atol=1e-9)


@pytest.mark.parametrize("file", SECTION_FILES, ids=lambda file: file.stem)
def test_robot_of_sections_in_drake(tool: Callable[[str], ModuleType], file: Path) -> None:
    tool("pydrake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    joints, mass, cases = poses_anywhere(file)
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(str(file))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    assert plant.num_positions() == len(joints)
    assert plant.CalcTotalMass(context) == pytest.approx(mass, rel=1e-12)
    for values, poses in cases:
        for name, value in values.items():
            joint = plant.GetJointByName(name)
            (joint.set_translation if joints[name] else joint.set_angle)(context, value)
        for frame, pose in poses.items():
            found = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(frame)).GetAsMatrix4()
            assert np.allclose(found, pose, atol=1e-9)


@pytest.mark.parametrize("file", SECTION_FILES, ids=lambda file: file.stem)
def test_robot_of_sections_in_pybullet(tool: Callable[[str], ModuleType], file: Path) -> None:
    """Single precision inside: 1e-5. It takes fewer than 128 joints, fixed ones counted."""
    if sys.version_info >= (3, 12):
        pytest.skip("pybullet has no wheels above Python 3.11")
    pybullet = tool("pybullet")
    joints, mass, cases = poses_anywhere(file)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(str(file), useFixedBase=True, physicsClientId=client)
        info = [pybullet.getJointInfo(robot, i, physicsClientId=client) for i in range(pybullet.getNumJoints(robot, client))]
        places = {row[1].decode(): row[0] for row in info}
        links = {row[12].decode(): row[0] for row in info}
        assert set(joints) <= set(places)
        for values, poses in cases:
            for name, value in values.items():
                pybullet.resetJointState(robot, places[name], value, physicsClientId=client)
            for frame, pose in poses.items():
                state = pybullet.getLinkState(robot, links[frame], computeForwardKinematics=True, physicsClientId=client)
                turn = np.reshape(pybullet.getMatrixFromQuaternion(state[5]), (3, 3))
                assert np.allclose(state[4], pose[:3, 3], atol=1e-5)
                assert np.allclose(turn, pose[:3, :3], atol=1e-5)
        masses = [pybullet.getDynamicsInfo(robot, place, physicsClientId=client)[0] for place in links.values()]
        assert sum(masses) == pytest.approx(mass, rel=1e-6)
    finally:
        pybullet.disconnect(client)


def assert_mujoco_balances(mujoco: ModuleType, robot: Robot, force: np.ndarray, gravity: np.ndarray) -> sr.Equilibrium:
    """Under its weight and a tip force, with the stiffness set by hand: MuJoCo's static torques vanish at our answer.

    1e-8 N m: the solver stops at 1e-10 of some newton metres, MuJoCo's bias forces round at 1e-15 of each of 56 joints.
    """
    ours = sr.load_model(robot)
    found = sr.solve_equilibrium(ours, [], force, gravity=gravity)
    model = mujoco.MjModel.from_xml_string(robot.urdf())
    data = mujoco.MjData(model)
    assert {model.joint(i).name for i in range(model.njnt)} == set(ours.spring_joints)
    model.opt.gravity[:] = gravity
    for name, value in zip(ours.spring_joints, found.q_springs, strict=True):
        joint = model.joint(name)
        model.jnt_stiffness[joint.id], model.qpos_spring[joint.qposadr[0]] = ours.spring_table[name]
        data.qpos[joint.qposadr[0]] = value
    mujoco.mj_forward(model, data)
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacBody(model, data, jacobian, None, model.body("tip").id)
    balance = jacobian.T @ force + data.qfrc_passive - data.qfrc_bias
    assert np.abs(balance).max() < 1e-8
    assert np.allclose(data.body("tip").xpos, found.tip_position, atol=1e-12)
    assert data.ncon == 0
    return found


@pytest.mark.parametrize(
    "parameters", [{}, {"torsion": False, "extension": False}, {"radius": 0.02, "hinge_rule": "midpoint"}], ids=str
)
def test_mujoco_agrees_with_the_equilibrium_of_a_lumped_arm(tool: Callable[[str], ModuleType], parameters: dict) -> None:
    """Without muscles."""
    robot = sr.robots.PccArm(muscle_azimuths=(), chain="lumped", hinges=7, **parameters)
    found = assert_mujoco_balances(tool("mujoco"), robot, np.array([3.0, -4.5, 1.3]), np.array(sr.EARTH_GRAVITY))
    assert np.hypot(*found.tip_position[:2]) > 0.3  # bent in earnest


def test_a_third_party_robot_with_springs_said_by_the_caller() -> None:
    """The UR5 of example-robot-data, with a soft wrist: kinematics as in yourdfpy, springs in balance."""
    import yourdfpy

    try:
        distribution = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        missing("example-robot-data is not installed")
    place = "cmeel.prefix/share/example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
    file = Path(distribution.locate_file(place)).resolve()
    model = sr.load_model(file, springs={"wrist_1_joint": 40.0, "wrist_3_joint": (25.0, 0.1)}, tip="tool0")
    assert model.motor_joints == ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_2_joint")
    motors = (0.3, -1.0, 1.2, 0.4)
    found = sr.solve_equilibrium(model, motors, (3, 5, -10), gravity=sr.EARTH_GRAVITY)
    assert found.stable
    robot = yourdfpy.URDF.load(str(file), load_meshes=False, build_collision_scene_graph=False)
    names = (*model.motor_joints, *model.spring_joints)
    robot.update_cfg(dict(zip(names, (*found.q_motors, *found.q_springs), strict=True)))
    assert np.allclose(robot.get_transform("tool0", "world"), found.transform_tip_to_world.homogeneous, atol=1e-12)
    reached = sr.solve_ik(model, found.tip_position, (3, 5, -10), gravity=sr.EARTH_GRAVITY, q_motors0=motors, starts=4)
    assert reached.error <= 1e-9
